#pragma once

#include <cstdint>
#include <string>

namespace isomatch {

/// Returns the bytes this process may use: the smallest of the physical memory
/// and the limits of its cgroup (v2 and v1) and the cgroup's ancestors. `root`
/// stands before /proc and /sys, for tests.
std::int64_t AvailableMemoryBytes(const std::string& root = "");

}  // namespace isomatch
