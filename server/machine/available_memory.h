#pragma once

#include <cstdint>
#include <string>

namespace isomatch {

/// Returns the bytes this process may use: the smallest of the physical memory
/// and the limits of its cgroup (v2 and v1) and the cgroup's ancestors. `root`
/// stands before /proc and /sys, for tests.
std::int64_t AvailableMemoryBytes(const std::string& root = "");

/// Returns min(`wanted_bytes`, 0.8 `available_bytes`), the latter alone when
/// `wanted_bytes` is 0.
std::int64_t ChooseMemoryBudget(std::int64_t wanted_bytes,
                                std::int64_t available_bytes);

}  // namespace isomatch
