#include "core/pipeline/matcher.h"

#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <unordered_map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/parallel.h"
#include "core/base/random_stream.h"
#include "core/base/status_macros.h"
#include "core/matching/dense_map.h"
#include "core/matching/final_swapping.h"
#include "core/matching/first_stage.h"
#include "core/matching/objective.h"
#include "core/matching/second_stage.h"
#include "core/pipeline/prepared_mesh.h"
#include "core/pipeline/progress_reporter.h"
#include "core/spectral/zoomout.h"

namespace isomatch {
namespace {

/// Landmarks beyond this many are thinned out evenly: they hold the map as well
/// and cost their square.
constexpr std::size_t kMaxLandmarks = 1000;
/// With fewer landmarks than this, generated seeds complete them.
constexpr std::size_t kEnoughLandmarks = 4;
/// Index of the second stage's random stream, apart from the seeds'.
constexpr std::uint64_t kSecondStageStream = std::uint64_t{1} << 40;

/// The stages of a run with their rough share of its time.
std::vector<std::pair<Stage, double>> Plan(const MatchOptions& options) {
  std::vector<std::pair<Stage, double>> plan = {{Stage::kPrepare, 0.03},
                                                {Stage::kGeodesics, 0.2}};
  if (options.zoomout_end > 0) plan.emplace_back(Stage::kSpectral, 0.25);
  plan.emplace_back(Stage::kSeeds, 0.02);
  plan.emplace_back(Stage::kFirstInsertion, 0.3);
  if (options.second_stage_fraction > 0) {
    plan.emplace_back(Stage::kSecondInsertion, 0.3);
    plan.emplace_back(Stage::kFinalSwapping, 0.2);
  }
  if (options.dense_from_closeness) plan.emplace_back(Stage::kDense, 0.15);
  if (options.zoomout_end > 0) plan.emplace_back(Stage::kZoomOut, 0.2);
  plan.emplace_back(Stage::kQuality, 0.01);
  return plan;
}

FirstStageOptions FirstStageOptionsOf(const MatchOptions& options,
                                      std::size_t num_landmarks) {
  FirstStageOptions first;
  first.matches = std::max<int>(options.first_stage_matches, num_landmarks);
  first.rounds = options.selection_rounds;
  first.selection = options.selection;
  first.orientation_from = options.orientation_from;
  first.curvature_weight = options.curvature_weight;
  first.swapping = options.swapping;
  first.swap_interval = options.swap_interval;
  first.swaps = {options.swap_proposals, options.swap_neighbors};
  first.temperature = options.temperature;
  first.relocation_neighbors = options.relocation_neighbors;
  first.random_seed = options.random_seed;
  return first;
}

/// Vertices of a pool: farthest points first, then whatever else is wanted.
std::vector<VertexIndex> PoolVertices(const GeodesicHash& hash, int pool_size,
                                      const std::vector<VertexIndex>& extra) {
  const VertexIndex n = hash.basis.num_vertices();
  std::vector<VertexIndex> vertices = hash.farthest_points;
  if (pool_size > 0 && vertices.size() > static_cast<std::size_t>(pool_size)) {
    vertices.resize(pool_size);
  }
  std::vector<char> is_in(n, false);
  for (const VertexIndex v : vertices) is_in[v] = true;
  const auto add = [&](VertexIndex v) {
    if (!is_in[v]) vertices.push_back(v);
    is_in[v] = true;
  };
  for (const VertexIndex v : extra) add(v);
  if (pool_size == 0) {
    for (VertexIndex v = 0; v < n; ++v) add(v);
  }
  return vertices;
}

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
        progress_(progress, Plan(options)),
        stop_(stop) {}

