#include "client/cli/job_flags.h"

#include <limits>
#include <optional>
#include <utility>

#include <CLI/CLI.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/cli/command_support.h"
#include "client/cli/option_support.h"
#include "client/files/mesh_file.h"
#include "core/base/status_macros.h"
#include "core/pipeline/match_options.h"

namespace isomatch {
namespace {

std::optional<absl::Duration> PositiveDuration(const std::string& text) {
  absl::Duration duration;
  if (absl::ParseDuration(text, &duration) && duration > absl::ZeroDuration() &&
      duration < absl::InfiniteDuration()) {
    return duration;
  }
  return std::nullopt;
}

// Empty means no limit.
absl::StatusOr<absl::Duration> ParseTimeout(const std::string& flag,
                                            const std::string& text) {
  if (text.empty()) return absl::InfiniteDuration();
  if (const auto duration = PositiveDuration(text)) return *duration;
  return absl::InvalidArgumentError(
      absl::StrCat(flag, " is '", text,
                   "', expected a duration above 0, e.g. 90s, 10m or 2h30m"));
}

void AddDeadlineFlag(CLI::App* command, JobOptions* options) {
  const auto set = [options](const std::string& text) {
    const std::optional<absl::Duration> duration = PositiveDuration(text);
    if (!duration) {
      throw CLI::ValidationError(
          "--deadline",
          absl::StrCat("'", text,
                       "', expected a duration above 0, e.g. 300ms or 2s"));
    }
    options->deadline = *duration;
  };
  command
      ->add_option_function<std::string>(
          "--deadline", set,
          "Take the best map there is once the job has run this long, e.g. "
          "300ms; the first whole one is waited for; with --profile default")
      ->type_name("DURATION");
}

// What the API takes; a server uses no more than its share.
constexpr std::uint64_t kMostThreads = 1024;

void AddRelationFlags(CLI::App* command, JobOptions* options) {
  SetChoices(
      command->add_option(
          "--relation", options->relation,
          "whole: all of both shapes corresponds; part-of-y: X is a "
          "part of Y, cut off or scanned; part-of-x: Y is a part of X; "
          "overlap: each lacks what the other has, in one unit; auto: one of "
          "these, by open rims and by what map is most confident"),
      "NAME", RelationNames())
      ->capture_default_str();
  SetChoices(command->add_option(
                 "--scale", options->scale,
                 "With another --relation than whole: same where both meshes "
                 "have one unit, which is faster and surer; auto finds it out"),
             "NAME", LengthScaleNames())
      ->capture_default_str();
}

}  // namespace

void AddPairOptions(CLI::App* command, std::string* x, std::string* y,
                    LandmarkPaths* landmarks) {
  const std::string mesh =
      absl::StrCat("Mesh: ", kMeshFiles, ", .gz too; - is standard input");
  command->add_option("X", *x, mesh)->required()->type_name(kFile);
  command->add_option("Y", *y, mesh)->required()->type_name(kFile);
  CLI::Option* const pairs =
      command
          ->add_option("--landmarks", landmarks->pairs,
                       "File of known matches, lines `x y`")
          ->type_name(kFile)
          ->group(kMethodGroup);
  CLI::Option* const points_x =
      command->add_option("--landmarks-x", landmarks->points_x,
                          "Points on X: .mrk.json, .fcsv, or lines `x y z "
                          "[LABEL]`");
  CLI::Option* const points_y =
      command->add_option("--landmarks-y", landmarks->points_y,
                          "Points on Y, paired with those on X by label, else "
                          "by order");
  for (CLI::Option* const points : {points_x, points_y}) {
    points->type_name(kFile)->group(kMethodGroup)->excludes(pairs);
  }
  points_x->needs(points_y);
  points_y->needs(points_x);
}

void AddJobFlags(CLI::App* command, JobOptions* options) {
  command->add_flag("--landmarks-exact", options->landmarks_exact,
                    "Keep every landmark, even one that the rest contradicts");
  command
      ->add_option("--priority", options->priority,
                   "With --server: jobs of a higher one start first")
      ->check(CLI::Range(-100, 100).description(""))
      ->type_name("NUMBER")
      ->capture_default_str();
  SetChoices(command->add_option("--profile", options->profile,
                                 "default: what measured best; paper: as "
                                 "published"),
             "NAME", {"default", "paper"})
      ->capture_default_str();
  AddRelationFlags(command, options);
  command
      ->add_option("--random-seed", options->random_seed,
                   "The same seed gives the same map")
      ->check(WholeNumber(0, std::numeric_limits<std::uint64_t>::max()))
      ->type_name("SEED")
      ->capture_default_str();
  command
      ->add_option("--solved-vertices", options->solved_vertices,
                   "Decimate larger meshes to about this many vertices and "
                   "lift the map; 0 never does; by default as the profile says")
      ->check(WholeNumber(0, std::numeric_limits<std::int32_t>::max()))
      ->type_name("COUNT");
  command
      ->add_option("--memory-limit", options->memory_limit_bytes,
                   "Most memory of the job, e.g. 800MB or 2GB: it uses fewer "
                   "threads, then solves on fewer vertices, or is refused")
      ->transform(MemorySize())
      ->type_name("BYTES")
      ->default_str("none");
  command
      ->add_option(
          "--threads", options->threads,
          "Threads of each job, up to 1024; 0, or more than there are: "
          "all cores, or the server's share")
      ->check(WholeNumber(0, kMostThreads))
      ->type_name("COUNT")
      ->capture_default_str();
  AddDeadlineFlag(command, options);
  SetGroup(command, kMethodGroup,
           {"--landmarks-exact", "--profile", "--relation", "--scale",
            "--random-seed", "--solved-vertices", "--memory-limit", "--threads",
            "--deadline"});
  SetGroup(command, kServerGroup, {"--priority"});
  AddWeldOption(command, &options->weld);
}

void AddQueueFlags(CLI::App* command, QueueFlags* flags) {
  command
      ->add_option("--label", flags->labels,
                   "Label to find the job by; may be repeated")
      ->type_name("KEY=VALUE");
  command
      ->add_option("--queue-timeout", flags->queue_timeout,
                   "Fail the job when it has waited this long, e.g. 10m")
      ->type_name("DURATION");
  command
      ->add_option("--run-timeout", flags->run_timeout,
                   "Fail the job when it has run this long, e.g. 90s")
      ->type_name("DURATION");
  SetGroup(command, kServerGroup,
           {"--label", "--queue-timeout", "--run-timeout"});
}

absl::Status SetQueueFlags(const QueueFlags& flags, MatchRequest* request) {
  ISOMATCH_ASSIGN_OR_RETURN(request->labels,
                            ParseLabels("--label", flags.labels));
  ISOMATCH_ASSIGN_OR_RETURN(
      request->queue_timeout,
      ParseTimeout("--queue-timeout", flags.queue_timeout));
  ISOMATCH_ASSIGN_OR_RETURN(request->run_timeout,
                            ParseTimeout("--run-timeout", flags.run_timeout));
  return absl::OkStatus();
}

absl::StatusOr<std::map<std::string, std::string>> ParseLabels(
    const std::string& flag, const std::vector<std::string>& words) {
  std::map<std::string, std::string> labels;
  for (const std::string& word : words) {
    const std::pair<std::string, std::string> label =
        absl::StrSplit(word, absl::MaxSplits('=', 1));
    if (label.first.empty() || word.find('=') == std::string::npos) {
      return absl::InvalidArgumentError(
          absl::StrCat(flag, " is '", word, "', expected KEY=VALUE"));
    }
    if (!labels.insert(label).second) {
      return absl::InvalidArgumentError(absl::StrCat(
          flag, ": '", label.first, "' is given twice, expected once"));
    }
  }
  return labels;
}

}  // namespace isomatch
