#include "core/matching/first_stage.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>
#include <utility>

#include "core/base/mutex.h"
#include "core/base/parallel.h"
#include "core/base/random_stream.h"
#include "core/base/status_macros.h"
#include "core/matching/objective.h"

namespace isomatch {
namespace {

/// Points of X's pool by whose images maps are told apart.
constexpr int kProbes = 50;
/// Two maps send a probe to different places when those are further apart, in
/// sqrt(area), and are distinct when they do so with more than this fraction of
/// the probes. Noise of a map is well below the one, half a limb above the
/// other.
constexpr float kOtherPlace = 0.25f;
constexpr double kDistinctFraction = 0.1;
/// The same for unfinished maps, which are noisier.
constexpr double kGroupFraction = 0.3;
/// Maps of fewer matches are not grouped.
constexpr int kDiverseFrom = 40;
/// No group fills more than one part in this many of a round.
constexpr std::size_t kSharesOfAGroup = 4;

/// Times mirrored regions are grown anew, and the orientation score from which
/// there are none worth it.
constexpr int kRegrowths = 3;
constexpr double kWellOriented = 0.9;
/// Landmarks by which maps are judged; more tell no more.
constexpr std::size_t kMaxLandmarkProbes = 50;
/// Logarithm of LandmarkPenalty of a map that contradicts all landmarks. Such a
/// map must be three times better otherwise: symmetric images differ by less,
/// maps bent to a wrong landmark by more.
constexpr double kPenaltyRate = 1.1;

/// Difference of fractions of landmarks that counts.
constexpr double kClearly = 0.25;
/// Added where a penalty multiplies, so that it counts for perfect maps too.
constexpr double kPerfectBadness = 1e-3;

/// A competing partial map between rounds: only what is needed to go on.
struct Contender {
  std::size_t seed;  ///< index, for ties and for the random stream
  std::vector<PointMatch> matches;
  std::vector<int> images;  ///< of the probes, once it is complete
  /// Mirrored; or not mirrored, where the landmarks want it so.
  bool wrong_side = false;
  double contradiction = 0;
  double own_badness = 0;  ///< without landmarks
  double badness = 0;      ///< smaller is better
};

bool Better(const Contender& a, const Contender& b) {
  return std::tie(a.wrong_side, a.badness, a.seed) <
         std::tie(b.wrong_side, b.badness, b.seed);
}

double PhaseTemperature(const FirstStageOptions& options) {
  return options.swapping == Swapping::kAnnealed ? options.temperature : 0;
}

/// Swaps and relocations between insertions.
void Improve(const FirstStageOptions& options, double temperature,
             RandomStream* random, Matching* matching) {
  if (options.swapping == Swapping::kNone) return;
  SwapPhase(options.swaps, temperature, random, matching);
  if (options.relocation_neighbors > 0) {
    RelocationSweep(options.relocation_neighbors, matching);
  }
}

Matching Restore(const FirstStageInput& input,
                 const std::vector<PointMatch>& matches, int capacity,
                 int pinned) {
  Matching matching(input.pool_x, input.pool_y,
                    std::max<int>(capacity, matches.size()), input.costs);
  for (const PointMatch& match : matches) matching.Add(match);
  matching.Pin(pinned);
  return matching;
}

/// Smaller is better. A product, so that neither factor's unit matters.
double Badness(const FirstStageInput& input, const FirstStageOptions& options,
               bool complete, const Matching& matching) {
  if (options.selection == Selection::kObjective) return -Objective(matching);
  const double error = EmbeddingError(matching);
  if (!complete || options.curvature_weight == 0) return error;
  return error *
         std::pow(CurvatureMismatch(matching, input.frames_x, input.frames_y),
                  options.curvature_weight);
}

/// About where a map sends a point of X, matched or not: the place on Y with
/// the least Eq. 8.
int ImageOf(const FirstStageOptions& options, const Matching& matching, int x,
            std::vector<float>* errors) {
  const int all = matching.pool(kY).size();
  const int places = options.places > 0 ? std::min(options.places, all) : all;
  matching.EmbeddingErrors(kX, x, places, errors);
  return LeastOf(*errors);
}

float DistanceBetween(const PointPool& pool, int a, int b) {
  return pool.closeness().basis().LowerBound(pool.vertex(a), pool.vertex(b));
}

/// Fraction of the landmarks that the map sends to another place.
double Contradiction(const FirstStageOptions& options,
                     const Matching& matching) {
  if (options.landmarks.empty()) return 0;
  const std::size_t count =
      std::min(kMaxLandmarkProbes, options.landmarks.size());
  int contradicted = 0;
  std::vector<float> errors;
  for (std::size_t i = 0; i < count; ++i) {
    const PointMatch& landmark =
        options.landmarks[i * options.landmarks.size() / count];
    const int found = ImageOf(options, matching, landmark.x, &errors);
    contradicted +=
        DistanceBetween(matching.pool(kY), found, landmark.y) > kOtherPlace;
  }
  return double(contradicted) / static_cast<double>(count);
}

void Judge(const FirstStageInput& input, const FirstStageOptions& options,
           const Matching& matching, Contender* contender) {
  contender->matches = matching.Matches();
  const bool complete = matching.size() >= options.matches;
  contender->badness = Badness(input, options, complete, matching);
  contender->wrong_side =
      options.orientation_from > 0 &&
      matching.size() >= options.orientation_from &&
      OrientationScore(matching, input.frames_x, input.frames_y) < 0;
  if (options.landmarks.empty()) return;
  contender->contradiction = Contradiction(options, matching);
  contender->own_badness = contender->badness;
  const double penalty = LandmarkPenalty(contender->contradiction);
  contender->badness = contender->badness < 0
                           ? contender->badness / penalty
                           : (contender->badness + kPerfectBadness) * penalty;
}

/// Whether the landmarks speak for the mirror image: the mirrored map that is
/// best without them contradicts clearly fewer of them than the unmirrored one.
/// `before` where there are not both.
bool LandmarksWantMirror(const std::vector<Contender>& contenders,
                         bool before) {
  const Contender* best[2] = {nullptr, nullptr};
  for (const Contender& contender : contenders) {
    const Contender*& other = best[contender.wrong_side];
    if (other == nullptr || contender.own_badness < other->own_badness) {
      other = &contender;
    }
  }
  if (best[0] == nullptr || best[1] == nullptr) return before;
  return best[1]->contradiction + kClearly < best[0]->contradiction;
}

std::vector<int> ImagesOfProbes(const FirstStageOptions& options,
                                const Matching& matching) {
  std::vector<int> images;
  std::vector<float> errors;
  const int probes = std::min(kProbes, matching.pool(kX).size());
  images.reserve(static_cast<std::size_t>(probes));
  for (int x = 0; x < probes; ++x) {
    images.push_back(ImageOf(options, matching, x, &errors));
  }
  return images;
}

bool Distinct(const PointPool& pool_y, const Contender& a, const Contender& b,
              double fraction) {
  int moved = 0;
  const std::size_t probes = std::min(a.images.size(), b.images.size());
  for (std::size_t i = 0; i < probes; ++i) {
    moved += DistanceBetween(pool_y, a.images[i], b.images[i]) > kOtherPlace;
  }
  return moved > fraction * static_cast<double>(probes);
}

/// Drops contenders that have become what a better one is: from the same
/// matches on they would hardly differ again.
void DropRepeated(std::vector<Contender>* ranked) {
  std::set<std::vector<std::pair<int, int>>> seen;
  std::vector<Contender> kept;
  for (Contender& contender : *ranked) {
    std::vector<std::pair<int, int>> sorted;
    for (const auto& [x, y] : contender.matches) sorted.emplace_back(x, y);
    std::sort(sorted.begin(), sorted.end());
    if (seen.insert(std::move(sorted)).second) {
      kept.push_back(std::move(contender));
    }
  }
  *ranked = std::move(kept);
}

/// Keeps the best `keep` of the ranked contenders, but of those that send the
/// shape to about the same place only a share, so that a symmetric image that
/// happens to fit better at this size does not crowd out all else.
void KeepDiverse(const FirstStageInput& input, std::size_t keep,
                 std::vector<Contender>* ranked) {
  struct Group {
    const Contender* best;
    std::size_t members;
  };
  const std::size_t share = (keep + kSharesOfAGroup - 1) / kSharesOfAGroup;
  std::vector<Group> groups;
  std::vector<Contender> kept;
  for (const Contender& contender : *ranked) {
    if (kept.size() == keep) break;
    const auto group =
        std::find_if(groups.begin(), groups.end(), [&](const Group& other) {
          return !Distinct(input.pool_y, *other.best, contender,
                           kGroupFraction);
        });
    if (group == groups.end()) {
      groups.push_back({&contender, 1});
    } else if (++group->members > share) {
      continue;
    }
    kept.push_back(contender);
  }
  *ranked = std::move(kept);
}

/// The best of the ranked contenders and the best distinct ones after it.
std::vector<RankedMap> BestDistinct(const FirstStageInput& input,
                                    const FirstStageOptions& options,
                                    const std::vector<Contender>& ranked) {
  std::vector<const Contender*> kept;
  std::vector<RankedMap> results;
  for (const Contender& contender : ranked) {
    if (static_cast<int>(kept.size()) == options.max_results) break;
    const bool distinct =
        std::all_of(kept.begin(), kept.end(), [&](const Contender* better) {
          return Distinct(input.pool_y, *better, contender, kDistinctFraction);
        });
    if (!distinct) continue;
    kept.push_back(&contender);
    results.push_back({Restore(input, contender.matches, 0, options.pinned),
                       contender.contradiction, contender.badness,
                       contender.wrong_side});
  }
  return results;
}

/// A map without its mirrored regions, grown anew: from the rim inwards, so
/// that near matches hand orientation on, where the farthest point first would
/// choose a side anew. Such a block move is what swaps of single matches never
/// find.
Matching Regrown(const FirstStageInput& input, const FirstStageOptions& options,
                 const Matching& matching, RandomStream* random) {
  const std::vector<double> orientations =
      LocalOrientations(matching, input.frames_x, input.frames_y);
  std::vector<PointMatch> kept;
  std::vector<int> removed;
  const std::vector<PointMatch> matches = matching.Matches();
  for (int i = 0; i < matching.size(); ++i) {
    if (i < matching.pinned() || orientations[i] > 0) {
      kept.push_back(matches[i]);
    } else {
      removed.push_back(matches[i].x);
    }
  }
  Matching regrown =
      Restore(input, kept, matching.capacity(), matching.pinned());
  for (std::size_t i = 0; i < removed.size(); ++i) {
    const int x = regrown.NearestUnmatched(kX, removed);
    const int y = input.search_y.Best(regrown, kX, x);
    if (y < 0) break;
    regrown.Add({x, y});
  }
  Improve(options, /*temperature=*/0, random, &regrown);
  return regrown;
}

/// Takes the regrown map when it is better by what complete maps rank by, with
/// what is mirrored of them counting against them.
void RegrowMirrored(const FirstStageInput& input,
                    const FirstStageOptions& options, RandomStream* random,
                    Matching* matching) {
  for (int round = 0; round < kRegrowths; ++round) {
    const double score =
        OrientationScore(*matching, input.frames_x, input.frames_y);
    if (score < 0 || score > kWellOriented) return;
    Matching regrown = Regrown(input, options, *matching, random);
    const double new_score =
        OrientationScore(regrown, input.frames_x, input.frames_y);
    if (Badness(input, options, true, regrown) * (1 - new_score) >=
        Badness(input, options, true, *matching) * (1 - score)) {
      return;
    }
    *matching = std::move(regrown);
  }
}

/// The options' rounds that are smaller than the whole, then the whole.
std::vector<SelectionRound> AllRounds(const FirstStageOptions& options) {
  std::vector<SelectionRound> rounds;
  for (const SelectionRound& round : options.rounds) {
    if (round.matches < options.matches) rounds.push_back(round);
  }
  // Which of the last ones are kept is decided by BestDistinct.
  rounds.push_back({options.matches, std::numeric_limits<int>::max()});
  return rounds;
}

/// Reports progress over rounds of growing cost.
class RoundProgress {
 public:
  RoundProgress(const std::vector<SelectionRound>& rounds, std::size_t seeds,
                const std::function<void(double)>& report)
      : report_(report) {
    double contenders = static_cast<double>(seeds);
    double begin = 0;
    for (const SelectionRound& round : rounds) {
      const double end = double{1} * round.matches * round.matches;
      work_.push_back(contenders * (end - begin));
      total_ += work_.back();
      contenders = std::min<double>(contenders, round.keep);
      begin = end;
    }
  }

