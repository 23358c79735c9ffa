#pragma once

#include <array>
#include <functional>
#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "core/base/vertex_index.h"
#include "core/matching/seed_generator.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/prepared_mesh.h"

namespace isomatch {

/// Weight of PartStart::differences in the energy of the first stage.
inline constexpr float kUnlikenessWeight = 0.02f;

/// Points of a part's pool, but for landmarks: it has no others to compete
/// with.
inline constexpr int kPartPoolSize = 400;

/// What a map from a part to a whole, or to another part, grows from.
struct PartStart {
  /// X's lengths times this are in Y's unit, sqrt(area of Y).
  double scale = 1;
  /// X's rim is near everywhere: it cuts nearly all balls, and its
  /// eigenfunctions tell of the rim more than of the shape.
  bool is_mostly_rim = false;
  /// Vertices of the pools. Where X is mostly rim, those that are farthest from
  /// it, which seeds are made of, come first.
  std::array<std::vector<VertexIndex>, 2> pools;
  /// Between them, each P x P, in Y's unit.
  std::array<Eigen::MatrixXf, 2> distances;
  /// P_Y x P_X: how unlike the points look, PointDifferences.
  Eigen::MatrixXf differences;
  /// AlikeSeeds of them; none where no three points agree.
  std::vector<Seed> seeds;
};

/// How a search is watched and ended.
struct SearchControl {
  std::function<void(double)> progress;
  const std::stop_token& stop;
};

/// Finds where to begin, and with LengthScale::kAuto the scale: seeds have the
/// most support at the right one, and of the scales where they have much, a map
/// that grows from them is best there, or with MatchOptions::next_scale next
/// best. `x` and `y` are each of area 1. Points are compared by balls around
/// them, larger ones where X's rim cuts nearly all.
///
/// Not in the paper. Deterministic at any thread count. Errors as RunMatch, and
/// FAILED_PRECONDITION where there is no next scale.
absl::StatusOr<PartStart> FindPartStart(const PreparedMesh& x,
                                        const PreparedMesh& y,
                                        absl::Span<const Landmark> landmarks,
                                        const MatchOptions& options,
                                        const SearchControl& control);

}  // namespace isomatch
