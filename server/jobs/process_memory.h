#pragma once

#include <cstdint>

namespace isomatch {

/// Makes the peak start again from what is resident now. Where the system does
/// not allow it, the peak stays that of the whole life of the process.
void ResetPeakResidentBytes();

/// Returns the peak resident memory of this process since the last reset, or 0
/// when the system does not tell.
std::int64_t PeakResidentBytes();

}  // namespace isomatch
