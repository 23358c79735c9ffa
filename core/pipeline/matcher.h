#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "absl/types/span.h"
#include "core/base/vertex_index.h"
#include "core/mesh/triangle_mesh.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/precise_point.h"
#include "core/pipeline/verdict.h"

namespace isomatch {

/// A known match the user gives.
using Landmark = VertexMatch;

/// The steps of Match in order; not every profile runs all of them.
enum class Stage {
  kPrepare,          ///< validation, cleaning, orientation
  kGeodesics,        ///< basis points and their distance fields (3.1)
  kSpectral,         ///< Laplace-Beltrami eigenpairs
  kSeeds,            ///< seed generator (3.5)
  kFirstInsertion,   ///< insertion and annealing (3.3.1, 3.4)
  kSecondInsertion,  ///< insertion to 70 % (3.3.2)
  kFinalSwapping,    ///< zero-temperature swaps of the worst matches (3.4)
  kDense,            ///< nearest neighbors in closeness space
  kZoomOut,          ///< spectral refinement
  kChoice,           ///< distinct maps laid out coarsely, one chosen
  kAlignment,        ///< elastic alignment of the chosen one
  kQuality,          ///< the map of all vertices, figures about it
};
inline constexpr int kNumStages = 12;

/// Lower-case words, e.g. "first insertion".
const char* StageName(Stage stage);

/// Where a running match stands. Both fractions are in [0, 1]; total_fraction
/// never falls. Each stage that runs reports 0 when it begins and 1 when it
/// has ended, before the next begins.
struct Progress {
  Stage stage;
  double stage_fraction;
  double total_fraction;
};

/// Called from one thread at a time, possibly not the caller's. Must be quick
/// and must not throw.
using ProgressCallback = std::function<void(const Progress&)>;

/// The map as it was after `stage`: kNoVertex where not matched yet.
struct StageMap {
  Stage stage;
  VertexMap y_from_x;
};

/// What speaks for and against a whole map; all but the orientation score are
/// 0 at best and have no upper bound.
struct MapScores {
  /// Mean |k_X - k_Y| over the pairs of sparse matches (Eq. 8).
  double embedding_error = 0;
  /// -1 (mirrored) to 1 (orientation kept) over the sparse matches; 0 when
  /// there are too few or the meshes have no consistent orientation.
  double orientation_score = 0;
  /// Mean difference of mean curvature over the sparse matches, 1 / sqrt(area).
  double curvature_mismatch = 0;
  /// After coarse elastic alignment; 0 without it. See AlignmentScore and
  /// DescriptorMismatch.
  double normal_mismatch = 0;
  double descriptor_mismatch = 0;
  double stretch = 0;
  /// Fraction of the landmarks that the map contradicts.
  double landmark_contradiction = 0;
  /// What maps are chosen by: smaller is better; only ratios mean something.
  double rank_value = 0;
};

/// A distinct map that was not chosen: a symmetric image, as a rule.
struct Alternative {
  VertexMap y_from_x;
  MapScores scores;
};

/// What became of one landmark.
struct LandmarkOutcome {
  /// Kept: the map sends x to y exactly. Otherwise the rest of the map
  /// contradicts it, and `y_found` is where the map sends x.
  bool kept = true;
  VertexIndex y_found = kNoVertex;
  /// Geodesic distance on Y from y to y_found, fraction of sqrt(area).
  double distance = 0;
};

/// What is known of a map's quality without a truth. Measured on the vertices
/// that were solved on (MatchOptions::solved_vertices).
struct MapQuality {
  /// Mean |d_X(a, b) - d_Y(map(a), map(b))| over sampled pairs, as a fraction
  /// of sqrt(area); 0 for an isometry.
  double geodesic_distortion = 0;
  /// Fraction of Y's area within reach of an image: nearer to one than two mean
  /// edges of the coarser mesh.
  double coverage = 0;
  /// Area-weighted mean |ln(area of a face's image / its area)|, both surfaces
  /// scaled to area 1.
  double area_distortion = 0;
  /// Vertices of X without an image.
  int unmatched = 0;
  /// Of the confidence of the vertices that have an image; 0 when there are
  /// none.
  double mean_confidence = 0;
};

/// What Match found.
struct Correspondence {
  /// One entry for each vertex of X; kNoVertex only for a vertex on no face.
  VertexMap y_from_x;
  /// The same, between the vertices of Y. With alignment_rounds 0 the vertices
  /// themselves.
  std::vector<PrecisePoint> precise;
  /// How far to trust each image, 0 to 1: expected to rank the true errors.
  /// 0 where there is none.
  std::vector<float> confidence;
  MapQuality quality;
  /// What all that comes to.
  Verdict verdict;
  MapScores scores;
  /// 0 to 1: how clearly this map is better than the distinct ones that came
  /// nearest to it; 1 when none came near.
  double symmetry_confidence = 1;
  /// Those, best first.
  std::vector<Alternative> alternatives;
  /// One entry for each landmark given.
  std::vector<LandmarkOutcome> landmarks;
  /// With MatchOptions::keep_functional_map: k x k, the first k eigenfunctions
  /// of Y (columns) carried to X (rows), and the eigenvalues of both, 1 / area.
  /// Of the decimated meshes where those were matched.
  Eigen::MatrixXd functional_map;
  Eigen::VectorXd eigenvalues_x;
  Eigen::VectorXd eigenvalues_y;
  /// Sparse matches the dense map was grown from.
  std::vector<VertexMatch> sparse_matches;
  /// Mean k_X k_Y over the pairs of sparse matches (Eq. 4).
  double objective = 0;
  /// Surface areas, squared mesh units.
  double area_x = 0;
  double area_y = 0;
  /// What was found and mended in each mesh, and what else the user should
  /// know.
  std::vector<std::string> warnings_x;
  std::vector<std::string> warnings_y;
  std::vector<std::string> warnings;
  /// With MatchOptions::keep_stage_maps.
  std::vector<StageMap> stage_maps;
};

/// Finds the dense correspondence from X to Y: for every vertex of X its place
/// on Y (Holzschuh, Laehner, Cremers: Simulated Annealing for 3D Shape
/// Correspondence, 3DV 2020). The one entry point of the service, the command
/// line and the tests.
///
/// The meshes may have different vertex counts. `landmarks`, when given, take
/// the place of generated seeds. The result depends on meshes, landmarks,
/// options and options.random_seed only, not on the number of threads.
///
/// INVALID_ARGUMENT: a mesh, landmark or option is wrong; the message names
/// field, value and what was expected. CANCELLED: `stop` was requested; the
/// call returns within a quarter of a second, but for meshes of a million
/// vertices, which are cleaned in few steps, and the sparse factorization of
/// large ones without decimation, which is not interrupted. RESOURCE_EXHAUSTED:
/// a mesh cannot be decimated and needs more than options.memory_limit_bytes.
/// INTERNAL: a numerical step failed.
///
/// Time and memory O(n) beyond MatchOptions::solved_vertices. Without that time
/// O(n log n sqrt(n)) up to the nearest neighbors, memory O(n sqrt(n)).
/// EstimateMemoryBytes bounds the memory.
absl::StatusOr<Correspondence> Match(const TriangleMesh& mesh_x,
                                     const TriangleMesh& mesh_y,
                                     absl::Span<const Landmark> landmarks,
                                     const MatchOptions& options,
                                     const ProgressCallback& progress = {},
                                     std::stop_token stop = {});

/// A mesh and what matching needs to know of it alone: cleaned, decimated,
/// distance fields, eigenpairs, curvature, descriptors. Whoever matches one
/// mesh with many prepares it once. Cheap to copy; thread-safe.
class PreparedShape {
 public:
  struct Contents;
  explicit PreparedShape(std::shared_ptr<const Contents> contents)
      : contents_(std::move(contents)) {}
  const Contents& contents() const { return *contents_; }

