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

namespace isomatch {
namespace {

/// Cost of a whole size apart in space, against a factor of e in area: decides
/// only between parts that are otherwise alike.
constexpr double kPlaceWeight = 0.05;
/// What one landmark between two parts takes off their cost.
constexpr double kLandmarkGain = 100;
constexpr int kExtremities = 4;

/// One part as a mesh of its own, and its vertices in the user's numbering.
struct Part {
  TriangleMesh mesh;
  VertexMap user_from_part;
  VertexMap part_from_clean;
};

Part ExtractPart(const MeshParts& parts, int position) {
  const TriangleMesh& whole = parts.clean.mesh;
  const int component = parts.large[position];
  Part part;
  part.part_from_clean.assign(whole.num_vertices(), kNoVertex);
  VertexMap kept;
  for (VertexIndex v = 0; v < whole.num_vertices(); ++v) {
    if (parts.components.of_vertex[v] != component) continue;
    part.part_from_clean[v] = static_cast<VertexIndex>(kept.size());
    kept.push_back(v);
    part.user_from_part.push_back(parts.clean.original_from_clean[v]);
  }
  std::vector<VertexIndex> faces;
  for (VertexIndex f = 0; f < whole.num_faces(); ++f) {
    if (parts.components.of_vertex[whole.faces(f, 0)] == component) {
      faces.push_back(f);
    }
  }
  part.mesh.positions = whole.positions(kept, Eigen::all);
  part.mesh.faces = whole.faces(faces, Eigen::all);
  for (Eigen::Index i = 0; i < part.mesh.faces.size(); ++i) {
    part.mesh.faces.data()[i] = part.part_from_clean[part.mesh.faces.data()[i]];
  }
  return part;
}

/// What parts are told apart by.
struct PartShape {
  double log_area;           ///< of its fraction of all large parts
  double log_length;         ///< of the longest distance found over sqrt(area)
  Eigen::RowVector3d place;  ///< center, in sizes of the whole
};

absl::StatusOr<std::vector<PartShape>> ShapesOf(const MeshParts& parts,
                                                const std::stop_token& stop) {
  const double total =
      std::accumulate(parts.areas.begin(), parts.areas.end(), 0.0);
  std::vector<PartShape> shapes;
  const Eigen::RowVector3d center = parts.clean.mesh.positions.colwise().mean();
  for (std::size_t i = 0; i < parts.large.size(); ++i) {
    const Part part = ExtractPart(parts, static_cast<int>(i));
    const DistanceFieldSolver solver(part.mesh, stop);
    DistanceFieldSolver::Workspace workspace;
    std::vector<float> field(part.mesh.num_vertices());
    float longest = 0;
    ISOMATCH_ASSIGN_OR_RETURN(const std::vector<VertexIndex> points,
                              FarthestPoints(solver, kExtremities, stop));
    for (const VertexIndex point : points) {
      solver.Solve(point, field.data(), 1, &workspace);
      for (const float d : field) {
        if (d < kUnreachable) longest = std::max(longest, d);
      }
    }
    shapes.push_back(
        {std::log(parts.areas[i] / total),
         std::log(longest / std::sqrt(parts.areas[i]) + 1e-9),
         (part.mesh.positions.colwise().mean() - center) / std::sqrt(total)});
  }
  return shapes;
}

/// Position in `large` of the part that a user's vertex lies in, or -1.
int PartOf(const MeshParts& parts, VertexIndex user) {
  const VertexIndex v = parts.clean.clean_from_original[user];
  if (v == kNoVertex) return -1;
  const auto found = std::find(parts.large.begin(), parts.large.end(),
                               parts.components.of_vertex[v]);
  return found == parts.large.end()
             ? -1
             : static_cast<int>(found - parts.large.begin());
}

std::vector<std::string> WarningsOf(const MeshParts& parts) {
  const auto small =
      std::count_if(parts.components.of_vertex.begin(),
                    parts.components.of_vertex.end(), [&](int component) {
                      return std::find(parts.large.begin(), parts.large.end(),
                                       component) == parts.large.end();
                    });
  std::vector<std::string> warnings = parts.clean.warnings;
  if (small > 0) {
    warnings.push_back(absl::StrCat(
        small, " vertices of small components follow the nearest larger one"));
  }
  return warnings;
}

absl::Status CheckOnFaces(const MeshParts& parts_x, const MeshParts& parts_y,
                          absl::Span<const Landmark> landmarks) {
  for (std::size_t i = 0; i < landmarks.size(); ++i) {
    const bool x =
        parts_x.clean.clean_from_original[landmarks[i].x] != kNoVertex;
    const bool y =
        parts_y.clean.clean_from_original[landmarks[i].y] != kNoVertex;
    if (x && y) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("landmarks[", i, "].", x ? "y" : "x",
                     ": the vertex is on no face, expected one of the "
                     "surface"));
  }
  return absl::OkStatus();
}

/// The results of the parts on their way into one.
class Merger {
 public:
  Merger(const TriangleMesh& mesh_x, const MeshParts& parts_x,
         const MeshParts& parts_y, absl::Span<const Landmark> landmarks)
      : mesh_x_(mesh_x), parts_x_(parts_x) {
    result_.y_from_x.assign(mesh_x.num_vertices(), kNoVertex);
    result_.precise.resize(mesh_x.num_vertices());
    result_.confidence.assign(mesh_x.num_vertices(), 0);
    result_.landmarks.assign(landmarks.size(), {false, kNoVertex, 0});
    result_.area_x = SurfaceArea(parts_x.clean.mesh);
    result_.area_y = SurfaceArea(parts_y.clean.mesh);
    result_.warnings_x = WarningsOf(parts_x);
    result_.warnings_y = WarningsOf(parts_y);
    if (parts_x.large.size() != parts_y.large.size()) {
      result_.warnings.push_back(absl::StrCat(
          parts_x.large.size(), " large components on X, ",
          parts_y.large.size(), " on Y: some have no counterpart"));
    }
    for (const double area : parts_x.areas) total_ += area;
  }

