#include "core/pipeline/component_matching.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/parallel.h"
#include "core/base/status_macros.h"
#include "core/geodesic/distance_field_solver.h"
#include "core/geodesic/farthest_point_sampling.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/nearest_vertices.h"
#include "core/pipeline/confidence.h"

namespace isomatch {
namespace {

/// Cost of a whole size apart in space, against a factor of e in area: decides
/// only between components that are otherwise alike.
constexpr double kPositionWeight = 0.05;
/// What one landmark between two components takes off their cost.
constexpr double kLandmarkGain = 100;
constexpr int kExtremities = 4;

/// One component as a mesh of its own, and its vertices in the user's
/// numbering.
struct Component {
  TriangleMesh mesh;
  VertexMap user_from_component;
  VertexMap component_from_clean;
};

Component ExtractComponent(const SplitMesh& split, int position) {
  const TriangleMesh& whole = split.clean.mesh;
  const int number = split.large[position];
  Component component;
  component.component_from_clean.assign(whole.num_vertices(), kNoVertex);
  VertexMap kept;
  for (VertexIndex v = 0; v < whole.num_vertices(); ++v) {
    if (split.components.of_vertex[v] != number) continue;
    component.component_from_clean[v] = static_cast<VertexIndex>(kept.size());
    kept.push_back(v);
    component.user_from_component.push_back(split.clean.original_from_clean[v]);
  }
  std::vector<VertexIndex> faces;
  for (VertexIndex f = 0; f < whole.num_faces(); ++f) {
    if (split.components.of_vertex[whole.faces(f, 0)] == number) {
      faces.push_back(f);
    }
  }
  component.mesh.positions = whole.positions(kept, Eigen::all);
  component.mesh.faces = whole.faces(faces, Eigen::all);
  for (Eigen::Index i = 0; i < component.mesh.faces.size(); ++i) {
    component.mesh.faces.data()[i] =
        component.component_from_clean[component.mesh.faces.data()[i]];
  }
  return component;
}

/// What components are told apart by.
struct ComponentShape {
  double log_area;            ///< of its fraction of all large ones
  double log_length;          ///< of the longest distance found over sqrt(area)
  Eigen::RowVector3d center;  ///< center, in sizes of the whole
};

absl::StatusOr<std::vector<ComponentShape>> ShapesOf(
    const SplitMesh& split, const std::stop_token& stop) {
  const double total =
      std::accumulate(split.areas.begin(), split.areas.end(), 0.0);
  std::vector<ComponentShape> shapes;
  const Eigen::RowVector3d center = split.clean.mesh.positions.colwise().mean();
  for (std::size_t i = 0; i < split.large.size(); ++i) {
    const Component component = ExtractComponent(split, static_cast<int>(i));
    const DistanceFieldSolver solver(component.mesh, stop);
    DistanceFieldSolver::Workspace workspace;
    std::vector<float> field(component.mesh.num_vertices());
    float longest = 0;
    ISOMATCH_ASSIGN_OR_RETURN(const std::vector<VertexIndex> points,
                              FarthestPoints(solver, kExtremities, stop));
    for (const VertexIndex point : points) {
      solver.Solve(point, field.data(), 1, &workspace);
      for (const float d : field) {
        if (d < kUnreachable) longest = std::max(longest, d);
      }
    }
    shapes.push_back({std::log(split.areas[i] / total),
                      std::log(longest / std::sqrt(split.areas[i]) + 1e-9),
                      (component.mesh.positions.colwise().mean() - center) /
                          std::sqrt(total)});
  }
  return shapes;
}

/// What it costs to pair two components, without landmarks.
double CostOf(const ComponentShape& x, const ComponentShape& y) {
  return std::abs(x.log_area - y.log_area) +
         std::abs(x.log_length - y.log_length) +
         kPositionWeight * (x.center - y.center).norm();
}

/// Position in `large` of the component that a user's vertex lies in, or -1.
int ComponentOf(const SplitMesh& split, VertexIndex user) {
  const VertexIndex v = split.clean.clean_from_original[user];
  if (v == kNoVertex) return -1;
  const auto found = std::find(split.large.begin(), split.large.end(),
                               split.components.of_vertex[v]);
  return found == split.large.end()
             ? -1
             : static_cast<int>(found - split.large.begin());
}

std::vector<std::string> WarningsOf(const SplitMesh& split) {
  const auto small =
      std::count_if(split.components.of_vertex.begin(),
                    split.components.of_vertex.end(), [&](int component) {
                      return std::find(split.large.begin(), split.large.end(),
                                       component) == split.large.end();
                    });
  std::vector<std::string> warnings = split.clean.warnings;
  if (small > 0) {
    warnings.push_back(absl::StrCat(
        small, " vertices of small components follow the nearest larger one"));
  }
  return warnings;
}

absl::Status CheckOnFaces(const SplitMesh& split_x, const SplitMesh& split_y,
                          absl::Span<const Landmark> landmarks) {
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    const bool x =
        split_x.clean.clean_from_original[landmarks[i].x] != kNoVertex;
    const bool y =
        split_y.clean.clean_from_original[landmarks[i].y] != kNoVertex;
    if (x && y) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("landmarks[", i, "].", x ? "y" : "x",
                     ": the vertex is on no face, expected one of the "
                     "surface"));
  }
  return absl::OkStatus();
}

