#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/base/vertex_index.h"
#include "core/mesh/precise_point.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/progress.h"
#include "core/pipeline/verdict.h"

namespace isomatch {

/// A known match the user gives.
using Landmark = VertexMatch;

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
  /// Mean of the confidence over the vertices that have an image; 0 when there
  /// are none. Of overlaps without those that fill gaps
  /// (CounterpartRule::Smooth).
  double mean_confidence = 0;
};

/// What Match found.
struct Correspondence {
  /// One entry for each vertex of X; kNoVertex for one without a counterpart on
  /// Y: a vertex on no face and, where only a part of X has one (kPartOfX,
  /// kOverlap), the vertices of the rest.
  VertexMap y_from_x;
  /// One entry for each vertex of Y: 1 where X has a counterpart, else 0.
  /// Between whole shapes 1 for every vertex on a face.
  std::vector<char> matched_y;
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
  /// They belong to the decimated meshes where those were matched.
  Eigen::MatrixXd functional_map;
  Eigen::VectorXd eigenvalues_x;
  Eigen::VectorXd eigenvalues_y;
  /// MatchControl::hurry came before the map was refined to the end, compared
  /// with all of its rivals, or, where the relation was to be found out, with
  /// the maps of other relations. symmetry_confidence is 0 where rivals were
  /// not compared.
  bool ended_early = false;
  /// Sparse matches the dense map was grown from.
  std::vector<VertexMatch> sparse_matches;
  /// Mean k_X k_Y over the pairs of sparse matches (Eq. 4).
  double objective = 0;
  /// What the shapes were taken for; never kAuto.
  Relation relation = Relation::kWhole;
  /// 0 to 1: how sure that is; 1 where MatchOptions say so, or where rims leave
  /// one relation; 0 where a bad map tells nothing.
  double relation_confidence = 1;
  /// X's lengths times this are in Y's unit: 1 where both have one unit.
  double scale = 1;
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

}  // namespace isomatch
