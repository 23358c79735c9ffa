#pragma once

#include <optional>
#include <string>

#include "absl/strings/string_view.h"

namespace isomatch {

/// What a caller may do; each may all that those before it may.
enum class Role {
  kRead,    ///< look at jobs and results of its tenant
  kSubmit,  ///< upload meshes, create, cancel and delete jobs
  kAdmin,   ///< the same with the jobs of every tenant
};

/// The highest priority of a job; the lowest is -kMostPriority.
inline constexpr int kMostPriority = 100;

/// Who calls. Without API keys everybody is the default.
struct Caller {
  /// Whose jobs, meshes and results it sees: 1 to 63 of a-z, 0-9, - and _.
  std::string tenant = "default";
  Role role = Role::kAdmin;
  /// Names the call in the log; empty when it is not known.
  std::string call_id{};
  /// How far the priorities of its jobs count among tenants.
  int max_priority = kMostPriority;
  /// What the call is part of, as W3C Trace Context has it; empty when it is
  /// not known.
  std::string trace_parent{};
};

/// read, submit or admin; the inverse returns nullopt for anything else.
std::string RoleName(Role role);
std::optional<Role> ParseRole(absl::string_view name);

/// True for 1 to 63 of a-z, 0-9, - and _: what names of tenants and keys are.
bool IsTenantName(absl::string_view name);

}  // namespace isomatch
