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
/// What is less confident is looked for again: with other random seeds, a part
/// of unknown scale at the next scale first.
constexpr double kSureOverlap = 0.66;
constexpr double kSurePart = 0.58;
constexpr int kMoreTries = 2;
/// Share of what is left to tell that matches have which others may follow: few
/// do.
constexpr double kShareOfFirst = 0.75;
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

/// How often a relation may be looked for again. A part in one unit is only
/// where nothing else is likely: a map that is not confident loses against
/// others sooner than another seed makes it win.
int MostMoreTries(const MatchOptions& options, bool is_alone) {
  if (!options.IsTriedAgain()) return 0;
  const bool may_win = is_alone || options.relation == Relation::kOverlap ||
                       options.scale == LengthScale::kAuto;
  return may_win ? kMoreTries : 0;
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
/// reported once, then what is matched for sure has most of the rest.
class JoinedTries {
 public:
  explicit JoinedTries(const ProgressCallback& progress)
      : progress_(progress) {}

  /// The next matches are of so many relations; unless they are the last ones,
  /// others may follow.
  void NextRelations(std::size_t count, bool is_last) {
    end_of_relation_ = end_of_relations_;
    const double share = ShareOf(end_of_relation_, 1, is_last);
    end_of_relations_ += share;
    share_of_relation_ = share / static_cast<double>(count);
  }

  /// The next matches are of one of them.
  void NextRelation() {
    begin_of_try_ = end_of_relation_;
    end_of_relation_ += share_of_relation_;
  }

  /// `options`: those of the match.
  ProgressCallback OfNext(const MatchOptions& options, bool is_last) {
    const bool is_first = std::exchange(is_first_, false);
    const double prepared = PreparedShare(options);
    if (is_first) prepared_ = prepared;
    const double begin = begin_of_try_;
    const double share = ShareOf(begin, end_of_relation_, is_last);
    begin_of_try_ = begin + share;
    return [this, is_first, prepared, begin, share](Progress report) {
      if (!progress_ || (!is_first && report.stage < Stage::kSeeds)) return;
      if (report.stage >= Stage::kSeeds) {
        const double of_match =
            std::max(0.0, report.total_fraction - prepared) / (1 - prepared);
        report.total_fraction =
            prepared_ + (1 - prepared_) * (begin + share * of_match);
      }
      report.has_map = has_map_ = has_map_ || report.has_map;
      // Components are prepared one after the other.
      told_ = report.total_fraction =
          std::max(told_, std::min(1.0, report.total_fraction));
      progress_(report);
    };
  }

  void Finish() {
    if (progress_ && told_ < 1) progress_({Stage::kQuality, 1, 1, true});
  }

 private:
  static double ShareOf(double begin, double end, bool is_last) {
    return (is_last ? 1 : kShareOfFirst) * (end - begin);
  }

  const ProgressCallback& progress_;
  double prepared_ = 0;  ///< share of the first match
  bool is_first_ = true;
  // Of what follows the preparation.
  double begin_of_try_ = 0;
  double end_of_relation_ = 0;
  double share_of_relation_ = 1;
  double end_of_relations_ = 0;
  double told_ = 0;
  bool has_map_ = false;  ///< of whatever try
};

bool IsSurelyWhole(const Correspondence& found) {
  return found.relation == Relation::kWhole && !found.ended_early &&
         found.quality.mean_confidence >= kSurelyWhole &&
         found.quality.coverage >= kAllCovered;
}

/// Of two maps of one relation. In one unit they compare by the rank value that
/// chose each among those of its seed, which two scales do not share: a
/// mirrored map may be more confident, and a right one of a part be called bad.
/// Of overlaps one that alone is bad loses.
bool FitsBetter(const Correspondence& a, const Correspondence& b,
                const MatchOptions& options) {
  if (a.relation == Relation::kOverlap) {
    const bool a_is_bad = a.verdict.level == VerdictLevel::kBad;
    const bool b_is_bad = b.verdict.level == VerdictLevel::kBad;
    if (a_is_bad != b_is_bad) return b_is_bad;
  } else if (options.scale == LengthScale::kAuto) {
    return a.quality.mean_confidence > b.quality.mean_confidence;
  }
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
      absl::StatusOr<Correspondence> found =
          BestOf(relation, /*is_alone=*/relations.size() == 1);
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
                                           bool has_map, bool is_last) {
    MatchControl control = control_.With(joined_.OfNext(options, is_last));
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
      return found->quality.mean_confidence < kSurePart;
    }
    return found->quality.mean_confidence < kSureOverlap &&
           (!best_ || ScoreOf(*found) + kMostGain > ScoreOf(*best_));
  }

  absl::StatusOr<Correspondence> BestOf(Relation relation, bool is_alone) {
    MatchOptions options = OptionsAs(relation, options_);
    const int more = MostMoreTries(options, is_alone);
    joined_.NextRelation();
    absl::StatusOr<Correspondence> best =
        MatchOnce(options, best_.has_value(), /*is_last=*/more == 0);
    // A part without a map has none at another scale.
    if (!best.ok() && relation != Relation::kOverlap) return best;
    for (int i = 0; i < more && IsWorthMore(best) && !IsCut(best.ok() || best_);
         ++i) {
      options.next_scale = i == 0 && relation != Relation::kOverlap &&
                           options.scale == LengthScale::kAuto;
      if (!options.next_scale) ++options.random_seed;
      absl::StatusOr<Correspondence> other =
          MatchOnce(options, best.ok() || best_, /*is_last=*/i + 1 == more);
      if (absl::IsFailedPrecondition(other.status())) continue;
      if (!other.ok() || !best.ok() || FitsBetter(*other, *best, options)) {
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
      tries += 1 + MostMoreTries(OptionsAs(relation, options),
                                 /*is_alone=*/relations->size() == 1);
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
  JoinedTries joined(control.progress);
  RelationSearch search(options, order.may_be_surely_whole, match, control,
                        &joined);
  joined.NextRelations(order.likely.size(), order.unlikely.empty());
  ISOMATCH_RETURN_IF_ERROR(search.Try(order.likely));
  if (!search.has_one_not_bad() && !order.unlikely.empty()) {
    joined.NextRelations(order.unlikely.size(), /*is_last=*/true);
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