  absl::StatusOr<Correspondence> Run() {
    ISOMATCH_RETURN_IF_ERROR(Prepare());
    ISOMATCH_RETURN_IF_ERROR(Geodesics());
    ISOMATCH_RETURN_IF_ERROR(Spectral());
    ISOMATCH_RETURN_IF_ERROR(Pools());
    ISOMATCH_RETURN_IF_ERROR(FirstInsertion(Seeds()));
    ISOMATCH_RETURN_IF_ERROR(SecondInsertion());
    ISOMATCH_RETURN_IF_ERROR(Dense());
    ISOMATCH_RETURN_IF_ERROR(Refine());
    Quality();
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
    return TakeLandmarks();
  }

  /// Landmarks as working vertices, each vertex once.
  absl::Status TakeLandmarks() {
    std::set<VertexIndex> taken_x;
    std::set<VertexIndex> taken_y;
    const std::size_t given = user_landmarks_.size();
    const std::size_t kept = std::min(given, kMaxLandmarks);
    for (std::size_t k = 0; k < kept; ++k) {
      const std::size_t i = k * given / kept;
      const VertexMatch match = {
          working_[kX].working_from_user[user_landmarks_[i].x],
          working_[kY].working_from_user[user_landmarks_[i].y]};
      if (match.x == kNoVertex || match.y == kNoVertex) {
        return absl::InvalidArgumentError(absl::StrCat(
            "landmarks[", i, "].", match.x == kNoVertex ? "x" : "y",
            ": the vertex is on no face, expected one of the surface"));
      }
      if (taken_x.count(match.x) > 0 || taken_y.count(match.y) > 0) {
        result_.warnings.push_back(
            absl::StrCat("landmarks[", i,
                         "] left out: its vertex coincides with that of "
                         "an earlier landmark"));
        continue;
      }
      taken_x.insert(match.x);
      taken_y.insert(match.y);
      landmarks_.push_back(match);
    }
    if (kept < given) {
      result_.warnings.push_back(absl::StrCat(
          kept, " of ", given, " landmarks used, evenly from the list"));
    }
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
    if (options_.zoomout_end == 0) return absl::OkStatus();
    progress_.Begin(Stage::kSpectral);
    return Both([&](Side side) -> absl::Status {
      ISOMATCH_ASSIGN_OR_RETURN(
          spectral_[side],
          PrepareSpectralBasis(working_[side], options_.zoomout_end, stop_));
      progress_.Part(side, 2)(1);
      return absl::OkStatus();
    });
  }

  absl::Status Pools() {
    progress_.Begin(Stage::kSeeds);
    return Both([&](Side side) -> absl::Status {
      std::vector<VertexIndex> extra;
      for (const VertexMatch& match : landmarks_) {
        extra.push_back(side == kX ? match.x : match.y);
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
            curvature,
            PrepareCurvature(working_[side], options_.curvature_radius));
      }
      frames_[side] =
          GatherFrames(working_[side].mesh.positions, working_[side].normals,
                       curvature, pools_[side]);
      return absl::OkStatus();
    });
  }

  Seed LandmarkSeed() const {
    std::array<std::unordered_map<VertexIndex, int>, 2> points;
    for (const Side side : {kX, kY}) {
      for (int p = 0; p < pools_[side].size(); ++p) {
        points[side][pools_[side].vertex(p)] = p;
      }
    }
    Seed seed;
    for (const VertexMatch& match : landmarks_) {
      seed.push_back({points[kX].at(match.x), points[kY].at(match.y)});
    }
    return seed;
  }

  /// Where the competing maps start: at the landmarks, at generated seeds, or,
  /// when the landmarks are few, at both together.
  std::vector<Seed> Seeds() const {
    const Seed given = LandmarkSeed();
    if (given.size() >= kEnoughLandmarks) return {given};
    const std::vector<Seed> generated = GenerateSeeds(
        pools_[kX], pools_[kY],
        {options_.seed_points, options_.seed_matches, options_.max_seeds});
    if (given.empty()) return generated;
    std::vector<Seed> seeds = {given};
    for (const Seed& seed : generated) {
      Seed both = given;
      for (const PointMatch& match : seed) {
        const bool free = std::none_of(
            given.begin(), given.end(), [&](const PointMatch& other) {
              return other.x == match.x || other.y == match.y;
            });
        if (free) both.push_back(match);
      }
      seeds.push_back(std::move(both));
    }
    return seeds;
  }

