#include "client/job_flags.h"

#include <utility>

#include <CLI/CLI.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "client/command_support.h"
#include "client/map_file.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

// Empty means no limit.
absl::StatusOr<absl::Duration> ParseTimeout(const std::string& flag,
                                            const std::string& text) {
  absl::Duration duration = absl::InfiniteDuration();
  if (text.empty()) return duration;
  if (absl::ParseDuration(text, &duration) && duration > absl::ZeroDuration() &&
      duration < absl::InfiniteDuration()) {
    return duration;
  }
  return absl::InvalidArgumentError(
      absl::StrCat(flag, " is '", text,
                   "', expected a duration above 0, e.g. 90s, 10m or 2h30m"));
}

}  // namespace

void AddPairOptions(CLI::App* command, std::string* x, std::string* y,
                    std::string* landmarks) {
  command->add_option("X", *x, "Mesh: .off, .obj, .ply or .stl")->required();
  command->add_option("Y", *y, "Mesh: .off, .obj, .ply or .stl")->required();
  command->add_option("--landmarks", *landmarks,
                      "File of known matches, lines `x y`");
}

void AddJobFlags(CLI::App* command, JobFlags* flags) {
  command->add_flag("--landmarks-exact", flags->landmarks_exact,
                    "Keep every landmark, even one that the rest contradicts");
  command
      ->add_option("--priority", flags->priority,
                   "With --server: jobs of a higher one start first")
      ->check(CLI::Range(-100, 100))
      ->capture_default_str();
  command
      ->add_option("--profile", flags->profile,
                   "default: what measured best; paper: as published")
      ->check(CLI::IsMember({"default", "paper"}))
      ->capture_default_str();
  command
      ->add_option("--random-seed", flags->random_seed,
                   "The same seed gives the same map")
      ->capture_default_str();
  command->add_option("--solved-vertices", flags->solved_vertices,
                      "Decimate larger meshes to about as many and lift the "
                      "map; 0 never does, not given: as the profile has it");
  command
      ->add_option("--memory-limit", flags->memory_limit_bytes,
                   "The job takes no more, e.g. 800MB or 2GB: it uses fewer "
                   "threads, then solves on fewer vertices, or is refused")
      ->transform(CLI::AsSizeValue(/*kb_is_1000=*/true))
      ->default_str("none");
  command
      ->add_option("--threads", flags->threads,
                   "For each job; 0: all cores, or the server's share")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
}

void AddQueueFlags(CLI::App* command, QueueFlags* flags) {
  command->add_option("--label", flags->labels,
                      "KEY=VALUE to find the job by; may be repeated");
  command->add_option("--queue-timeout", flags->queue_timeout,
                      "Fail the job when it waited so long, e.g. 10m");
  command->add_option("--run-timeout", flags->run_timeout,
                      "Fail the job when it ran so long, e.g. 90s");
}

void SetJobFlags(const JobFlags& flags, MatchRequest* request) {
  request->profile =
      flags.profile == "paper" ? v1::PROFILE_PAPER : v1::PROFILE_DEFAULT;
  request->random_seed = flags.random_seed;
  request->threads = flags.threads;
  request->solved_vertices = flags.solved_vertices;
  request->memory_limit_bytes = flags.memory_limit_bytes;
  request->priority = flags.priority;
  request->landmarks_exact = flags.landmarks_exact;
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

absl::Status ReadInputs(const std::string& path_x, const std::string& path_y,
                        const std::string& landmarks, MatchRequest* request,
                        std::vector<std::string>* warnings) {
  ISOMATCH_ASSIGN_OR_RETURN(request->mesh_x, LoadMesh(path_x, "X", warnings));
  ISOMATCH_ASSIGN_OR_RETURN(request->mesh_y, LoadMesh(path_y, "Y", warnings));
  if (landmarks.empty()) return absl::OkStatus();
  ISOMATCH_ASSIGN_OR_RETURN(
      request->landmarks,
      ReadLandmarks(landmarks, request->mesh_x.num_vertices(),
                    request->mesh_y.num_vertices()));
  return absl::OkStatus();
}

}  // namespace isomatch
