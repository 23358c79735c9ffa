#include "server/convert/job_name.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "server/jobs/errors.h"

namespace isomatch {
namespace {

constexpr char kPrefix[] = "jobs/";
constexpr size_t kMaxIdBytes = 64;

/// Those of the server are hexadecimal.
bool IsOfAnId(char c) { return absl::ascii_isalnum(c) || c == '-' || c == '_'; }

}  // namespace

std::string JobName(const std::string& id) {
  return id.empty() ? "" : absl::StrCat(kPrefix, id);
}

absl::StatusOr<std::string> ParseJobName(const std::string& name) {
  absl::string_view id = name;
  if (!absl::ConsumePrefix(&id, kPrefix) || id.empty() ||
      id.size() > kMaxIdBytes || !std::all_of(id.begin(), id.end(), IsOfAnId)) {
    return InvalidField("name", "expected jobs/ and an id, as CreateJob gave");
  }
  return std::string(id);
}

}  // namespace isomatch
