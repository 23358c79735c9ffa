#pragma once

#include <array>
#include <stop_token>
#include <vector>

#include "absl/status/status.h"
#include "core/alignment/elastic_alignment.h"
#include "core/base/vertex_index.h"
#include "core/pipeline/matcher.h"
#include "core/pipeline/prepared_mesh.h"

namespace isomatch {

/// A map between working vertices (X's, Y's) in the user's numbering.
VertexMap ToUserMap(const std::array<WorkingMesh, 2>& working,
                    const VertexMap& y_from_x);

/// The alignment's points in the user's numbering; without an alignment
/// (nullptr) the vertices of `user_map`.
std::vector<PrecisePoint> PrecisePoints(
    const std::array<WorkingMesh, 2>& working,
    const ElasticAlignment* alignment, const VertexMap& user_map);

/// Fills result->quality and result->confidence of the map between working
/// vertices. `filtered` is what it was before the alignment, `offsets` how
/// far from the images the most alike vertices lie (ErrorSigns); unused without
/// an alignment. REQUIRES: result->y_from_x.
absl::Status ReportQuality(const std::array<WorkingMesh, 2>& working,
                           const VertexMap& y_from_x, const VertexMap& filtered,
                           const std::vector<float>& offsets,
                           const ElasticAlignment* alignment,
                           const std::stop_token& stop, Correspondence* result);

}  // namespace isomatch
