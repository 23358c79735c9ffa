#include "core/pipeline/matcher.h"

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <unordered_map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/alignment/elastic_alignment.h"
#include "core/base/parallel.h"
#include "core/base/random_stream.h"
#include "core/base/status_macros.h"
#include "core/matching/dense_map.h"
#include "core/matching/final_swapping.h"
#include "core/matching/first_stage.h"
#include "core/matching/objective.h"
#include "core/matching/second_stage.h"
#include "core/pipeline/candidates.h"
#include "core/pipeline/component_matching.h"
#include "core/pipeline/conclusion.h"
#include "core/pipeline/landmarks.h"
#include "core/pipeline/prepared_mesh.h"
#include "core/pipeline/progress_reporter.h"
#include "core/pipeline/stage_plan.h"
#include "core/spectral/functional_map.h"
#include "core/spectral/mean_curvature.h"
#include "core/spectral/zoomout.h"

namespace isomatch {
namespace {

/// Index of the second stage's random stream, apart from the seeds'.
constexpr std::uint64_t kSecondStageStream = std::uint64_t{1} << 40;

/// Below this, rank values are rounding.
constexpr double kRounding = 1e-8;
/// A landmark is kept when the map sends it no further than this from where it
/// should go, in sqrt(area).
constexpr float kLandmarkTolerance = 0.1f;

/// One run of the method: the stages in order, each reading what those before
/// it left in the members.
class Matcher {
 public:
  Matcher(const TriangleMesh& mesh_x, const TriangleMesh& mesh_y,
          absl::Span<const Landmark> landmarks, const MatchOptions& options,
          const ProgressCallback& progress, const std::stop_token& stop)
      : meshes_{&mesh_x, &mesh_y},
        user_landmarks_(landmarks),
        options_(options),
        progress_(progress, StagePlan(options)),
        stop_(stop) {}

  absl::StatusOr<Correspondence> Run() {
    ISOMATCH_RETURN_IF_ERROR(Prepare());
    ISOMATCH_RETURN_IF_ERROR(Geodesics());
    ISOMATCH_RETURN_IF_ERROR(Spectral());
    ISOMATCH_RETURN_IF_ERROR(Pools());
    ISOMATCH_RETURN_IF_ERROR(FirstInsertion());
    ISOMATCH_RETURN_IF_ERROR(SecondInsertion());
    ISOMATCH_RETURN_IF_ERROR(Dense());
    ISOMATCH_RETURN_IF_ERROR(Refine());
    ISOMATCH_RETURN_IF_ERROR(Choose());
    ISOMATCH_RETURN_IF_ERROR(Align());
    ISOMATCH_RETURN_IF_ERROR(Conclude());
    return std::move(result_);
  }

 private:
  /// Calls f(side) for both sides, at the same time where threads allow.
  template <typename Function>
  absl::Status Both(const Function& f) {
    return RunBoth([&] { return f(kX); }, [&] { return f(kY); });
  }

  absl::Status Prepare() {
    progress_.Begin(Stage::kPrepare);
    ISOMATCH_RETURN_IF_ERROR(Both([&](Side side) -> absl::Status {
      ISOMATCH_ASSIGN_OR_RETURN(working_[side],
                                MakeWorkingMesh(*meshes_[side], stop_));
      return absl::OkStatus();
    }));
    ISOMATCH_ASSIGN_OR_RETURN(
        landmarks_, TakeLandmarks(user_landmarks_, working_[kX], working_[kY],
                                  &result_.warnings));
    return absl::OkStatus();
  }

  absl::Status Geodesics() {
    progress_.Begin(Stage::kGeodesics);
    return Both([&](Side side) -> absl::Status {
      ISOMATCH_ASSIGN_OR_RETURN(
          hash_[side], HashGeodesics(working_[side], options_.pool_size,
                                     progress_.Part(side, 2), stop_));
      closeness_[side].emplace(hash_[side].basis, options_.kernel_width);
      return absl::OkStatus();
    });
  }

  absl::Status Spectral() {
    const int count = SpectralCount(options_);
    if (count > 0) progress_.Begin(Stage::kSpectral);
    return Both([&](Side side) -> absl::Status {
      laplacian_[side] = BuildCotanLaplacian(working_[side].mesh);
      if (count == 0) return absl::OkStatus();
      ISOMATCH_ASSIGN_OR_RETURN(
          spectral_[side],
          ComputeSpectralBasis(laplacian_[side], count, stop_));
      progress_.Part(side, 2)(1);
      return absl::OkStatus();
    });
  }

