#include "core/pipeline/match_run.h"

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <unordered_map>
#include <utility>

#include "core/alignment/elastic_alignment.h"
#include "core/base/parallel.h"
#include "core/base/random_stream.h"
#include "core/base/status_macros.h"
#include "core/matching/dense_map.h"
#include "core/matching/final_swapping.h"
#include "core/matching/first_stage.h"
#include "core/matching/objective.h"
#include "core/matching/overlap_growth.h"
#include "core/matching/second_stage.h"
#include "core/pipeline/candidate_choice.h"
#include "core/pipeline/conclusion.h"
#include "core/pipeline/landmarks.h"
#include "core/pipeline/prepared_mesh.h"
#include "core/pipeline/progress_reporter.h"
#include "core/pipeline/stage_plan.h"
#include "core/pipeline/user_numbering.h"
#include "core/spectral/zoomout.h"

namespace isomatch {
namespace {

/// Index of the second stage's random stream, apart from the seeds'.
constexpr std::uint64_t kSecondStageStream = std::uint64_t{1} << 40;

/// Below this, rank values are rounding.
constexpr double kRounding = 1e-8;
/// Seeds of a part that grow as those of overlaps do.
constexpr std::size_t kGrownSeeds = 80;
/// A landmark is kept when the map sends it no further than this from where it
/// should go, in sqrt(area).
constexpr float kLandmarkTolerance = 0.1f;

/// One run of the method: the stages in order, each reading what those before
/// it left in the members.
class MatchRun {
 public:
  MatchRun(const MatchInputs& inputs, ProgressReporter* progress,
           const StopTokens& stops)
      : user_landmarks_(inputs.landmarks),
        options_(inputs.options),
        progress_(*progress),
        stops_(stops),
        stop_(stops.stop),
        part_(inputs.part),
        own_x_(inputs.own_x),
        shapes_{&inputs.x, &inputs.y} {}

  absl::StatusOr<Correspondence> Run() {
    ISOMATCH_ASSIGN_OR_RETURN(
        landmarks_, TakeLandmarks(user_landmarks_, shape(kX), shape(kY),
                                  &result_.warnings));
    const auto followers = std::stable_partition(
        landmarks_.begin(), landmarks_.end(),
        [](const WorkingLandmark& landmark) { return !landmark.follows; });
    followers_.assign(followers, landmarks_.end());
    landmarks_.erase(followers, landmarks_.end());
    ISOMATCH_RETURN_IF_ERROR(Pools());
    ISOMATCH_RETURN_IF_ERROR(FirstInsertion());
    ISOMATCH_RETURN_IF_ERROR(SecondInsertion());
    ISOMATCH_RETURN_IF_ERROR(Dense());
    ISOMATCH_RETURN_IF_ERROR(Refine());
    ISOMATCH_RETURN_IF_ERROR(Choose());
    ISOMATCH_RETURN_IF_ERROR(Align());
    ISOMATCH_RETURN_IF_ERROR(Finish());
    return std::move(result_);
  }

 private:
  /// Calls f(side) for both sides, at the same time where threads allow.
  template <typename Function>
  absl::Status Both(const Function& f) {
    return RunBoth([&] { return f(kX); }, [&] { return f(kY); });
  }

  absl::Status Pools() {
    if (part_ == nullptr) progress_.Begin(Stage::kSeeds);
    return Both([&](Side side) -> absl::Status {
      closeness_[side].emplace(shape(side).hash.basis, options_.kernel_width);
      ISOMATCH_ASSIGN_OR_RETURN(
          pools_[side],
          PointPool::Create(*closeness_[side], PoolVerticesOf(side), stop_));
      // Matches move their images on Y only.
      ISOMATCH_RETURN_IF_ERROR(side == kY ? pools_[side].ListNearest(stop_)
                                          : absl::OkStatus());
      if (options_.candidates_from_environments) {
        search_[side] = CandidateSearch(shape(side).hash.basis, pools_[side]);
      }
      frames_[side] =
          GatherFrames(solved(side).mesh.positions, solved(side).normals,
                       shape(side).curvature, pools_[side]);
      return absl::OkStatus();
    });
  }

  std::vector<VertexIndex> PoolVerticesOf(Side side) const {
    if (part_ != nullptr) return part_->pools[side];
    return PoolVertices(shape(side).hash, options_.pool_size,
                        VerticesOf(landmarks_, side));
  }

