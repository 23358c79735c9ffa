#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace isomatch {

/// The instruction sets that the core was compiled for and this processor has,
/// best first: "x86-64-v3" (AVX2 and FMA; a name of the x86-64 psABI) and
/// "baseline". Never empty; one alone in builds for it (ISOMATCH_MARCH).
std::vector<std::string> InstructionSets();

/// The one that Match and the others of pipeline/matcher.h run on: the best,
/// unless told otherwise.
std::string InstructionSet();

/// Lets them run on another, from the next call on. INVALID_ARGUMENT: it is
/// none of InstructionSets(). Thread-safe; for tests and benchmarks, since
/// prepared shapes and maps of different instruction sets differ in last
/// digits.
absl::Status UseInstructionSet(absl::string_view name);

}  // namespace isomatch
