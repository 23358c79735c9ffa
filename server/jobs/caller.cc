#include "server/jobs/caller.h"

#include <array>

#include "absl/algorithm/container.h"
#include "absl/strings/ascii.h"

namespace isomatch {
namespace {

constexpr std::array<absl::string_view, 3> kRoles = {"read", "submit", "admin"};

}  // namespace

std::string RoleName(Role role) {
  return std::string(kRoles[static_cast<size_t>(role)]);
}

std::optional<Role> ParseRole(absl::string_view name) {
  const auto found = absl::c_find(kRoles, name);
  if (found == kRoles.end()) return std::nullopt;
  return static_cast<Role>(found - kRoles.begin());
}

bool IsTenantName(absl::string_view name) {
  constexpr size_t kMostCharacters = 63;
  return !name.empty() && name.size() <= kMostCharacters &&
         absl::c_all_of(name, [](char c) {
           return absl::ascii_islower(c) || absl::ascii_isdigit(c) ||
                  c == '-' || c == '_';
         });
}

}  // namespace isomatch