/// The results of the components on their way into one.
class Merger {
 public:
  Merger(const TriangleMesh& mesh_x, const SplitMesh& split_x,
         const SplitMesh& split_y, absl::Span<const Landmark> landmarks)
      : mesh_x_(mesh_x), split_x_(split_x) {
    result_.y_from_x.assign(mesh_x.num_vertices(), kNoVertex);
    result_.precise.resize(mesh_x.num_vertices());
    result_.confidence.assign(mesh_x.num_vertices(), 0);
    for (const VertexIndex v : split_y.clean.clean_from_original) {
      result_.matched_y.push_back(v == kNoVertex ? 0 : 1);
    }
    result_.landmarks.assign(landmarks.size(), {false, kNoVertex, 0});
    result_.area_x = SurfaceArea(split_x.clean.mesh);
    result_.area_y = SurfaceArea(split_y.clean.mesh);
    result_.warnings_x = WarningsOf(split_x);
    result_.warnings_y = WarningsOf(split_y);
    if (split_x.large.size() != split_y.large.size()) {
      result_.warnings.push_back(absl::StrCat(
          split_x.large.size(), " large components on X, ",
          split_y.large.size(), " on Y: some have no counterpart"));
    }
    for (const double area : split_x.areas) total_ += area;
  }

  /// `landmark_indices`: the user's numbers of the landmarks that were given.
  void Add(const Component& x, const Component& y, double area,
           const std::vector<std::size_t>& landmark_indices,
           const Correspondence& found) {
    const double weight = area / total_;
    CarryMap(x, y, found.y_from_x, &result_.y_from_x);
    for (std::size_t v = 0; v < found.y_from_x.size(); ++v) {
      const VertexIndex user = x.user_from_component[v];
      PrecisePoint point = found.precise[v];
      for (VertexIndex& vertex : point.vertices) vertex = ToUser(y, vertex);
      result_.precise[user] = point;
      result_.confidence[user] = found.confidence[v];
    }
    for (std::size_t i = 0; i < landmark_indices.size(); ++i) {
      LandmarkOutcome outcome = found.landmarks[i];
      outcome.y_found = ToUser(y, outcome.y_found);
      result_.landmarks[landmark_indices[i]] = outcome;
    }
    for (const VertexMatch& match : found.sparse_matches) {
      result_.sparse_matches.push_back(
          {x.user_from_component[match.x], y.user_from_component[match.y]});
    }
    result_.objective += weight * found.objective;
    result_.ended_early = result_.ended_early || found.ended_early;
    AddScores(weight, found.scores, &result_.scores);
    MapQuality& quality = result_.quality;
    quality.geodesic_distortion += weight * found.quality.geodesic_distortion;
    quality.coverage += weight * found.quality.coverage;
    quality.area_distortion += weight * found.quality.area_distortion;
    for (const std::string& warning : found.warnings) {
      result_.warnings.push_back(warning);
    }
    if (found.symmetry_confidence <= result_.symmetry_confidence) {
      result_.symmetry_confidence = found.symmetry_confidence;
      runner_up_.reset();
      if (!found.alternatives.empty()) {
        runner_up_ = {Alternative{VertexMap(mesh_x_.num_vertices(), kNoVertex),
                                  found.alternatives.front().scores}};
        CarryMap(x, y, found.alternatives.front().y_from_x,
                 &runner_up_->y_from_x);
      }
    }
    AddStages(x, y, found);
  }