  /// The landmarks that the first stage relies on, as points of the pools.
  Seed TrustedLandmarks() const {
    std::vector<VertexMatch> trusted;
    if (options_.landmarks_exact) {
      for (const WorkingLandmark& landmark : landmarks_) {
        trusted.push_back(landmark.match);
      }
    } else {
      trusted = AgreeingLandmarks(landmarks_, shape(kX).hash.basis,
                                  shape(kY).hash.basis);
    }
    std::array<std::unordered_map<VertexIndex, int>, 2> points;
    for (const Side side : {kX, kY}) {
      for (int p = 0; p < pools_[side].size(); ++p) {
        points[side][pools_[side].vertex(p)] = p;
      }
    }
    Seed seed;
    for (const VertexMatch& match : trusted) {
      seed.push_back({points[kX].at(match.x), points[kY].at(match.y)});
    }
    return seed;
  }

  std::vector<Seed> OwnSeeds() const {
    if (part_ != nullptr && !part_->seeds.empty()) return part_->seeds;
    return GenerateSeeds(
        pools_[kX], pools_[kY],
        {options_.seed_points, options_.seed_matches, options_.max_seeds});
  }

  bool oriented() const { return solved(kX).oriented && solved(kY).oriented; }

  absl::Status FirstInsertion() {
    const Seed trusted = TrustedLandmarks();
    const std::vector<Seed> seeds =
        SeedsWithLandmarks(trusted, OwnSeeds(), options_.landmarks_exact);
    if (options_.relation == Relation::kOverlap) {
      return GrowOverlap(seeds, trusted);
    }
    std::optional<PointCosts> costs;
    if (part_ != nullptr) {
      costs.emplace(PointCosts{part_->differences, kUnlikenessWeight});
    }
    progress_.Begin(Stage::kFirstInsertion);
    FirstStageOptions first = FirstStageOptionsOf(options_, trusted.size());
    if (!oriented()) first.orientation_from = 0;
    first.regrow_mirrored = options_.regrow_mirrored && oriented();
    first.landmarks = trusted;
    if (options_.landmarks_exact) {
      first.pinned = static_cast<int>(trusted.size());
    }
    ISOMATCH_ASSIGN_OR_RETURN(
        const std::vector<RankedMap> maps,
        RunFirstStage({pools_[kX], pools_[kY], search_[kX], search_[kY],
                       frames_[kX], frames_[kY], costs ? &*costs : nullptr},
                      seeds, first, progress_.Share(0, 1), stop_));
    for (const RankedMap& map : maps) {
      // What ranks far behind, or lies on the wrong side although the best does
      // not, has lost already.
      if (map.badness > options_.candidate_margin * maps.front().badness &&
          map.badness > kRounding) {
        continue;
      }
      if (map.wrong_side && !maps.front().wrong_side) continue;
      candidates_.push_back(MakeCandidate(map));
    }
    if (part_ != nullptr) {
      ISOMATCH_RETURN_IF_ERROR(AddGrownParts(seeds, trusted));
    }
    EndFirstInsertion();
    return absl::OkStatus();
  }

  /// Part of the landmarks that a match sends elsewhere or leaves out.
  double ContradictedBy(const GrownOverlap& grown, const Seed& trusted) const {
    if (trusted.empty()) return 0;
    int kept = 0;
    for (const PointMatch& landmark : trusted) {
      for (const PointMatch& match : grown.matches) {
        kept += match.x == landmark.x &&
                part_->distances[kY](match.y, landmark.y) < kLandmarkTolerance;
      }
    }
    return 1 - double(kept) / static_cast<double>(trusted.size());
  }

  /// Distinct maps of points, grown where both shapes have them.
  absl::StatusOr<std::vector<GrownOverlap>> Grow(const std::vector<Seed>& seeds,
                                                 const Seed& trusted) {
    OverlapGrowthOptions growth;
    growth.oriented = oriented();
    growth.pinned =
        options_.landmarks_exact ? static_cast<int>(trusted.size()) : 0;
    growth.distinct_early = options_.relation != Relation::kOverlap;
    growth.max_results = options_.candidates;
    return GrowOverlaps({part_->differences,
                         {part_->distances[kX], frames_[kX]},
                         {part_->distances[kY], frames_[kY]}},
                        seeds, growth, stop_);
  }

