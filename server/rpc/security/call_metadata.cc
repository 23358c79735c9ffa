#include "server/rpc/security/call_metadata.h"

#include <algorithm>
#include <cstddef>

#include "absl/strings/ascii.h"

namespace isomatch {
namespace {

constexpr std::size_t kMaxRequestIdBytes = 128;

bool IsRequestId(const std::string& text) {
  return !text.empty() && text.size() <= kMaxRequestIdBytes &&
         std::all_of(text.begin(), text.end(), [](char c) {
           return absl::ascii_isalnum(c) || c == '.' || c == '_' || c == '-';
         });
}

}  // namespace

std::string FindMetadata(const CallMetadata& metadata, const char* key,
                         bool (*is_valid)(const std::string&)) {
  const auto [begin, end] = metadata.equal_range(key);
  for (auto entry = begin; entry != end; ++entry) {
    std::string value(entry->second.data(), entry->second.size());
    if (is_valid(value)) return value;
  }
  return "";
}

std::string CallIdOf(const CallMetadata& metadata) {
  return FindMetadata(metadata, kRequestIdKey, IsRequestId);
}

}  // namespace isomatch
