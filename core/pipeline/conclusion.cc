#include "core/pipeline/conclusion.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/alignment/inverse_map.h"
#include "core/base/status_macros.h"
#include "core/pipeline/confidence.h"
#include "core/pipeline/counterpart_rule.h"
#include "core/pipeline/lifting.h"
#include "core/pipeline/quality_report.h"
#include "core/pipeline/user_numbering.h"
#include "core/spectral/functional_map.h"

namespace isomatch {
namespace {

/// A map of all solved vertices of one shape.
struct DenseImages {
  std::vector<SurfacePoint> points;  ///< empty without an alignment
  VertexMap vertices;
  std::vector<char> matched;  ///< empty: all
};

/// The solved vertex that stands for one of all.
VertexIndex SolvedVertex(const PreparedMesh& shape, VertexIndex v) {
  return shape.coarse ? NearestCorner(shape.coarse->working.mesh.faces,
                                      shape.coarse->embedding[v])
                      : v;
}

/// A mask of solved vertices for the user's, 0 on no face.
std::vector<char> UserMask(const PreparedMesh& shape,
                           const std::vector<char>& matched) {
  std::vector<char> mask;
  for (const VertexIndex v : shape.full.working_from_user) {
    mask.push_back(v != kNoVertex &&
                   (matched.empty() || matched[SolvedVertex(shape, v)]));
  }
  return mask;
}

class Conclusion {
 public:
  Conclusion(const FoundCandidates& found, const MatchOptions& options,
             const std::stop_token& stop, Correspondence* result)
      : found_(found),
        options_(options),
        stop_(stop),
        turned_(options.relation == Relation::kPartOfX),
        x_(*found.shapes[turned_ ? kY : kX]),
        y_(*found.shapes[turned_ ? kX : kY]),
        result_(*result) {}

  absl::Status Run() {
    DenseImages found = {{}, best().y_from_x, best().matched};
    if (found_.alignment != nullptr) {
      ISOMATCH_ASSIGN_OR_RETURN(found.points,
                                found_.alignment->PrecisePoints(stop_));
      if (found_.rule != nullptr) SmoothMask(&found.matched);
    }
    ISOMATCH_ASSIGN_OR_RETURN(
        std::vector<float> confidence,
        ReportQuality(first(), second(),
                      {found.vertices, found.points, best().filtered,
                       found_.offsets, found_.alignment, found.matched},
                      stop_, &result_.quality));
    if (options_.relation == Relation::kWhole) {
      result_.matched_y = UserMask(y_, {});
    } else {
      ISOMATCH_ASSIGN_OR_RETURN(InverseMap inverse, Inverse(found));
      result_.matched_y =
          UserMask(y_, turned_ ? found.matched : inverse.covered);
      if (turned_) {
        confidence = ConfidenceAt(inverse.points, confidence);
        found = TurnedAround(std::move(inverse));
        result_.quality.coverage = 1;
      }
    }
    ISOMATCH_RETURN_IF_ERROR(ReportMap(found));
    ReportLandmarks();
    ReportConfidence(found, std::move(confidence));
    ISOMATCH_RETURN_IF_ERROR(ReportCandidates());
    ReportShapes();
    return absl::OkStatus();
  }

 private:
  const PreparedMesh& first() const { return *found_.shapes[kX]; }
  const PreparedMesh& second() const { return *found_.shapes[kY]; }
  const Candidate& best() const { return found_.candidates.front(); }
  bool decimated() const { return x_.coarse || y_.coarse; }

  void SmoothMask(std::vector<char>* matched) {
    told_ = *matched;
    found_.rule->Smooth(*found_.alignment, matched);
  }

  /// Where the second shape's solved vertices lie on the first.
  absl::StatusOr<InverseMap> Inverse(const DenseImages& images) const {
    const WorkingMesh& laid = first().solved();
    const WorkingMesh& ground = second().solved();
    Positions places = ground.mesh.positions(images.vertices, Eigen::all);
    for (std::size_t v = 0; v < images.points.size(); ++v) {
      places.row(static_cast<Eigen::Index>(v)) =
          PositionOf(ground.mesh, images.points[v]);
    }
    return InvertMap(
        {laid.mesh, first().laplacian.mass, places, images.matched},
        {ground.mesh, ground.stars, second().laplacian.mass, ground.normals,
         laid.oriented && ground.oriented},
        stop_);
  }

  DenseImages TurnedAround(InverseMap inverse) const {
    DenseImages images = {
        std::move(inverse.points), {}, std::move(inverse.covered)};
    for (const SurfacePoint& point : images.points) {
      images.vertices.push_back(
          NearestCorner(first().solved().mesh.faces, point));
    }
    return images;
  }