  absl::Status Pools() {
    progress_.Begin(Stage::kSeeds);
    return Both([&](Side side) -> absl::Status {
      std::vector<VertexIndex> extra;
      for (const WorkingLandmark& landmark : landmarks_) {
        extra.push_back(side == kX ? landmark.match.x : landmark.match.y);
      }
      ISOMATCH_ASSIGN_OR_RETURN(
          pools_[side],
          PointPool::Create(
              *closeness_[side],
              PoolVertices(hash_[side], options_.pool_size, extra), stop_));
      if (options_.candidates_from_environments) {
        search_[side] = CandidateSearch(hash_[side].basis, pools_[side]);
      }
      Eigen::VectorXd curvature =
          Eigen::VectorXd::Zero(working_[side].mesh.num_vertices());
      if (options_.curvature_weight > 0) {
        ISOMATCH_ASSIGN_OR_RETURN(
            curvature, SmoothedMeanCurvature(
                           laplacian_[side], working_[side].mesh.positions,
                           working_[side].normals, options_.curvature_radius));
      }
      frames_[side] =
          GatherFrames(working_[side].mesh.positions, working_[side].normals,
                       curvature, pools_[side]);
      return absl::OkStatus();
    });
  }

  /// The landmarks that the first stage relies on, as points of the pools.
  Seed TrustedLandmarks() const {
    std::vector<VertexMatch> trusted;
    if (options_.landmarks_exact) {
      for (const WorkingLandmark& landmark : landmarks_) {
        trusted.push_back(landmark.match);
      }
    } else {
      trusted = AgreeingLandmarks(landmarks_, hash_[kX].basis, hash_[kY].basis);
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

  bool oriented() const {
    return working_[kX].oriented && working_[kY].oriented;
  }

  absl::Status FirstInsertion() {
    const Seed trusted = TrustedLandmarks();
    const std::vector<Seed> seeds = SeedsWithLandmarks(
        trusted,
        GenerateSeeds(
            pools_[kX], pools_[kY],
            {options_.seed_points, options_.seed_matches, options_.max_seeds}),
        options_.landmarks_exact);
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
                       frames_[kX], frames_[kY]},
                      seeds, first, progress_.Part(0, 1), stop_));
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
    Keep(Stage::kFirstInsertion);
    // The tables are used up; what follows needs the memory.
    for (const Side side : {kX, kY}) pools_[side] = PointPool();
    return absl::OkStatus();
  }

  Candidate MakeCandidate(const RankedMap& map) const {
    Candidate candidate;
    for (const PointMatch& match : map.matching.Matches()) {
      candidate.sparse.push_back(
          {pools_[kX].vertex(match.x), pools_[kY].vertex(match.y)});
    }
    candidate.y_from_x.assign(working_[kX].mesh.num_vertices(), kNoVertex);
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
        AllEnvironments(hash_[kX].basis), AllEnvironments(hash_[kY].basis)};
    const HashedShape shape_x = {*closeness_[kX], environments[kX]};
    const HashedShape shape_y = {*closeness_[kY], environments[kY]};
    PartialVertexMap map(working_[kX].mesh.num_vertices(),
                         working_[kY].mesh.num_vertices());
    for (const VertexMatch& match : best().sparse) map.Set(match.x, match.y);
    SecondStageOptions second;
    second.fraction = options_.second_stage_fraction;
    RandomStream random(options_.random_seed, kSecondStageStream);
    ISOMATCH_RETURN_IF_ERROR(RunSecondStage(shape_x, shape_y, second, &random,
                                            progress_.Part(0, 1), stop_, &map));
    best().y_from_x = map.y_from_x;
    Keep(Stage::kSecondInsertion);
    progress_.Begin(Stage::kFinalSwapping);
    if (options_.swapping != Swapping::kNone) {
      ISOMATCH_RETURN_IF_ERROR(SwapWorst(shape_x, shape_y,
                                         options_.final_swap_fraction,
                                         progress_.Part(0, 1), stop_, &map));
    }
    best().y_from_x = map.y_from_x;
    Keep(Stage::kFinalSwapping);
    return absl::OkStatus();
  }

  DenseMapSurface DenseSurface(Side side) const {
    return {*closeness_[side], working_[side].stars, laplacian_[side].mass};
  }

  absl::Status Dense() {
    if (!options_.dense_from_closeness) return absl::OkStatus();
    progress_.Begin(Stage::kDense);
    for (Candidate& candidate : candidates_) {
      ISOMATCH_ASSIGN_OR_RETURN(
          candidate.y_from_x,
          DenseMapFromMatches(DenseSurface(kX), DenseSurface(kY),
                              candidate.sparse, stop_));
    }
    Keep(Stage::kDense);
    return absl::OkStatus();
  }

