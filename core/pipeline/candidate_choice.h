#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
#include "core/alignment/elastic_alignment.h"
#include "core/base/vertex_index.h"
#include "core/descriptor/nearby_match.h"
#include "core/geodesic/basis_points.h"
#include "core/pipeline/correspondence.h"
#include "core/pipeline/counterpart_rule.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/prepared_mesh.h"
#include "core/pipeline/progress.h"

namespace isomatch {

/// A whole map that may be the result, as it grows. On working vertices.
struct Candidate {
  std::vector<VertexMatch> sparse;
  VertexMap y_from_x;
  VertexMap filtered;  ///< y_from_x before the elastic alignment
  /// Not 0 for the vertices of X that have a counterpart; empty: all.
  std::vector<char> matched;
  MapScores scores;
  double objective = 0;  ///< Eq. 4
};

/// Refines dense maps by descriptors, wavelet filter and elastic alignment, and
/// chooses among them.
///
/// References and `stops` must outlive it. Not thread-safe.
class CandidateChoice {
 public:
  CandidateChoice(const PreparedMesh& x, const PreparedMesh& y,
                  const MatchOptions& options, const StopTokens& stops);

  /// Refines every candidate's dense map and lays it out by the first rounds of
  /// the elastic alignment; completes the scores and multiplies the rank value
  /// of the first stage with the squared mismatches of normals and descriptors
  /// (where surfaces are not oriented, with the squared stretch); of parts it
  /// multiplies the distortion with them. Sorts by that and returns the
  /// alignment of the best. Where both shapes are parts it also
  /// finds which vertices are matched; there the rank value is divided by their
  /// area, of which unlike places count less, and multiplied by what
  /// CounterpartRule::Misfit says.
  ///
  /// Once stops.hurry was requested, candidates that are not laid out yet are
  /// given up, the first one as far as it is; where that is not begun, which of
  /// an overlap it always is, its dense map stays and nullptr is returned.
  ///
  /// REQUIRES: at least one candidate, all dense. Errors as ElasticAlignment.
  absl::StatusOr<std::unique_ptr<ElasticAlignment>> Choose(
      const std::function<void(double)>& progress,
      std::vector<Candidate>* candidates);

  /// The rounds that Choose has left, at least one; all of them anew when
  /// `from_start`, as landmarks fixed in between need. In a hurry no more than
  /// those of a stiffness. REQUIRES: Choose, which was in none.
  absl::Status Finish(bool from_start,
                      const std::function<void(double)>& progress,
                      ElasticAlignment* alignment) const;

  /// How far from the image of each vertex of X, in sqrt(area), the vertex near
  /// it with the most alike descriptor lies; -1 where nothing is described.
  /// REQUIRES: Choose.
  absl::StatusOr<std::vector<float>> DescriptorOffsets(
      const VertexMap& y_from_x) const;

 private:
  absl::Status DescribeAlike();
  absl::Status MoveToAlike(double reach, VertexMap* y_from_x) const;
  Eigen::VectorXd DescribedMass() const;
  absl::Status Filter(VertexMap* y_from_x) const;
  /// Returns how far it came: at `end`, but in a hurry.
  absl::StatusOr<int> RunRounds(int begin, int end,
                                const std::function<void(double)>& progress,
                                ElasticAlignment* alignment) const;
  AlignmentOptions HowAligned() const;
  absl::StatusOr<std::unique_ptr<ElasticAlignment>> LayOut(
      const Candidate& candidate) const;
  /// Of overlaps: what is matched is pulled from then on.
  absl::Status Mask(int round, double stiffness,
                    ElasticAlignment* alignment) const;
  absl::Status Judge(const ElasticAlignment& alignment,
                     MapScores* scores) const;
  absl::Status JudgeOverlap(const ElasticAlignment& alignment,
                            MapScores* scores) const;
  bool hurries() const { return hurry_.stop_requested(); }
  bool is_part() const { return options_.relation != Relation::kWhole; }
  bool masks() const { return options_.relation == Relation::kOverlap; }
  bool described() const { return oriented_ && options_.descriptor_radius > 0; }

  const std::array<PointColumns, 2> functions_;
  const std::array<const SpectralBasis*, 2> spectral_;
  const AlignmentShape x_;
  const AlignmentShape y_;
  const DescribedSurface surface_x_;
  const DescribedSurface surface_y_;
  const bool oriented_;
  const MatchOptions& options_;
  const std::stop_token& stop_;
  const std::stop_token& hurry_;
  const ShotBall ball_;  ///< of the descriptors, sqrt(area)
  /// Descriptors of both shapes with ball_: the prepared ones, or own_.
  std::array<const ShapeDescriptors*, 2> descriptors_;
  const std::array<double, 2> prepared_radii_;
  std::array<ShapeDescriptors, 2> own_;
  std::optional<CounterpartRule> rule_;  ///< of parts
};

/// Leaves out those with a negative orientation score, unless all have one.
void DropMirrored(std::vector<Candidate>* candidates);

/// Leaves the first `count`. REQUIRES: there are as many.
void KeepFirst(std::size_t count, std::vector<Candidate>* candidates);

/// Of those that lead nearly all of X to about the same places on Y, whose
/// basis is given, leaves the first: what grew in two ways may end as one map,
/// which is no rival. REQUIRES: dense maps.
void DropRepeated(const BasisPoints& basis_y,
                  std::vector<Candidate>* candidates);

/// 1 - rank value of the best / of the next; 1 without a next, 0 when nothing
/// was compared. REQUIRES: sorted.
double SymmetryConfidence(const MatchOptions& options,
                          const std::vector<Candidate>& candidates);

}  // namespace isomatch
