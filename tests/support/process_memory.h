#pragma once

#include <cstdint>

namespace isomatch {

/// Bytes this process holds in memory now, and the most it held since the last
/// reset (Linux; 0 elsewhere).
std::int64_t ResidentBytes();
std::int64_t PeakResidentBytes();
/// Gives freed memory back and forgets the peak.
void ResetPeakResidentBytes();

}  // namespace isomatch