  /// `landmark_indices`: the user's numbers of the landmarks that were given.
  void Add(const Part& x, const Part& y, double area,
           const std::vector<std::size_t>& landmark_indices,
           const Correspondence& found) {
    const double weight = area / total_;
    Place(x, y, found.y_from_x, &result_.y_from_x);
    for (std::size_t v = 0; v < found.y_from_x.size(); ++v) {
      const VertexIndex user = x.user_from_part[v];
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
          {x.user_from_part[match.x], y.user_from_part[match.y]});
    }
    result_.objective += weight * found.objective;
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
        Place(x, y, found.alternatives.front().y_from_x, &runner_up_->y_from_x);
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
    return std::move(result_);
  }

 private:
  static VertexIndex ToUser(const Part& part, VertexIndex v) {
    return v == kNoVertex ? kNoVertex : part.user_from_part[v];
  }

  static void Place(const Part& x, const Part& y, const VertexMap& y_from_x,
                    VertexMap* map) {
    for (std::size_t v = 0; v < y_from_x.size(); ++v) {
      (*map)[x.user_from_part[v]] = ToUser(y, y_from_x[v]);
    }
  }

  static void AddScores(double weight, const MapScores& part,
                        MapScores* whole) {
    whole->embedding_error += weight * part.embedding_error;
    whole->orientation_score += weight * part.orientation_score;
    whole->curvature_mismatch += weight * part.curvature_mismatch;
    whole->normal_mismatch += weight * part.normal_mismatch;
    whole->descriptor_mismatch += weight * part.descriptor_mismatch;
    whole->stretch += weight * part.stretch;
    whole->landmark_contradiction += weight * part.landmark_contradiction;
    whole->rank_value += weight * part.rank_value;
  }

  void AddStages(const Part& x, const Part& y, const Correspondence& found) {
    for (std::size_t s = 0; s < found.stage_maps.size(); ++s) {
      if (s == result_.stage_maps.size()) {
        result_.stage_maps.push_back(
            {found.stage_maps[s].stage,
             VertexMap(mesh_x_.num_vertices(), kNoVertex)});
      }
      Place(x, y, found.stage_maps[s].y_from_x,
            &result_.stage_maps[s].y_from_x);
    }
  }