  RankedMap RankedMapOf(const GrownOverlap& grown, const Seed& trusted) const {
    RankedMap map = {Matching(pools_[kX], pools_[kY],
                              static_cast<int>(grown.matches.size()))};
    for (const PointMatch& match : grown.matches) map.matching.Add(match);
    map.contradiction = ContradictedBy(grown, trusted);
    return map;
  }

  /// Maps of a part that points were left out of, where they found no place:
  /// they bear more that is missing than those that hold all points.
  absl::Status AddGrownParts(const std::vector<Seed>& seeds,
                             const Seed& trusted) {
    const std::vector<Seed> best(
        seeds.begin(), seeds.begin() + std::min(seeds.size(), kGrownSeeds));
    ISOMATCH_ASSIGN_OR_RETURN(const std::vector<GrownOverlap> grown,
                              Grow(best, trusted));
    for (const GrownOverlap& one : grown) {
      candidates_.push_back(MakeCandidate(RankedMapOf(one, trusted)));
    }
    if (trusted.empty()) DropMirrored(&candidates_);
    return absl::OkStatus();
  }

  absl::Status GrowOverlap(const std::vector<Seed>& seeds,
                           const Seed& trusted) {
    progress_.Begin(Stage::kFirstInsertion);
    ISOMATCH_ASSIGN_OR_RETURN(const std::vector<GrownOverlap> grown,
                              Grow(seeds, trusted));
    if (grown.empty()) {
      return absl::FailedPreconditionError(
          "no overlap of mesh_x and mesh_y was found; if they have one, give "
          "known matches in it as landmarks");
    }
    for (const GrownOverlap& one : grown) {
      RankedMap map = RankedMapOf(one, trusted);
      map.badness = LandmarkPenalty(map.contradiction) / one.score;
      candidates_.push_back(MakeCandidate(map));
    }
    EndFirstInsertion();
    return absl::OkStatus();
  }

  void EndFirstInsertion() {
    Keep(Stage::kFirstInsertion);
    // The tables are used up; what follows needs the memory.
    for (const Side side : {kX, kY}) pools_[side] = PointPool();
  }

  Candidate MakeCandidate(const RankedMap& map) const {
    Candidate candidate;
    for (const PointMatch& match : map.matching.Matches()) {
      candidate.sparse.push_back(
          {pools_[kX].vertex(match.x), pools_[kY].vertex(match.y)});
    }
    candidate.y_from_x.assign(solved(kX).mesh.num_vertices(), kNoVertex);
    for (const VertexMatch& match : candidate.sparse) {
      candidate.y_from_x[match.x] = match.y;
    }
    MapScores& scores = candidate.scores;
    scores.embedding_error = EmbeddingError(map.matching);
    scores.curvature_mismatch =
        CurvatureMismatch(map.matching, frames_[kX], frames_[kY]);
    if (oriented()) {
      scores.orientation_score =
          OrientationScore(map.matching, frames_[kX], frames_[kY]);
    }
    scores.landmark_contradiction = map.contradiction;
    scores.rank_value = map.badness;
    candidate.objective = Objective(map.matching);
    return candidate;
  }

  absl::Status SecondInsertion() {
    if (options_.second_stage_fraction == 0) return absl::OkStatus();
    progress_.Begin(Stage::kSecondInsertion);
    const std::array<Environments, 2> environments = {
        AllEnvironments(shape(kX).hash.basis),
        AllEnvironments(shape(kY).hash.basis)};
    const HashedPair shapes = {{*closeness_[kX], environments[kX]},
                               {*closeness_[kY], environments[kY]}};
    PartialVertexMap map(solved(kX).mesh.num_vertices(),
                         solved(kY).mesh.num_vertices());
    for (const VertexMatch& match : best().sparse) map.Set(match.x, match.y);
    SecondStageOptions second;
    second.fraction = options_.second_stage_fraction;
    RandomStream random(options_.random_seed, kSecondStageStream);
    ISOMATCH_RETURN_IF_ERROR(RunSecondStage(
        shapes, second, &random, {progress_.Share(0, 1), stop_}, &map));
    best().y_from_x = map.y_from_x;
    Keep(Stage::kSecondInsertion);
    progress_.Begin(Stage::kFinalSwapping);
    if (options_.swapping != Swapping::kNone) {
      ISOMATCH_RETURN_IF_ERROR(SwapWorst(shapes, options_.final_swap_fraction,
                                         {progress_.Share(0, 1), stop_}, &map));
    }
    best().y_from_x = map.y_from_x;
    Keep(Stage::kFinalSwapping);
    return absl::OkStatus();
  }

