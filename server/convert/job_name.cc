#include "server/convert/job_name.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "server/jobs/errors.h"

namespace isomatch {
namespace {

constexpr char kPrefix[] = "jobs/";
constexpr size_t kMaxIdBytes = 64;

}  // namespace

std::string JobName(const std::string& id) {
  return id.empty() ? "" : absl::StrCat(kPrefix, id);
}

absl::StatusOr<std::string> ParseJobName(const std::string& name) {
  absl::string_view id = name;
  if (!absl::ConsumePrefix(&id, kPrefix) || id.empty() ||
      id.size() > kMaxIdBytes) {
    return InvalidField("name", "expected jobs/ and an id, as CreateJob gave");
  }
  return std::string(id);
}

}  // namespace isomatch
