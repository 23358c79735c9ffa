#pragma once

#include <string>

namespace isomatch {

/// Returns how many threads can run at the same time, at least 1: the
/// processors that this process may use, or fewer whole ones where a cgroup (v2
/// or v1) allows less time. `root` stands before /proc and /sys, for tests.
int AvailableCores(const std::string& root = "");

}  // namespace isomatch