  absl::Status Refine() {
    if (options_.zoomout_end == 0) return absl::OkStatus();
    progress_.Begin(Stage::kZoomOut);
    ISOMATCH_ASSIGN_OR_RETURN(
        best().y_from_x,
        ZoomOut(spectral_[kX], spectral_[kY], std::move(best().y_from_x),
                {options_.zoomout_start, options_.zoomout_end,
                 options_.zoomout_step},
                progress_.Part(0, 1), stop_));
    Keep(Stage::kZoomOut);
    return absl::OkStatus();
  }

  AlignmentShape ShapeOf(Side side) const {
    return {working_[side].mesh, working_[side].normals, laplacian_[side],
            spectral_[side], working_[side].stars};
  }

  /// A mirrored map, as landmarks may want it, is an elastic motion of the
  /// mirror image only. Intrinsically that is the same shape.
  void Reflect() {
    TriangleMesh& mesh = working_[kX].mesh;
    mesh.positions.col(0) *= -1;
    mesh.faces.col(1).swap(mesh.faces.col(2));
    working_[kX].normals.col(0) *= -1;
  }

  absl::Status Choose() {
    if (options_.alignment_rounds == 0) return absl::OkStatus();
    progress_.Begin(Stage::kChoice);
    if (oriented() && best().scores.orientation_score < 0) Reflect();
    choice_.emplace(ShapeOf(kX), ShapeOf(kY), oriented(), options_, stop_);
    ISOMATCH_ASSIGN_OR_RETURN(
        alignment_, choice_->Choose(progress_.Part(0, 1), &candidates_));
    Keep(Stage::kChoice);
    return absl::OkStatus();
  }

  /// Decides which landmarks the map respects, and sets those.
  void SettleLandmarks() {
    result_.landmarks.assign(user_landmarks_.size(), {});
    std::vector<char> used(user_landmarks_.size(), false);
    for (const auto& [match, index] : landmarks_) {
      LandmarkOutcome& outcome = result_.landmarks[index];
      const VertexIndex found = best().y_from_x[match.x];
      const float distance =
          found == kNoVertex
              ? 0
              : std::min(hash_[kY].basis.LowerBound(found, match.y),
                         kUnreachable);
      outcome.kept = options_.landmarks_exact || distance <= kLandmarkTolerance;
      outcome.distance = outcome.kept ? 0 : distance;
      if (outcome.kept) best().y_from_x[match.x] = match.y;
      used[index] = true;
    }
    for (std::size_t i = 0; i < used.size(); ++i) {
      if (!used[i]) result_.landmarks[i].kept = false;
    }
  }

  absl::Status Align() {
    SettleLandmarks();
    // The distance fields are used up; what follows needs the memory.
    for (const Side side : {kX, kY}) hash_[side] = GeodesicHash();
    if (options_.alignment_rounds == 0) return absl::OkStatus();
    progress_.Begin(Stage::kAlignment);
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
    ISOMATCH_RETURN_IF_ERROR(
        choice_->Finish(moved, progress_.Part(0, 1), alignment_.get()));
    best().y_from_x = alignment_->y_from_x();
    ISOMATCH_ASSIGN_OR_RETURN(offsets_,
                              choice_->DescriptorOffsets(best().y_from_x));
    Keep(Stage::kAlignment);
    return absl::OkStatus();
  }

  absl::Status Conclude() {
    progress_.Begin(Stage::kQuality);
    result_.y_from_x = UserMap(best().y_from_x);
    ReportLandmarks();
    ReportScores();
    result_.precise =
        PrecisePoints(working_, alignment_.get(), result_.y_from_x);
    ISOMATCH_RETURN_IF_ERROR(ReportQuality(working_, best().y_from_x,
                                           best().filtered, offsets_,
                                           alignment_.get(), stop_, &result_));
    result_.area_x = working_[kX].area;
    result_.area_y = working_[kY].area;
    result_.warnings_x = working_[kX].warnings;
    result_.warnings_y = working_[kY].warnings;
    if (result_.scores.orientation_score < 0) {
      result_.warnings.push_back(
          absl::StrCat("the map is probably mirrored: orientation score ",
                       result_.scores.orientation_score));
    }
    progress_.Finish();
    return absl::OkStatus();
  }