  absl::Status FirstInsertion(const std::vector<Seed>& seeds) {
    progress_.Begin(Stage::kFirstInsertion);
    FirstStageOptions first = FirstStageOptionsOf(options_, landmarks_.size());
    const bool oriented = working_[kX].oriented && working_[kY].oriented;
    if (!oriented) first.orientation_from = 0;
    ISOMATCH_ASSIGN_OR_RETURN(
        const Matching matching,
        RunFirstStage({pools_[kX], pools_[kY], search_[kX], search_[kY],
                       frames_[kX], frames_[kY]},
                      seeds, first, progress_.Part(0, 1), stop_));
    for (const PointMatch& match : matching.Matches()) {
      sparse_.push_back(
          {pools_[kX].vertex(match.x), pools_[kY].vertex(match.y)});
    }
    result_.embedding_error = EmbeddingError(matching);
    result_.objective = Objective(matching);
    if (oriented) {
      result_.orientation_score =
          OrientationScore(matching, frames_[kX], frames_[kY]);
    }
    y_from_x_.assign(working_[kX].mesh.num_vertices(), kNoVertex);
    for (const VertexMatch& match : sparse_) y_from_x_[match.x] = match.y;
    Keep(Stage::kFirstInsertion);
    // The tables are used up; what follows needs the memory.
    for (const Side side : {kX, kY}) pools_[side] = PointPool();
    return absl::OkStatus();
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
    for (const VertexMatch& match : sparse_) map.Set(match.x, match.y);
    SecondStageOptions second;
    second.fraction = options_.second_stage_fraction;
    RandomStream random(options_.random_seed, kSecondStageStream);
    ISOMATCH_RETURN_IF_ERROR(RunSecondStage(shape_x, shape_y, second, &random,
                                            progress_.Part(0, 1), stop_, &map));
    y_from_x_ = map.y_from_x;
    Keep(Stage::kSecondInsertion);
    progress_.Begin(Stage::kFinalSwapping);
    if (options_.swapping != Swapping::kNone) {
      ISOMATCH_RETURN_IF_ERROR(SwapWorst(shape_x, shape_y,
                                         options_.final_swap_fraction,
                                         progress_.Part(0, 1), stop_, &map));
    }
    y_from_x_ = map.y_from_x;
    Keep(Stage::kFinalSwapping);
    return absl::OkStatus();
  }

  static Environments AllEnvironments(const BasisPoints& basis) {
    std::vector<VertexIndex> all(basis.num_vertices());
    for (VertexIndex v = 0; v < basis.num_vertices(); ++v) all[v] = v;
    return {basis, all};
  }

  absl::Status Dense() {
    if (!options_.dense_from_closeness) return absl::OkStatus();
    progress_.Begin(Stage::kDense);
    ISOMATCH_ASSIGN_OR_RETURN(
        y_from_x_,
        DenseMapFromMatches(*closeness_[kX], *closeness_[kY], sparse_, stop_));
    Keep(Stage::kDense);
    return absl::OkStatus();
  }

  absl::Status Refine() {
    // The distance fields are used up; what follows needs the memory.
    for (const Side side : {kX, kY}) hash_[side] = GeodesicHash();
    if (options_.zoomout_end == 0) return absl::OkStatus();
    progress_.Begin(Stage::kZoomOut);
    ISOMATCH_ASSIGN_OR_RETURN(
        y_from_x_, ZoomOut(spectral_[kX], spectral_[kY], std::move(y_from_x_),
                           {options_.zoomout_start, options_.zoomout_end,
                            options_.zoomout_step},
                           progress_.Part(0, 1), stop_));
    Keep(Stage::kZoomOut);
    return absl::OkStatus();
  }

