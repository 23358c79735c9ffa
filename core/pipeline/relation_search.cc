#include "core/pipeline/relation_search.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stop_token>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "core/base/status_macros.h"
#include "core/mesh/mesh_geometry.h"
#include "core/mesh/topology.h"
#include "core/pipeline/stage_plan.h"

namespace isomatch {
namespace {

/// A shorter rim is an eye or a mouth, not a cut.
constexpr double kShortRim = 0.35;
/// Areas of whole shapes in one unit differ by less than this factor, and a
/// part is larger than the whole by less than that one.
constexpr double kSameArea = 1.5;
constexpr double kLargerPart = 1.25;
/// A whole map that is as confident, and covers as much of Y, needs no
/// comparison, unless areas in one unit differ by more than this factor.
constexpr double kSurelyWhole = 0.72;
constexpr double kAllCovered = 0.97;
constexpr double kEqualArea = 1.2;
/// What is less confident is looked for again: an overlap with other random
/// seeds, a part of unknown scale at the next scale, then with another seed.
constexpr double kSureOverlap = 0.66;
constexpr double kSureScale = 0.58;
constexpr int kMoreTries = 2;
/// Confidence that other random seeds rarely add to an overlap.
constexpr double kMostGain = 0.1;
/// How much less confident a map of wholes may be, which leaves nothing out.
constexpr double kWholeBonus = 0.04;
/// How much more confident a map of a part is, right or wrong, than one of an
/// overlap: it ends less stiff, and nearer to the other shape.
constexpr double kPartSurplus = 0.015;
/// Confidence by which a relation that is sure leads.
constexpr double kSureLead = 0.1;

bool HasRim(const ShapeOutline& shape) { return shape.rim > kShortRim; }

double ScoreOf(const Correspondence& found) {
  const double confidence = found.quality.mean_confidence;
  if (found.relation == Relation::kWhole) return confidence + kWholeBonus;
  if (found.relation == Relation::kOverlap) return confidence;
  return confidence - kPartSurplus;
}

/// Relations in the order in which they are tried.
struct RelationOrder {
  std::vector<Relation> likely;
  /// Where none of the others gives a map that is not bad.
  std::vector<Relation> unlikely;
  bool may_be_surely_whole = true;
};

RelationOrder OrderOf(const ShapeOutline& x, const ShapeOutline& y,
                      const MatchOptions& options) {
  if (options.relation != Relation::kAuto) return {{options.relation}, {}};
  if (!HasRim(x) && !HasRim(y)) return {{Relation::kWhole}, {}};
  if (!HasRim(y)) return {{Relation::kPartOfY}, {Relation::kWhole}};
  if (!HasRim(x)) return {{Relation::kPartOfX}, {Relation::kWhole}};
  RelationOrder order;
  const bool known = options.scale == LengthScale::kSame;
  const double ratio = x.area / y.area;
  const double unlike = std::max(ratio, 1 / ratio);
  order.may_be_surely_whole = !known || unlike < kEqualArea;
  const auto add = [&](Relation relation, bool is_likely) {
    (is_likely || !known ? order.likely : order.unlikely).push_back(relation);
  };
  add(Relation::kWhole, unlike < kSameArea);
  add(Relation::kPartOfY, ratio < kLargerPart);
  add(Relation::kPartOfX, 1 / ratio < kLargerPart);
  add(Relation::kOverlap, true);
  return order;
}

/// Options as which a relation is tried.
MatchOptions OptionsAs(Relation relation, const MatchOptions& options) {
  MatchOptions chosen = options;
  chosen.relation = relation;
  if (options.relation == relation) return chosen;
  if (relation == Relation::kWhole) chosen.scale = LengthScale::kAuto;
  if (relation == Relation::kOverlap) chosen.scale = LengthScale::kSame;
  return chosen;
}

/// Share of the work that is over when two shapes are prepared.
double PreparedShare(const MatchOptions& options) {
  double prepared = 0;
  double all = 0;
  for (const auto& [stage, weight] : StagePlan(options)) {
    if (stage < Stage::kSeeds) prepared += weight;
    all += weight;
  }
  return prepared / all;
}

/// Makes one series of the reports of several matches: the preparation is
/// reported once, and each match has an equal share of the rest.
class JoinedTries {
 public:
  JoinedTries(const ProgressCallback& progress, int tries)
      : progress_(progress), tries_(tries) {}

