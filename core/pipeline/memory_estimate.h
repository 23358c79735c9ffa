#pragma once

#include <cstdint>

#include "core/mesh/mesh_size.h"
#include "core/pipeline/match_options.h"

namespace isomatch {

/// Returns what MatchPrepared, after Prepare, may allocate beyond that: the
/// meshes' copies and a mirrored X.
std::int64_t EstimatePreparedExtraBytes(MeshSize x, MeshSize y,
                                        const MatchOptions& options);

/// Returns an upper bound in bytes on what Match allocates at any one time
/// beyond the two meshes it is given.
std::int64_t EstimateMemoryBytes(MeshSize x, MeshSize y,
                                 std::int64_t num_landmarks,
                                 const MatchOptions& options);

}  // namespace isomatch
