#pragma once

#include <array>
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
#include "core/mesh/face_lanes.h"
#include "core/pipeline/candidates.h"
#include "core/pipeline/counterpart_rule.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/prepared_mesh.h"
#include "core/pipeline/progress.h"

namespace isomatch {

/// Refines dense maps by descriptors, wavelet filter and elastic alignment, and
/// chooses among them.
///
/// References and `stops` must outlive it. Not thread-safe.
class CandidateChoice {
 public:
  /// `is_mostly_rim`: PartStart::is_mostly_rim.
  CandidateChoice(const PreparedMesh& x, const PreparedMesh& y,
                  const MatchOptions& options, const StopTokens& stops,
                  bool is_mostly_rim = false);

  /// Refines every candidate's dense map and lays it out by the first rounds of
  /// the elastic alignment; completes the scores, sorts by the rank value,
  /// MisfitOf, and returns the alignment of the best. A map that is far behind
  /// after two rounds, and no image of the leading one by a symmetry, is given
  /// up: its scores are those of then, its rank value a bound. Where both
  /// shapes are parts none is given up, and it is found which vertices are
  /// matched: the rank value of the first stage is multiplied by what
  /// CounterpartRule::Misfit says and by the root of the stretch.
  ///
  /// Once stops.hurry was requested, no other candidate is begun, and one alone
  /// is left, since they had unlike rounds: the best of those that were begun,
  /// or one that was not and looks more alike, which stays as it is, a dense
  /// map, and nullptr is returned. An overlap's is always begun, and only those
  /// that had all rounds compare.
  ///
  /// REQUIRES: at least one candidate, all dense. Errors as ElasticAlignment.
  absl::StatusOr<std::unique_ptr<ElasticAlignment>> Choose(
      const std::function<void(double)>& progress,
      std::vector<Candidate>* candidates);

  /// The rounds that Choose has left, at least one; all of them anew when
  /// `from_start`, as landmarks fixed in between need. Returns how far it came:
  /// to the last round, but in a hurry. REQUIRES: Choose.
  absl::StatusOr<int> Finish(bool from_start,
                             const std::function<void(double)>& progress,
                             ElasticAlignment* alignment) const;

  /// How far from the image of each vertex of X, in sqrt(area), the vertex near
  /// it with the most alike descriptor lies; -1 where nothing is described.
  /// REQUIRES: Choose.
  absl::StatusOr<std::vector<float>> DescriptorOffsets(
      const VertexMap& y_from_x);

  /// Of overlaps, else nullptr.
  const CounterpartRule* rule() const { return rule_ ? &*rule_ : nullptr; }

 private:
  absl::Status DescribeAlike();
  absl::Status Compare();
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
  /// Takes the map over and completes its scores.
  absl::Status Judge(const ElasticAlignment& alignment,
                     Candidate* candidate) const;
  std::optional<double> Difference(VertexIndex x, VertexIndex y) const;
  /// Of the vertices that are matched; empty: of all.
  double LookedUpMismatch(const VertexMap& y_from_x,
                          const std::vector<char>& matched) const;
  FirstSigns SignsOf(const ElasticAlignment& alignment,
                     const Candidate& candidate) const;
  /// The best map yet.
  struct Lead {
    Candidate* candidate = nullptr;
    std::unique_ptr<ElasticAlignment> alignment;
  };

  std::size_t Likeliest(const std::vector<Candidate>& candidates) const;
  absl::StatusOr<std::unique_ptr<ElasticAlignment>> Begin(
      Candidate* candidate) const;
  absl::StatusOr<std::unique_ptr<ElasticAlignment>> BeginAt(
      std::size_t next, std::vector<Candidate>* candidates) const;
  absl::StatusOr<bool> Follow(const std::function<void(double)>& progress,
                              Candidate* candidate,
                              std::unique_ptr<ElasticAlignment> alignment,
                              Lead* lead) const;
  void JudgeLost(Candidate* candidate) const;
  bool IsLost(const Candidate& candidate, const Candidate& leading) const;
  absl::Status JudgeOverlap(const ElasticAlignment& alignment,
                            MapScores* scores) const;
  bool hurries() const { return hurry_.stop_requested(); }
  bool is_part() const { return options_.relation != Relation::kWhole; }
  bool masks() const { return options_.relation == Relation::kOverlap; }
  bool bends_y() const { return is_part() && !masks(); }
  bool described() const { return oriented_ && options_.descriptor_radius > 0; }

  const std::array<PointColumns, 2> functions_;
  const std::array<const SpectralBasis*, 2> spectral_;
  const BasisPoints& basis_y_;
  std::vector<FaceLanes> faces_y_;  ///< unless Y bends, once needed
  const AlignmentShape x_;
  const AlignmentShape y_;
  const DescribedSurface surface_x_;
  const DescribedSurface surface_y_;
  const bool oriented_;
  const bool is_mostly_rim_;
  const MatchOptions& options_;
  const std::stop_token& stop_;
  const std::stop_token& hurry_;
  const ShotBall ball_;  ///< of the descriptors, sqrt(area)
  /// Descriptors of both shapes with ball_: the prepared ones, or own_.
  std::array<const ShapeDescriptors*, 2> descriptors_;
  const std::array<double, 2> prepared_radii_;
  std::array<ShapeDescriptors, 2> own_;
  std::optional<DescribedPair> compared_;  ///< descriptors_, once needed
  std::optional<CounterpartRule> rule_;    ///< of overlaps
};

}  // namespace isomatch