  /// `options`: those of the match.
  ProgressCallback OfNext(const MatchOptions& options) {
    const int number = number_++;
    const double prepared = PreparedShare(options);
    if (number == 0) prepared_ = prepared;
    return [this, number, prepared](Progress report) {
      if (!progress_ || (number > 0 && report.stage < Stage::kSeeds)) return;
      if (tries_ > 1 && report.stage >= Stage::kSeeds) {
        const double of_match =
            std::max(0.0, report.total_fraction - prepared) / (1 - prepared);
        report.total_fraction =
            prepared_ + (1 - prepared_) * (number + of_match) / tries_;
      }
      report.has_map = has_map_ = has_map_ || report.has_map;
      // Components are prepared one after the other.
      told_ = report.total_fraction = std::max(told_, report.total_fraction);
      progress_(report);
    };
  }

  void Finish() {
    if (progress_ && told_ < 1) progress_({Stage::kQuality, 1, 1, true});
  }

 private:
  const ProgressCallback& progress_;
  const int tries_;
  double prepared_ = 0;  ///< share of the first match
  int number_ = 0;
  double told_ = 0;
  bool has_map_ = false;  ///< of whatever try
};

bool IsSurelyWhole(const Correspondence& found) {
  return found.relation == Relation::kWhole && !found.ended_early &&
         found.quality.mean_confidence >= kSurelyWhole &&
         found.quality.coverage >= kAllCovered;
}

/// Of two maps of one relation. Overlaps, in one unit, compare by the rank
/// value that chose each among those of its seed, unless one alone is bad.
bool FitsBetter(const Correspondence& a, const Correspondence& b) {
  if (a.relation != Relation::kOverlap) {
    return a.quality.mean_confidence > b.quality.mean_confidence;
  }
  const bool a_is_bad = a.verdict.level == VerdictLevel::kBad;
  const bool b_is_bad = b.verdict.level == VerdictLevel::kBad;
  if (a_is_bad != b_is_bad) return b_is_bad;
  return a.scores.rank_value < b.scores.rank_value;
}

/// Keeps the best of what is found.
class RelationSearch {
 public:
  RelationSearch(const MatchOptions& options, bool may_be_surely_whole,
                 const MatchAs& match, const MatchControl& control,
                 JoinedTries* joined)
      : options_(options),
        may_be_surely_whole_(may_be_surely_whole),
        match_(match),
        control_(control),
        joined_(*joined) {}

  /// Tries them in turn, until one is sure. Errors of which one can be due to
  /// the relation alone are kept for later.
  absl::Status Try(const std::vector<Relation>& relations) {
    for (const Relation relation : relations) {
      if (is_sure_ || IsCut(best_.has_value())) return absl::OkStatus();
      absl::StatusOr<Correspondence> found = BestOf(relation);
      if (absl::IsFailedPrecondition(found.status())) {
        failure_.Update(found.status());
      } else if (!found.ok()) {
        return found.status();
      } else {
        Compare(*std::move(found));
      }
    }
    return absl::OkStatus();
  }

  bool has_one_not_bad() const { return has_one_not_bad_; }

  /// Nothing else could be.
  void SetSure() { is_sure_ = true; }

  absl::StatusOr<Correspondence> Result() && {
    if (!best_) return failure_;
    const bool is_bad = best_->verdict.level == VerdictLevel::kBad;
    const double lead = (ScoreOf(*best_) - next_) / kSureLead;
    best_->relation_confidence = is_sure_ ? 1
                                 : is_bad || is_cut_
                                     ? 0
                                     : std::clamp(lead, 0.0, 1.0);
    best_->ended_early = best_->ended_early || is_cut_;
    if (options_.scale == LengthScale::kSame) best_->scale = 1;
    if (best_->relation == Relation::kOverlap &&
        options_.scale == LengthScale::kAuto) {
      best_->warnings.emplace_back(
          "taken to have one unit: what two parts have in common does not tell "
          "it");
    }
    best_->verdict = VerdictOf(*best_);
    return *std::move(best_);
  }

 private:
  /// Whether no more is tried, given that there is a map.
  bool IsCut(bool has_map) {
    is_cut_ = is_cut_ || (has_map && control_.hurry.stop_requested());
    return is_cut_;
  }

  /// Where there is a map already, a hurry ends it with FAILED_PRECONDITION.
  absl::StatusOr<Correspondence> MatchOnce(const MatchOptions& options,
                                           bool has_map) {
    MatchControl control = control_.With(joined_.OfNext(options));
    if (!has_map) return match_(options, control);
    const EitherStop ends({control_.stop, control_.hurry});
    control.stop = ends.token();
    control.hurry = {};
    absl::StatusOr<Correspondence> found = match_(options, control);
    if (!absl::IsCancelled(found.status()) || control_.stop.stop_requested()) {
      return found;
    }
    IsCut(true);
    return absl::FailedPreconditionError("there was no time for it");
  }

