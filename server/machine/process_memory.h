#pragma once

#include <cstdint>

namespace isomatch {

/// Makes the peak start again from what is resident now. Where the system does
/// not allow it, the peak stays that of the whole life of the process.
void ResetPeakResidentBytes();

/// Returns the peak resident memory of this process since the last reset, or 0
/// when the system does not tell.
std::int64_t PeakResidentBytes();

/// Returns the resident memory of this process now, or 0.
std::int64_t ResidentBytes();

/// Gives memory that was freed back to the system, where it can.
void ReleaseFreedMemory();

}  // namespace isomatch
