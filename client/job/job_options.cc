#include "client/job/job_options.h"

#include <cmath>
#include <regex>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"

namespace isomatch {
namespace {

// "27.3 MB", not less than the bytes.
std::string Megabytes(const std::string& bytes) {
  double number = 0;
  if (!absl::SimpleAtod(bytes, &number)) return bytes;
  return absl::StrCat(std::ceil(number / 1e5) / 10, " MB");
}

}  // namespace

void SetJobOptions(const JobOptions& options, MatchRequest* request) {
  request->profile =
      options.profile == "paper" ? v1::PROFILE_PAPER : v1::PROFILE_DEFAULT;
  if (options.relation == "part-of-y") {
    request->relation = v1::RELATION_PART_OF_Y;
  }
  if (options.scale == "same") request->scale = v1::LENGTH_SCALE_SAME;
  request->random_seed = options.random_seed;
  request->threads = options.threads;
  request->solved_vertices = options.solved_vertices;
  request->memory_limit_bytes = options.memory_limit_bytes;
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
                           {"options.profile", "--profile"}}));
}

}  // namespace isomatch