  absl::StatusOr<Correspondence> Finish(absl::Span<const Landmark> landmarks,
                                        const std::stop_token& stop) {
    ISOMATCH_RETURN_IF_ERROR(FollowNearest(stop));
    if (runner_up_) {
      for (std::size_t v = 0; v < runner_up_->y_from_x.size(); ++v) {
        VertexIndex& y = runner_up_->y_from_x[v];
        if (y == kNoVertex) y = result_.y_from_x[v];
      }
      result_.alternatives.push_back(*std::move(runner_up_));
    }
    for (std::size_t i = 0; i < landmarks.size(); ++i) {
      LandmarkOutcome& outcome = result_.landmarks[i];
      if (outcome.kept) result_.y_from_x[landmarks[i].x] = landmarks[i].y;
      outcome.y_found = result_.y_from_x[landmarks[i].x];
    }
    result_.quality.unmatched = static_cast<int>(std::count(
        result_.y_from_x.begin(), result_.y_from_x.end(), kNoVertex));
    result_.quality.mean_confidence =
        MeanConfidence(result_.confidence, result_.y_from_x);
    return std::move(result_);
  }

 private:
  static VertexIndex ToUser(const Component& component, VertexIndex v) {
    return v == kNoVertex ? kNoVertex : component.user_from_component[v];
  }

  static void CarryMap(const Component& x, const Component& y,
                       const VertexMap& y_from_x, VertexMap* map) {
    for (std::size_t v = 0; v < y_from_x.size(); ++v) {
      (*map)[x.user_from_component[v]] = ToUser(y, y_from_x[v]);
    }
  }

  static void AddScores(double weight, const MapScores& component,
                        MapScores* whole) {
    whole->embedding_error += weight * component.embedding_error;
    whole->orientation_score += weight * component.orientation_score;
    whole->curvature_mismatch += weight * component.curvature_mismatch;
    whole->normal_mismatch += weight * component.normal_mismatch;
    whole->descriptor_mismatch += weight * component.descriptor_mismatch;
    whole->stretch += weight * component.stretch;
    whole->landmark_contradiction += weight * component.landmark_contradiction;
    whole->rank_value += weight * component.rank_value;
  }

  void AddStages(const Component& x, const Component& y,
                 const Correspondence& found) {
    for (std::size_t s = 0; s < found.stage_maps.size(); ++s) {
      if (s == result_.stage_maps.size()) {
        result_.stage_maps.push_back(
            {found.stage_maps[s].stage,
             VertexMap(mesh_x_.num_vertices(), kNoVertex)});
      }
      CarryMap(x, y, found.stage_maps[s].y_from_x,
               &result_.stage_maps[s].y_from_x);
    }
  }

  /// Vertices of no pair, and those that coincide with others, take over what
  /// the nearest vertex of a pair has.
  absl::Status FollowNearest(const std::stop_token& stop) {
    VertexMap followers;
    VertexMap leaders;
    for (VertexIndex v = 0; v < mesh_x_.num_vertices(); ++v) {
      if (split_x_.clean.clean_from_original[v] == kNoVertex) continue;
      if (result_.y_from_x[v] == kNoVertex) {
        followers.push_back(v);
      } else {
        leaders.push_back(v);
      }
    }
    if (followers.empty()) return absl::OkStatus();
    ISOMATCH_ASSIGN_OR_RETURN(
        const VertexMap nearest,
        NearestVertices(mesh_x_.positions, followers, leaders, stop));
    for (std::size_t i = 0; i < followers.size(); ++i) {
      const VertexIndex leader = leaders[nearest[i]];
      result_.y_from_x[followers[i]] = result_.y_from_x[leader];
      result_.precise[followers[i]] = result_.precise[leader];
      result_.confidence[followers[i]] = result_.confidence[leader];
      for (StageMap& stage : result_.stage_maps) {
        stage.y_from_x[followers[i]] = stage.y_from_x[leader];
      }
    }
    return absl::OkStatus();
  }

  const TriangleMesh& mesh_x_;
  const SplitMesh& split_x_;
  double total_ = 0;
  Correspondence result_;
  std::optional<Alternative> runner_up_;
};

}  // namespace

