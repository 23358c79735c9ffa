#include "server/rpc/security/call_metadata.h"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"

namespace isomatch {
namespace {

constexpr std::size_t kMaxRequestIdBytes = 128;

bool IsRequestId(const std::string& text) {
  return !text.empty() && text.size() <= kMaxRequestIdBytes &&
         std::all_of(text.begin(), text.end(), [](char c) {
           return absl::ascii_isalnum(c) || c == '.' || c == '_' || c == '-';
         });
}

bool IsHex(absl::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) {
    return absl::ascii_isxdigit(c) && !absl::ascii_isupper(c);
  });
}

bool IsTraceParent(const std::string& text) {
  const std::vector<absl::string_view> fields = absl::StrSplit(text, '-');
  if (fields.size() != 4 || fields[0] != "00") return false;
  constexpr std::size_t kDigits[] = {2, 32, 16, 2};
  for (std::size_t i = 0; i < fields.size(); ++i) {
    if (fields[i].size() != kDigits[i] || !IsHex(fields[i])) return false;
  }
  const auto is_zero = [](absl::string_view id) {
    return id.find_first_not_of('0') == id.npos;
  };
  return !is_zero(fields[1]) && !is_zero(fields[2]);
}

/// Returns the first value of `key` that is as it should be, or "".
std::string FindMetadata(const CallMetadata& metadata, const char* key,
                         bool (*is_valid)(const std::string&)) {
  const auto [begin, end] = metadata.equal_range(key);
  for (auto entry = begin; entry != end; ++entry) {
    std::string value(entry->second.data(), entry->second.size());
    if (is_valid(value)) return value;
  }
  return "";
}

}  // namespace

std::string CallIdOf(const CallMetadata& metadata) {
  return FindMetadata(metadata, kRequestIdKey, IsRequestId);
}

std::string TraceParentOf(const CallMetadata& metadata) {
  return FindMetadata(metadata, "traceparent", IsTraceParent);
}

}  // namespace isomatch