 private:
  std::shared_ptr<const Contents> contents_;
};

/// Prepares a mesh for Match with these options. Errors as Match; `mesh` is
/// named "mesh". Reports the first three stages. Of two meshes no limit can be
/// planned for one alone: with options.memory_limit_bytes, prepare with the
/// options of PlanWithinMemory.
absl::StatusOr<PreparedShape> Prepare(TriangleMesh mesh,
                                      const MatchOptions& options,
                                      const ProgressCallback& progress = {},
                                      std::stop_token stop = {});

/// The two shapes of a pair.
struct PreparedPair {
  PreparedShape x;
  PreparedShape y;
};

/// Prepare of both meshes, both at the same time where threads allow. Errors as
/// Match.
absl::StatusOr<PreparedPair> PrepareBoth(TriangleMesh mesh_x,
                                         TriangleMesh mesh_y,
                                         const MatchOptions& options,
                                         const ProgressCallback& progress = {},
                                         std::stop_token stop = {});

/// Returns a short text, equal for options for which shapes are prepared alike,
/// to the last digit.
std::string PreparationText(const MatchOptions& options);

/// Returns an upper bound on the bytes the shape holds, its mesh included.
std::int64_t PreparedShapeBytes(const PreparedShape& shape);

/// Match, of prepared shapes: the same result as of their meshes.
/// INVALID_ARGUMENT also when one was prepared for other options; the message
/// names the option. Meshes of several large components, which are matched one
/// by one, are prepared anew.
absl::StatusOr<Correspondence> MatchPrepared(
    const PreparedShape& x, const PreparedShape& y,
    absl::Span<const Landmark> landmarks, const MatchOptions& options,
    const ProgressCallback& progress = {}, std::stop_token stop = {});

/// A prepared shape as bytes, for ParsePreparedShape of the same version of
/// Isomatch: about 2.7 kB for each solved vertex and 48 bytes for each other.
std::string SerializePreparedShape(const PreparedShape& shape);

/// Reads what SerializePreparedShape wrote; cleaning and decimation are done
/// again. DATA_LOSS: cut off, changed, or of another version. CANCELLED after
/// `stop`.
absl::StatusOr<PreparedShape> ParsePreparedShape(absl::string_view bytes,
                                                 std::stop_token stop = {});

/// Checks landmarks as Match does: every index in range, no vertex of X or Y in
/// two of them. The message names `landmarks[i]`.
absl::Status ValidateLandmarks(absl::Span<const Landmark> landmarks,
                               std::int64_t vertices_x,
                               std::int64_t vertices_y);

/// Vertices and faces of a mesh.
struct MeshSize {
  std::int64_t vertices = 0;
  std::int64_t faces = 0;
};

inline MeshSize SizeOf(const TriangleMesh& mesh) {
  return {mesh.num_vertices(), mesh.num_faces()};
}

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