  /// Where landmarks went in the end. Vertices that coincide after cleaning
  /// have one image; a kept landmark names its own.
  void ReportLandmarks() {
    int changed = 0;
    for (std::size_t i = 0; i < user_landmarks_.size(); ++i) {
      LandmarkOutcome& outcome = result_.landmarks[i];
      if (outcome.kept)
        result_.y_from_x[user_landmarks_[i].x] = user_landmarks_[i].y;
      outcome.y_found = result_.y_from_x[user_landmarks_[i].x];
      changed += !outcome.kept;
    }
    if (changed > 0) {
      result_.warnings.push_back(
          absl::StrCat(changed, " of ", user_landmarks_.size(),
                       " landmarks contradict the rest and were not kept"));
    }
  }

  void ReportScores() {
    for (const VertexMatch& match : best().sparse) {
      result_.sparse_matches.push_back(
          {working_[kX].user_from_working[match.x],
           working_[kY].user_from_working[match.y]});
    }
    result_.objective = best().objective;
    result_.scores = best().scores;
    for (std::size_t i = 1; i < candidates_.size(); ++i) {
      result_.alternatives.push_back(
          {UserMap(candidates_[i].y_from_x), candidates_[i].scores});
    }
    result_.symmetry_confidence = SymmetryConfidence(options_, candidates_);
    if (options_.keep_functional_map && spectral_[kX].size() > 0) {
      const int k = std::min(spectral_[kX].size(), spectral_[kY].size());
      result_.functional_map = FunctionalMapFromVertexMap(
          spectral_[kX], spectral_[kY], best().y_from_x, k);
      result_.eigenvalues_x = spectral_[kX].eigenvalues.head(k);
      result_.eigenvalues_y = spectral_[kY].eigenvalues.head(k);
    }
  }

  VertexMap UserMap(const VertexMap& y_from_x) const {
    return ToUserMap(working_, y_from_x);
  }

  Candidate& best() { return candidates_.front(); }
  const Candidate& best() const { return candidates_.front(); }

  void Keep(Stage stage) {
    if (options_.keep_stage_maps) {
      result_.stage_maps.push_back({stage, UserMap(best().y_from_x)});
    }
  }

  // Input.
  const std::array<const TriangleMesh*, 2> meshes_;
  const absl::Span<const Landmark> user_landmarks_;
  const MatchOptions& options_;
  ProgressReporter progress_;
  const std::stop_token& stop_;

  // State, an entry a side, in order of the stages that make it.
  std::array<WorkingMesh, 2> working_;
  std::vector<WorkingLandmark> landmarks_;
  std::array<GeodesicHash, 2> hash_;
  std::array<std::optional<Closeness>, 2> closeness_;
  std::array<CotanLaplacian, 2> laplacian_;
  std::array<SpectralBasis, 2> spectral_;
  std::array<PointPool, 2> pools_;
  std::array<CandidateSearch, 2> search_;
  std::array<PointFrames, 2> frames_;
  std::vector<Candidate> candidates_;  ///< the best first
  std::optional<CandidateChoice> choice_;
  std::unique_ptr<ElasticAlignment> alignment_;  ///< of the best
  std::vector<float> offsets_;                   ///< DescriptorOffsets of it
  Correspondence result_;
};

}  // namespace

absl::StatusOr<Correspondence> Match(const TriangleMesh& mesh_x,
                                     const TriangleMesh& mesh_y,
                                     absl::Span<const Landmark> landmarks,
                                     const MatchOptions& options,
                                     const ProgressCallback& progress,
                                     std::stop_token stop) {
  ISOMATCH_RETURN_IF_ERROR(options.Validate());
  ISOMATCH_RETURN_IF_ERROR(ValidateMesh(mesh_x, "mesh_x"));
  ISOMATCH_RETURN_IF_ERROR(ValidateMesh(mesh_y, "mesh_y"));
  ISOMATCH_RETURN_IF_ERROR(ValidateLandmarks(landmarks, mesh_x.num_vertices(),
                                             mesh_y.num_vertices()));
  const auto match_one = [&](const TriangleMesh& x, const TriangleMesh& y,
                             absl::Span<const Landmark> known,
                             const ProgressCallback& report) {
    return Matcher(x, y, known, options, report, stop).Run();
  };
  absl::StatusOr<Correspondence> result = absl::InternalError("not run");
  RunWithThreads(options.threads, [&] {
    if (options.match_components) {
      const MeshParts parts_x = SplitIntoParts(mesh_x);
      const MeshParts parts_y = SplitIntoParts(mesh_y);
      if (MatchedByParts(parts_x, parts_y)) {
        result = MatchByParts(mesh_x, parts_x, parts_y, landmarks, match_one,
                              progress, stop);
        return;
      }
    }
    result = match_one(mesh_x, mesh_y, landmarks, progress);
  });
  return result;
}

}  // namespace isomatch