  /// Begins the next round, of which there are that many contenders.
  void BeginRound(std::size_t contenders) {
    if (round_ >= 0) done_ += work_[round_];
    ++round_;
    contenders_ = static_cast<double>(contenders);
    grown_ = 0;
  }

  void OneDone() {
    const MutexLock lock(mutex_);
    ++grown_;
    const double done = done_ + work_[round_] * grown_ / contenders_;
    if (report_) report_(std::min(1.0, done / total_));
  }

 private:
  Mutex mutex_;
  std::vector<double> work_;  ///< of a round, if as many are left as may be
  double total_ = 0;
  double done_ = 0;  ///< by earlier rounds
  int round_ = -1;
  double contenders_ = 0;
  int grown_ = 0;
  const std::function<void(double)>& report_;
};

/// What ends the growth of a map.
struct GrowthEnd {
  int matches;
  const std::stop_token& stop;
};

/// Grows `matching`: insertion alternates between farthest points of X and of
/// Y, and a phase of swapping follows every swap_interval insertions (paper,
/// Sections 3.3.1 and 3.4). Ends early when a pool is used up.
void Grow(const FirstStageInput& input, const FirstStageOptions& options,
          const GrowthEnd& end, RandomStream* random, Matching* matching) {
  while (matching->size() < end.matches && !end.stop.stop_requested()) {
    // Even sizes sample X and look on Y, odd ones the other way.
    const Side from =
        options.insert_from_x_only || matching->size() % 2 == 0 ? kX : kY;
    const CandidateSearch& search =
        from == kX ? input.search_y : input.search_x;
    if (!InsertFrom(from, search, matching)) return;
    if (matching->size() % options.swap_interval == 0) {
      Improve(options, PhaseTemperature(options), random, matching);
    }
  }
}

/// Grows a contender and ranks it at its new size.
void GrowContender(const FirstStageInput& input,
                   const FirstStageOptions& options, const GrowthEnd& end,
                   RandomStream random, Contender* contender) {
  const bool last = end.matches == options.matches;
  Matching matching =
      Restore(input, contender->matches, end.matches, options.pinned);
  Grow(input, options, end, &random, &matching);
  if (last) {
    Improve(options, /*temperature=*/0, &random, &matching);
    if (options.regrow_mirrored) {
      RegrowMirrored(input, options, &random, &matching);
    }
  }
  Judge(input, options, matching, contender);
  if (options.max_results > 1 && (last || matching.size() >= kDiverseFrom)) {
    contender->images = ImagesOfProbes(options, matching);
  }
}

}  // namespace

double LandmarkPenalty(double contradicted_fraction) {
  return std::exp(kPenaltyRate * contradicted_fraction);
}

absl::StatusOr<std::vector<RankedMap>> RunFirstStage(
    const FirstStageInput& input, const std::vector<Seed>& seeds,
    const FirstStageOptions& options,
    const std::function<void(double)>& progress, const std::stop_token& stop) {
  assert(!seeds.empty());
  std::vector<Contender> contenders;
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    Contender contender;
    contender.seed = i;
    contender.matches = seeds[i];
    contenders.push_back(std::move(contender));
  }
  const std::vector<SelectionRound> rounds = AllRounds(options);
  RoundProgress round_progress(rounds, seeds.size(), progress);
  bool want_mirror = false;
  for (std::size_t r = 0; r < rounds.size(); ++r) {
    const bool last = r + 1 == rounds.size();
    const auto grow_one = [&](std::int64_t i) {
      Contender& contender = contenders[i];
      const RandomStream random(options.random_seed,
                                contender.seed * rounds.size() + r);
      GrowContender(input, options, {rounds[r].matches, stop}, random,
                    &contender);
      round_progress.OneDone();
    };
    round_progress.BeginRound(contenders.size());
    ISOMATCH_RETURN_IF_ERROR(ParallelFor(
        static_cast<std::int64_t>(contenders.size()), stop, grow_one));
    if (!options.landmarks.empty()) {
      want_mirror = LandmarksWantMirror(contenders, want_mirror);
    }
    if (want_mirror) {
      for (Contender& contender : contenders) {
        contender.wrong_side = !contender.wrong_side;
      }
    }
    std::sort(contenders.begin(), contenders.end(), Better);
    DropRepeated(&contenders);
    const std::size_t keep = rounds[r].keep;
    if (!last && !contenders.front().images.empty()) {
      KeepDiverse(input, keep, &contenders);
    } else if (contenders.size() > keep) {
      contenders.erase(contenders.begin() + keep, contenders.end());
    }
  }
  return BestDistinct(input, options, contenders);
}

}  // namespace isomatch