  DenseMapSurface DenseSurface(Side side) const {
    return {*closeness_[side], solved(side).stars, shape(side).laplacian.mass};
  }

  absl::Status Dense() {
    if (!options_.dense_from_closeness) return absl::OkStatus();
    progress_.Begin(Stage::kDense);
    for (Candidate& candidate : candidates_) {
      ISOMATCH_ASSIGN_OR_RETURN(
          candidate.y_from_x,
          DenseMapFromMatches(DenseSurface(kX), DenseSurface(kY),
                              candidate.sparse, stop_));
      // Of an overlap it is not known yet what is matched.
      if (options_.relation != Relation::kOverlap) progress_.FoundMap();
    }
    Keep(Stage::kDense);
    return absl::OkStatus();
  }

  absl::Status Refine() {
    if (options_.zoomout_end == 0) return absl::OkStatus();
    progress_.Begin(Stage::kZoomOut);
    ISOMATCH_ASSIGN_OR_RETURN(
        best().y_from_x, ZoomOut({shape(kX).spectral, solved(kX).stars},
                                 {shape(kY).spectral, solved(kY).stars},
                                 std::move(best().y_from_x),
                                 {options_.zoomout_start, options_.zoomout_end,
                                  options_.zoomout_step},
                                 {progress_.Share(0, 1), stop_}));
    Keep(Stage::kZoomOut);
    return absl::OkStatus();
  }

  absl::Status Choose() {
    if (options_.alignment_rounds == 0) return absl::OkStatus();
    progress_.Begin(Stage::kChoice);
    // A mirrored map, as landmarks may want it, is an elastic motion of the
    // mirror image only.
    if (oriented() && best().scores.orientation_score < 0) {
      if (own_x_ == nullptr) own_x_ = &reflected_.emplace(shape(kX));
      Reflect(own_x_);
      ISOMATCH_RETURN_IF_ERROR(Describe(options_, stop_, own_x_));
      shapes_[kX] = own_x_;
    }
    choice_.emplace(shape(kX), shape(kY), options_, stops_,
                    part_ != nullptr && part_->is_mostly_rim);
    const std::size_t found = candidates_.size();
    ISOMATCH_ASSIGN_OR_RETURN(
        alignment_, choice_->Choose(progress_.Share(0, 1), &candidates_));
    has_unknown_rivals_ = has_unknown_rivals_ || candidates_.size() < found;
    progress_.FoundMap();
    if (part_ != nullptr && options_.relation != Relation::kOverlap) {
      DropRepeated(shape(kY).hash.basis, &candidates_);
    }
    Keep(Stage::kChoice);
    return absl::OkStatus();
  }

  /// Decides which landmarks the map respects, and sets those.
  void SettleLandmarks() {
    result_.landmarks.assign(user_landmarks_.size(), {});
    std::vector<char> used(user_landmarks_.size(), false);
    const auto settle = [&](const WorkingLandmark& landmark) {
      const auto& [match, index, follows] = landmark;
      LandmarkOutcome& outcome = result_.landmarks[index];
      const VertexIndex found = best().y_from_x[match.x];
      const float distance =
          found == kNoVertex
              ? 0
              : std::min(shape(kY).hash.basis.LowerBound(found, match.y),
                         kUnreachable);
      outcome.kept = options_.landmarks_exact || distance <= kLandmarkTolerance;
      outcome.distance = outcome.kept ? 0 : distance;
      if (outcome.kept && !follows) best().y_from_x[match.x] = match.y;
      used[index] = true;
    };
    // Those that follow are judged by the map before the others change it.
    for (const WorkingLandmark& landmark : followers_) settle(landmark);
    for (const WorkingLandmark& landmark : landmarks_) settle(landmark);
    for (std::size_t i = 0; i < used.size(); ++i) {
      if (!used[i]) result_.landmarks[i].kept = false;
    }
  }