absl::StatusOr<SplitMesh> SplitIntoComponents(const TriangleMesh& mesh,
                                              const std::stop_token& stop) {
  SplitMesh split;
  ISOMATCH_ASSIGN_OR_RETURN(split.clean, CleanInSpatialOrder(mesh, stop));
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  split.components = ConnectedComponents(split.clean.mesh);
  split.large = LargeComponents(split.clean.mesh, split.components);
  split.areas.assign(split.large.size(), 0);
  for (VertexIndex f = 0; f < split.clean.mesh.num_faces(); ++f) {
    const int component =
        split.components.of_vertex[split.clean.mesh.faces(f, 0)];
    const auto at =
        std::find(split.large.begin(), split.large.end(), component);
    if (at == split.large.end()) continue;
    split.areas[at - split.large.begin()] += FaceArea(split.clean.mesh, f);
  }
  return split;
}

absl::StatusOr<std::vector<ComponentPair>> PairComponents(
    const SplitMesh& split_x, const SplitMesh& split_y,
    absl::Span<const Landmark> landmarks, const std::stop_token& stop) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::vector<ComponentShape> shapes_x,
                            ShapesOf(split_x, stop));
  ISOMATCH_ASSIGN_OR_RETURN(const std::vector<ComponentShape> shapes_y,
                            ShapesOf(split_y, stop));
  // The last solve may have ended early.
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  std::vector<std::tuple<double, int, int>> costs;
  for (int x = 0; x < static_cast<int>(shapes_x.size()); ++x) {
    for (int y = 0; y < static_cast<int>(shapes_y.size()); ++y) {
      const auto between = std::count_if(
          landmarks.begin(), landmarks.end(), [&](const Landmark& landmark) {
            return ComponentOf(split_x, landmark.x) == x &&
                   ComponentOf(split_y, landmark.y) == y;
          });
      const double cost = CostOf(shapes_x[x], shapes_y[y]) -
                          static_cast<double>(between) * kLandmarkGain;
      costs.emplace_back(cost, x, y);
    }
  }
  std::sort(costs.begin(), costs.end());
  std::vector<char> taken_x(shapes_x.size(), false);
  std::vector<char> taken_y(shapes_y.size(), false);
  std::vector<ComponentPair> pairs;
  for (const auto& [cost, x, y] : costs) {
    if (taken_x[x] || taken_y[y]) continue;
    taken_x[x] = taken_y[y] = true;
    pairs.push_back({x, y});
  }
  std::sort(
      pairs.begin(), pairs.end(),
      [](const ComponentPair& a, const ComponentPair& b) { return a.x < b.x; });
  return pairs;
}

absl::StatusOr<Correspondence> MatchByComponents(
    const SplitPair& pair, absl::Span<const Landmark> landmarks,
    const MatchOne& match_one, const MatchControl& control) {
  const auto& [mesh_x, split_x, split_y] = pair;
  ISOMATCH_RETURN_IF_ERROR(CheckOnFaces(split_x, split_y, landmarks));
  ISOMATCH_ASSIGN_OR_RETURN(
      const std::vector<ComponentPair> pairs,
      PairComponents(split_x, split_y, landmarks, control.stop));
  Merger merger(mesh_x, split_x, split_y, landmarks);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Component x = ExtractComponent(split_x, pairs[i].x);
    const Component y = ExtractComponent(split_y, pairs[i].y);
    std::vector<Landmark> own;
    std::vector<std::size_t> indices;
    for (std::size_t l = 0; l < landmarks.size(); ++l) {
      if (ComponentOf(split_x, landmarks[l].x) != pairs[i].x ||
          ComponentOf(split_y, landmarks[l].y) != pairs[i].y) {
        continue;
      }
      own.push_back(
          {x.component_from_clean[split_x.clean
                                      .clean_from_original[landmarks[l].x]],
           y.component_from_clean[split_y.clean
                                      .clean_from_original[landmarks[l].y]]});
      indices.push_back(l);
    }
    const auto component_progress = [&](const Progress& of_component) {
      if (!control.progress) return;
      Progress whole = of_component;
      whole.total_fraction = (double(i) + of_component.total_fraction) /
                             static_cast<double>(pairs.size());
      whole.has_map = of_component.has_map && i + 1 == pairs.size();
      control.progress(whole);
    };
    ISOMATCH_ASSIGN_OR_RETURN(
        const Correspondence found,
        match_one(x.mesh, y.mesh, own, component_progress));
    merger.Add(x, y, split_x.areas[pairs[i].x], indices, found);
  }
  return merger.Finish(landmarks, control.stop);
}

}  // namespace isomatch