  /// Whether another try may find a better map, and one that wins.
  bool IsWorthMore(const absl::StatusOr<Correspondence>& found) const {
    if (!found.ok()) return absl::IsFailedPrecondition(found.status());
    if (found->relation != Relation::kOverlap) {
      return found->quality.mean_confidence < kSureScale;
    }
    return found->quality.mean_confidence < kSureOverlap &&
           (!best_ || ScoreOf(*found) + kMostGain > ScoreOf(*best_));
  }

  absl::StatusOr<Correspondence> BestOf(Relation relation) {
    MatchOptions options = OptionsAs(relation, options_);
    absl::StatusOr<Correspondence> best = MatchOnce(options, best_.has_value());
    // A part without a map has none at another scale.
    const bool may_be_better = best.ok() || relation == Relation::kOverlap;
    const int more = may_be_better && options.IsTriedAgain() ? kMoreTries : 0;
    for (int i = 0; i < more && IsWorthMore(best) && !IsCut(best.ok() || best_);
         ++i) {
      const bool at_next_scale = relation != Relation::kOverlap && i == 0;
      options.next_scale = at_next_scale;
      if (!at_next_scale) ++options.random_seed;
      absl::StatusOr<Correspondence> other =
          MatchOnce(options, best.ok() || best_);
      if (absl::IsFailedPrecondition(other.status())) continue;
      if (!other.ok() || !best.ok() || FitsBetter(*other, *best)) {
        best = std::move(other);
      }
    }
    return best;
  }

  void Compare(Correspondence found) {
    has_one_not_bad_ =
        has_one_not_bad_ || found.verdict.level != VerdictLevel::kBad;
    is_sure_ = is_sure_ || (may_be_surely_whole_ && IsSurelyWhole(found));
    const double score = ScoreOf(found);
    if (best_ && score <= ScoreOf(*best_)) {
      next_ = std::max(next_, score);
      return;
    }
    if (best_) next_ = ScoreOf(*best_);
    best_ = std::move(found);
  }

  const MatchOptions& options_;
  const bool may_be_surely_whole_;
  const MatchAs& match_;
  const MatchControl& control_;
  JoinedTries& joined_;
  std::optional<Correspondence> best_;
  double next_ = 0;  ///< score of the second best
  bool is_sure_ = false;
  bool has_one_not_bad_ = false;
  bool is_cut_ = false;  ///< there was no time for all
  absl::Status failure_;
};

}  // namespace

ShapeOutline OutlineOf(const TriangleMesh& mesh) {
  const EdgeFaces edges(mesh.faces);
  ShapeOutline outline;
  outline.area = SurfaceArea(mesh);
  for (VertexIndex f = 0; f < mesh.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      if (!edges.IsBoundary(f, corner)) continue;
      outline.rim += (mesh.positions.row(mesh.faces(f, corner)) -
                      mesh.positions.row(mesh.faces(f, (corner + 1) % 3)))
                         .norm();
    }
  }
  outline.rim /= std::sqrt(outline.area);
  return outline;
}

int MostTries(const ShapeOutline& x, const ShapeOutline& y,
              const MatchOptions& options) {
  const RelationOrder order = OrderOf(x, y, options);
  int tries = 0;
  for (const auto* relations : {&order.likely, &order.unlikely}) {
    for (const Relation relation : *relations) {
      tries += 1;
      if (OptionsAs(relation, options).IsTriedAgain()) tries += kMoreTries;
    }
  }
  return tries;
}

absl::StatusOr<Correspondence> FindRelation(const ShapeOutline& x,
                                            const ShapeOutline& y,
                                            const MatchOptions& options,
                                            const MatchControl& control,
                                            const MatchAs& match) {
  const RelationOrder order = OrderOf(x, y, options);
  JoinedTries joined(control.progress, MostTries(x, y, options));
  RelationSearch search(options, order.may_be_surely_whole, match, control,
                        &joined);
  ISOMATCH_RETURN_IF_ERROR(search.Try(order.likely));
  if (!search.has_one_not_bad()) {
    ISOMATCH_RETURN_IF_ERROR(search.Try(order.unlikely));
  }
  if (order.likely.size() == 1 &&
      (order.unlikely.empty() || search.has_one_not_bad())) {
    search.SetSure();
  }
  absl::StatusOr<Correspondence> result = std::move(search).Result();
  if (result.ok()) joined.Finish();
  return result;
}

}  // namespace isomatch