  /// Vertices of no pair, and those that coincide with others, take over what
  /// the nearest vertex of a pair has.
  absl::Status FollowNearest(const std::stop_token& stop) {
    VertexMap followers;
    VertexMap leaders;
    for (VertexIndex v = 0; v < mesh_x_.num_vertices(); ++v) {
      if (parts_x_.clean.clean_from_original[v] == kNoVertex) continue;
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
  const MeshParts& parts_x_;
  double total_ = 0;
  Correspondence result_;
  std::optional<Alternative> runner_up_;
};

}  // namespace

absl::StatusOr<MeshParts> SplitIntoParts(const TriangleMesh& mesh,
                                         const std::stop_token& stop) {
  MeshParts parts;
  ISOMATCH_ASSIGN_OR_RETURN(parts.clean, Clean(mesh, stop));
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  parts.components = ConnectedComponents(parts.clean.mesh);
  parts.large = LargeComponents(parts.clean.mesh, parts.components);
  parts.areas.assign(parts.large.size(), 0);
  for (VertexIndex f = 0; f < parts.clean.mesh.num_faces(); ++f) {
    const int component =
        parts.components.of_vertex[parts.clean.mesh.faces(f, 0)];
    const auto at =
        std::find(parts.large.begin(), parts.large.end(), component);
    if (at == parts.large.end()) continue;
    parts.areas[at - parts.large.begin()] += FaceArea(parts.clean.mesh, f);
  }
  return parts;
}

absl::StatusOr<std::vector<PartPair>> PairParts(
    const MeshParts& parts_x, const MeshParts& parts_y,
    absl::Span<const Landmark> landmarks, const std::stop_token& stop) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::vector<PartShape> shapes_x,
                            ShapesOf(parts_x, stop));
  ISOMATCH_ASSIGN_OR_RETURN(const std::vector<PartShape> shapes_y,
                            ShapesOf(parts_y, stop));
  // The last solve may have ended early.
  ISOMATCH_RETURN_IF_ERROR(CheckNotCancelled(stop));
  std::vector<std::tuple<double, int, int>> costs;
  for (int x = 0; x < static_cast<int>(shapes_x.size()); ++x) {
    for (int y = 0; y < static_cast<int>(shapes_y.size()); ++y) {
      double cost =
          std::abs(shapes_x[x].log_area - shapes_y[y].log_area) +
          std::abs(shapes_x[x].log_length - shapes_y[y].log_length) +
          kPlaceWeight * (shapes_x[x].place - shapes_y[y].place).norm();
      for (const Landmark& landmark : landmarks) {
        if (PartOf(parts_x, landmark.x) == x &&
            PartOf(parts_y, landmark.y) == y) {
          cost -= kLandmarkGain;
        }
      }
      costs.emplace_back(cost, x, y);
    }
  }
  std::sort(costs.begin(), costs.end());
  std::vector<char> taken_x(shapes_x.size(), false);
  std::vector<char> taken_y(shapes_y.size(), false);
  std::vector<PartPair> pairs;
  for (const auto& [cost, x, y] : costs) {
    if (taken_x[x] || taken_y[y]) continue;
    taken_x[x] = taken_y[y] = true;
    pairs.push_back({x, y});
  }
  std::sort(pairs.begin(), pairs.end(),
            [](const PartPair& a, const PartPair& b) { return a.x < b.x; });
  return pairs;
}

absl::StatusOr<Correspondence> MatchByParts(
    const TriangleMesh& mesh_x, const MeshParts& parts_x,
    const MeshParts& parts_y, absl::Span<const Landmark> landmarks,
    const MatchOne& match_one, const ProgressCallback& progress,
    const std::stop_token& stop) {
  ISOMATCH_RETURN_IF_ERROR(CheckOnFaces(parts_x, parts_y, landmarks));
  ISOMATCH_ASSIGN_OR_RETURN(const std::vector<PartPair> pairs,
                            PairParts(parts_x, parts_y, landmarks, stop));
  Merger merger(mesh_x, parts_x, parts_y, landmarks);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Part x = ExtractPart(parts_x, pairs[i].x);
    const Part y = ExtractPart(parts_y, pairs[i].y);
    std::vector<Landmark> own;
    std::vector<std::size_t> indices;
    for (std::size_t l = 0; l < landmarks.size(); ++l) {
      if (PartOf(parts_x, landmarks[l].x) != pairs[i].x ||
          PartOf(parts_y, landmarks[l].y) != pairs[i].y) {
        continue;
      }
      own.push_back(
          {x.part_from_clean[parts_x.clean.clean_from_original[landmarks[l].x]],
           y.part_from_clean[parts_y.clean
                                 .clean_from_original[landmarks[l].y]]});
      indices.push_back(l);
    }
    const auto part_progress = [&](const Progress& of_part) {
      if (!progress) return;
      Progress whole = of_part;
      whole.total_fraction = (double(i) + of_part.total_fraction) /
                             static_cast<double>(pairs.size());
      progress(whole);
    };
    ISOMATCH_ASSIGN_OR_RETURN(const Correspondence found,
                              match_one(x.mesh, y.mesh, own, part_progress));
    merger.Add(x, y, parts_x.areas[pairs[i].x], indices, found);
  }
  return merger.Finish(landmarks, stop);
}

}  // namespace isomatch