  /// The first shape's confidence at points of it.
  std::vector<float> ConfidenceAt(const std::vector<SurfacePoint>& points,
                                  const std::vector<float>& confidence) const {
    const Eigen::Map<const Eigen::VectorXf> values(
        confidence.data(), static_cast<Eigen::Index>(confidence.size()));
    std::vector<float> at;
    at.reserve(points.size());
    for (const SurfacePoint& point : points) {
      at.push_back(static_cast<float>(Interpolated(values.cast<double>().eval(),
                                                   first().solved().mesh.faces,
                                                   point)[0]));
    }
    return at;
  }

  /// A map in the user's numbering. `points`: empty for `vertices`.
  absl::Status ToUser(const DenseImages& images,
                      absl::Span<const VertexMatch> landmarks, VertexMap* map,
                      std::vector<PrecisePoint>* precise) const {
    if (decimated()) {
      ISOMATCH_ASSIGN_OR_RETURN(
          const LiftedMap lifted,
          LiftMap(x_, y_,
                  images.points.empty()
                      ? PointsAtVertices(y_.solved(), images.vertices)
                      : images.points,
                  landmarks, stop_));
      *map = ToUserMap(x_.full, y_.full, lifted.y_from_x);
      Mask(images.matched, map);
      if (precise != nullptr) {
        ISOMATCH_ASSIGN_OR_RETURN(
            *precise,
            ToUserPoints(x_.full, y_.full, lifted.points, *map, stop_));
      }
      return absl::OkStatus();
    }
    *map = ToUserMap(x_.full, y_.full, images.vertices);
    Mask(images.matched, map);
    if (precise != nullptr) {
      ISOMATCH_ASSIGN_OR_RETURN(
          *precise, ToUserPoints(x_.full, y_.full, images.points, *map, stop_));
    }
    return absl::OkStatus();
  }

  /// `matched`: of X's solved vertices, empty for all.
  void Mask(const std::vector<char>& matched, VertexMap* map) const {
    if (matched.empty()) return;
    const std::vector<char> mask = UserMask(x_, matched);
    for (std::size_t v = 0; v < mask.size(); ++v) {
      if (!mask[v]) (*map)[v] = kNoVertex;
    }
  }

  absl::Status ReportMap(const DenseImages& images) {
    std::vector<VertexMatch> kept;
    for (std::size_t i = 0; i < found_.landmarks.size(); ++i) {
      if (!result_.landmarks[i].kept) continue;
      const VertexMatch landmark = UserLandmark(i);
      kept.push_back({x_.full.working_from_user[landmark.x],
                      y_.full.working_from_user[landmark.y]});
    }
    ISOMATCH_RETURN_IF_ERROR(
        ToUser(images, kept, &result_.y_from_x, &result_.precise));
    return absl::OkStatus();
  }

  /// `confidence`: of X's solved vertices. Next to those without a counterpart
  /// it falls: whether there is one is not known exactly. The mean leaves out
  /// what a smooth mask alone matches.
  void ReportConfidence(const DenseImages& images,
                        std::vector<float> confidence) {
    if (!images.matched.empty()) {
      const std::vector<float> mask(images.matched.begin(),
                                    images.matched.end());
      const std::vector<double> inside =
          Smoothed(mask, x_.solved().stars, kRimSmoothings);
      for (std::size_t v = 0; v < confidence.size(); ++v) {
        confidence[v] *= static_cast<float>(inside[v]);
      }
    }
    result_.confidence = UserConfidence(x_, confidence);
    for (std::size_t v = 0; v < result_.y_from_x.size(); ++v) {
      if (result_.y_from_x[v] == kNoVertex) result_.confidence[v] = 0;
    }
    // Kept where all around has none: known, if nothing else is.
    for (std::size_t i = 0; i < found_.landmarks.size(); ++i) {
      float& known = result_.confidence[UserLandmark(i).x];
      if (result_.landmarks[i].kept && !(known > 0)) known = 1;
    }
    result_.quality.mean_confidence = MeanOfTold();
    result_.quality.unmatched = static_cast<int>(std::count(
        result_.y_from_x.begin(), result_.y_from_x.end(), kNoVertex));
  }

  double MeanOfTold() const {
    if (told_.empty()) {
      return MeanConfidence(result_.confidence, result_.y_from_x);
    }
    VertexMap counted = result_.y_from_x;
    Mask(told_, &counted);
    return MeanConfidence(result_.confidence, counted);
  }

