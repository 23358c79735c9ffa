#include "client/job/job_options.h"

#include <cmath>
#include <regex>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/pipeline/match_options.h"

namespace isomatch {
namespace {

// "27.3 MB", not less than the bytes.
std::string Megabytes(const std::string& bytes) {
  double number = 0;
  if (!absl::SimpleAtod(bytes, &number)) return bytes;
  return absl::StrCat(std::ceil(number / 1e5) / 10, " MB");
}

// The enums of the proto count as those of core do, but for the first.
static_assert(static_cast<int>(Relation::kWhole) == v1::RELATION_WHOLE);
static_assert(static_cast<int>(kRelations.back()) == v1::Relation_MAX);
static_assert(static_cast<int>(LengthScale::kAuto) + 1 ==
              v1::LENGTH_SCALE_AUTO);
static_assert(static_cast<int>(kLengthScales.back()) + 1 ==
              v1::LengthScale_MAX);

v1::Relation ToProto(Relation relation) {
  return static_cast<v1::Relation>(relation);
}

v1::LengthScale ToProto(LengthScale scale) {
  return static_cast<v1::LengthScale>(static_cast<int>(scale) + 1);
}

}  // namespace

void SetJobOptions(const JobOptions& options, MatchRequest* request) {
  request->profile =
      options.profile == "paper" ? v1::PROFILE_PAPER : v1::PROFILE_DEFAULT;
  request->relation = ToProto(RelationOf(options.relation).value());
  request->scale = ToProto(LengthScaleOf(options.scale).value());
  request->random_seed = options.random_seed;
  request->threads = options.threads;
  request->solved_vertices = options.solved_vertices;
  request->memory_limit_bytes = options.memory_limit_bytes;
  request->deadline = options.deadline;
  request->priority = options.priority;
  request->landmarks_exact = options.landmarks_exact;
}

absl::Status InFlagWords(const absl::Status& status) {
  if (status.ok()) return status;
  std::string text(status.message());
  static const std::regex kLimit(
      "options\\.memory_limit_bytes: ([0-9]+), expected at least ([0-9]+)");
  std::smatch match;
  if (std::regex_search(text, match, kLimit)) {
    text = absl::StrCat(match.prefix().str(),
                        "--memory-limit: ", Megabytes(match[1].str()),
                        ", expected at least ", Megabytes(match[2].str()),
                        match.suffix().str());
  }
  return absl::Status(
      status.code(),
      absl::StrReplaceAll(text,
                          {{"options.memory_limit_bytes", "--memory-limit"},
                           {"options.solved_vertices", "--solved-vertices"},
                           {"options.random_seed", "--random-seed"},
                           {"options.threads", "--threads"},
                           {"options.relation", "--relation"},
                           {"options.scale", "--scale"},
                           {"options.profile", "--profile"},
                           {"deadline: ", "--deadline: "}}));
}

}  // namespace isomatch