  absl::Status Align() {
    SettleLandmarks();
    if (options_.alignment_rounds == 0) return absl::OkStatus();
    progress_.Begin(Stage::kAlignment);
    result_.ended_early = hurries();
    if (alignment_ == nullptr) return absl::OkStatus();  // there was no time
    std::vector<VertexMatch> kept;
    for (const WorkingLandmark& landmark : landmarks_) {
      if (result_.landmarks[landmark.index].kept) {
        kept.push_back(landmark.match);
      }
    }
    const bool moved =
        std::any_of(kept.begin(), kept.end(), [&](const VertexMatch& landmark) {
          return alignment_->y_from_x()[landmark.x] != landmark.y;
        });
    alignment_->Fix(kept);
    if (!result_.ended_early) {
      ISOMATCH_ASSIGN_OR_RETURN(
          const int done,
          choice_->Finish(moved, progress_.Share(0, 1), alignment_.get()));
      result_.ended_early = done < options_.alignment_rounds;
    }
    best().y_from_x = alignment_->y_from_x();
    best().matched = alignment_->matched();
    ISOMATCH_ASSIGN_OR_RETURN(offsets_,
                              choice_->DescriptorOffsets(best().y_from_x));
    Keep(Stage::kAlignment);
    return absl::OkStatus();
  }

  absl::Status Finish() {
    progress_.Begin(Stage::kQuality);
    // The map is lifted by Y's normals alone, and needs the memory.
    if (part_ == nullptr && own_x_ != nullptr && own_x_->coarse) {
      own_x_->full.normals.resize(0, 3);
    }
    ISOMATCH_RETURN_IF_ERROR(
        Conclude({shapes_, user_landmarks_, candidates_, alignment_.get(),
                  offsets_, part_ == nullptr ? 1 : part_->scale,
                  choice_ ? choice_->rule() : nullptr},
                 options_, stop_, &result_));
    if (has_unknown_rivals_) result_.symmetry_confidence = 0;
    progress_.FoundMap();
    progress_.Finish();
    return absl::OkStatus();
  }

  bool hurries() const { return stops_.hurry.stop_requested(); }

  const PreparedMesh& shape(Side side) const { return *shapes_[side]; }
  const WorkingMesh& solved(Side side) const { return shape(side).solved(); }

  Candidate& best() { return candidates_.front(); }
  const Candidate& best() const { return candidates_.front(); }

  void Keep(Stage stage) {
    // A part of X is mapped to it, and turned around in the end.
    if (options_.keep_stage_maps && options_.relation != Relation::kPartOfX) {
      result_.stage_maps.push_back(
          {stage, ToUserMap(solved(kX), solved(kY), best().y_from_x)});
    }
  }

  // Input.
  const absl::Span<const Landmark> user_landmarks_;
  const MatchOptions& options_;
  ProgressReporter& progress_;
  const StopTokens& stops_;
  const std::stop_token& stop_;
  const PartStart* part_;  ///< nullptr between whole shapes

  PreparedMesh* own_x_;  ///< what may be mirrored, nullptr before a copy

  // State, an entry a side, in order of the stages that make it.
  std::array<const PreparedMesh*, 2> shapes_;
  std::optional<PreparedMesh> reflected_;  ///< of an X that is not our own
  std::vector<WorkingLandmark> landmarks_;
  std::vector<WorkingLandmark> followers_;  ///< WorkingLandmark::follows
  std::array<std::optional<Closeness>, 2> closeness_;
  std::array<PointPool, 2> pools_;
  std::array<CandidateSearch, 2> search_;
  std::array<PointFrames, 2> frames_;
  std::vector<Candidate> candidates_;  ///< the best first
  /// Some were given up before they were compared with the best.
  bool has_unknown_rivals_ = false;
  std::optional<CandidateChoice> choice_;
  std::unique_ptr<ElasticAlignment> alignment_;  ///< of the best
  std::vector<float> offsets_;                   ///< DescriptorOffsets of it
  Correspondence result_;
};

}  // namespace

absl::StatusOr<Correspondence> RunMatch(const MatchInputs& inputs,
                                        ProgressReporter* progress,
                                        const StopTokens& stops) {
  return MatchRun(inputs, progress, stops).Run();
}

}  // namespace isomatch