  /// One of the user's, from X to Y.
  VertexMatch UserLandmark(std::size_t index) const {
    const auto& [first, second] = found_.landmarks[index];
    return turned_ ? VertexMatch{second, first} : VertexMatch{first, second};
  }

  /// Where landmarks went in the end. Vertices that coincide after cleaning
  /// have one image; a kept landmark names its own.
  void ReportLandmarks() {
    int changed = 0;
    for (std::size_t i = 0; i < found_.landmarks.size(); ++i) {
      LandmarkOutcome& outcome = result_.landmarks[i];
      const auto [x, y] = UserLandmark(i);
      if (outcome.kept) {
        result_.y_from_x[x] = y;
        result_.precise[x] = {{y, y, y}, {1, 0, 0}};
      }
      outcome.y_found = result_.y_from_x[x];
      changed += !outcome.kept;
    }
    if (changed > 0) {
      result_.warnings.push_back(
          absl::StrCat(changed, " of ", found_.landmarks.size(),
                       " landmarks contradict the rest and were not kept"));
    }
  }

  absl::Status ReportCandidates() {
    for (const VertexMatch& match : best().sparse) {
      const VertexIndex a = first().solved().user_from_working[match.x];
      const VertexIndex b = second().solved().user_from_working[match.y];
      result_.sparse_matches.push_back(turned_ ? VertexMatch{b, a}
                                               : VertexMatch{a, b});
    }
    result_.objective = best().objective;
    result_.scores = best().scores;
    for (std::size_t i = 1; i < found_.candidates.size(); ++i) {
      const Candidate& candidate = found_.candidates[i];
      DenseImages images = {{}, candidate.y_from_x, candidate.matched};
      if (turned_) {
        ISOMATCH_ASSIGN_OR_RETURN(InverseMap inverse, Inverse(images));
        images = TurnedAround(std::move(inverse));
      }
      result_.alternatives.push_back({{}, candidate.scores});
      ISOMATCH_RETURN_IF_ERROR(
          ToUser(images, {}, &result_.alternatives.back().y_from_x, nullptr));
    }
    result_.symmetry_confidence =
        SymmetryConfidence(options_, found_.candidates);
    return absl::OkStatus();
  }

  void ReportFunctionalMap() {
    const SpectralBasis& from = first().spectral;
    const SpectralBasis& to = second().spectral;
    if (!options_.keep_functional_map || from.size() == 0) return;
    const int k = std::min(from.size(), to.size());
    VertexMap map = best().y_from_x;
    for (std::size_t v = 0; v < best().matched.size(); ++v) {
      if (!best().matched[v]) map[v] = kNoVertex;
    }
    result_.functional_map = FunctionalMapFromVertexMap(from, to, map, k);
    // What carries a part's functions to the whole, 0 where the part is not.
    if (turned_) result_.functional_map.transposeInPlace();
    result_.eigenvalues_x = x_.spectral.eigenvalues.head(k);
    result_.eigenvalues_y = y_.spectral.eigenvalues.head(k);
  }

  void ReportShapes() {
    ReportFunctionalMap();
    result_.relation = options_.relation;
    if (options_.scale == LengthScale::kAuto) {
      result_.scale = std::sqrt(y_.full.area / x_.full.area) *
                      (turned_ ? 1 / found_.scale : found_.scale);
    }
    result_.area_x = x_.full.area;
    result_.area_y = y_.full.area;
    result_.warnings_x = x_.full.warnings;
    result_.warnings_y = y_.full.warnings;
    if (result_.scores.orientation_score < 0) {
      result_.warnings.push_back(
          absl::StrCat("the map is probably mirrored: orientation score ",
                       result_.scores.orientation_score));
    }
    if (options_.keep_stage_maps) {
      result_.stage_maps.push_back({Stage::kQuality, result_.y_from_x});
    }
  }

  /// Averages over one-rings of the mask.
  static constexpr int kRimSmoothings = 3;

  const FoundCandidates& found_;
  const MatchOptions& options_;
  const std::stop_token& stop_;
  const bool turned_;  ///< the first shape is Y
  /// Of overlaps: the mask before it was smoothed.
  std::vector<char> told_;
  const PreparedMesh& x_;
  const PreparedMesh& y_;
  Correspondence& result_;
};

}  // namespace

absl::Status Conclude(const FoundCandidates& found, const MatchOptions& options,
                      const std::stop_token& stop, Correspondence* result) {
  return Conclusion(found, options, stop, result).Run();
}

}  // namespace isomatch