  void Quality() {
    progress_.Begin(Stage::kQuality);
    result_.y_from_x = UserMap();
    for (const VertexMatch& match : sparse_) {
      result_.sparse_matches.push_back(
          {working_[kX].user_from_working[match.x],
           working_[kY].user_from_working[match.y]});
    }
    result_.area_x = working_[kX].area;
    result_.area_y = working_[kY].area;
    result_.warnings_x = working_[kX].warnings;
    result_.warnings_y = working_[kY].warnings;
    if (result_.orientation_score < 0) {
      result_.warnings.push_back(
          absl::StrCat("the map is probably mirrored: orientation score ",
                       result_.orientation_score));
    }
    progress_.Finish();
  }

  /// The current map in the user's numbering.
  VertexMap UserMap() const {
    VertexMap user_map;
    for (const VertexIndex x : working_[kX].working_from_user) {
      const VertexIndex y = x == kNoVertex ? kNoVertex : y_from_x_[x];
      user_map.push_back(y == kNoVertex ? kNoVertex
                                        : working_[kY].user_from_working[y]);
    }
    return user_map;
  }

  void Keep(Stage stage) {
    if (options_.keep_stage_maps) {
      result_.stage_maps.push_back({stage, UserMap()});
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
  std::vector<VertexMatch> landmarks_;  ///< working vertices
  std::array<GeodesicHash, 2> hash_;
  std::array<std::optional<Closeness>, 2> closeness_;
  std::array<SpectralBasis, 2> spectral_;
  std::array<PointPool, 2> pools_;
  std::array<CandidateSearch, 2> search_;
  std::array<PointFrames, 2> frames_;
  std::vector<VertexMatch> sparse_;  ///< working vertices
  VertexMap y_from_x_;               ///< working vertices
  Correspondence result_;
};

}  // namespace

const char* StageName(Stage stage) {
  switch (stage) {
    case Stage::kPrepare:
      return "prepare";
    case Stage::kGeodesics:
      return "geodesics";
    case Stage::kSpectral:
      return "spectral bases";
    case Stage::kSeeds:
      return "seeds";
    case Stage::kFirstInsertion:
      return "first insertion";
    case Stage::kSecondInsertion:
      return "second insertion";
    case Stage::kFinalSwapping:
      return "final swapping";
    case Stage::kDense:
      return "dense map";
    case Stage::kZoomOut:
      return "zoomout";
    case Stage::kQuality:
      return "quality";
  }
  return "unknown";
}

absl::Status ValidateLandmarks(absl::Span<const Landmark> landmarks,
                               std::int64_t vertices_x,
                               std::int64_t vertices_y) {
  std::unordered_map<VertexIndex, std::size_t> first_x;
  std::unordered_map<VertexIndex, std::size_t> first_y;
  const auto check = [](std::size_t i, const char* field, VertexIndex vertex,
                        std::int64_t vertices,
                        std::unordered_map<VertexIndex, std::size_t>* first) {
    if (vertex < 0 || vertex >= vertices) {
      return absl::InvalidArgumentError(
          absl::StrCat("landmarks[", i, "].", field, ": ", vertex,
                       ", expected 0 to ", vertices - 1));
    }
    const auto [it, is_new] = first->try_emplace(vertex, i);
    if (is_new) return absl::OkStatus();
    return absl::InvalidArgumentError(
        absl::StrCat("landmarks[", i, "].", field, ": vertex ", vertex,
                     " is already matched by landmarks[", it->second,
                     "], expected each vertex at most once"));
  };
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    ISOMATCH_RETURN_IF_ERROR(
        check(i, "x", landmarks[i].x, vertices_x, &first_x));
    ISOMATCH_RETURN_IF_ERROR(
        check(i, "y", landmarks[i].y, vertices_y, &first_y));
  }
  return absl::OkStatus();
}

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
  absl::StatusOr<Correspondence> result = absl::InternalError("not run");
  RunWithThreads(options.threads, [&] {
    result = Matcher(mesh_x, mesh_y, landmarks, options, progress, stop).Run();
  });
  return result;
}

}  // namespace isomatch
