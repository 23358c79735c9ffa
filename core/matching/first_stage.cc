#include "core/matching/first_stage.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <tuple>
#include <utility>

#include "core/base/mutex.h"
#include "core/base/parallel.h"
#include "core/base/random_stream.h"
#include "core/base/status_macros.h"
#include "core/matching/objective.h"

namespace isomatch {
namespace {

/// A competing partial map between rounds: only what is needed to go on.
struct Contender {
  std::size_t seed;  ///< index, for ties and for the random stream
  std::vector<PointMatch> matches;
  bool mirrored = false;
  double badness = 0;  ///< smaller is better
};

bool Better(const Contender& a, const Contender& b) {
  return std::tie(a.mirrored, a.badness, a.seed) <
         std::tie(b.mirrored, b.badness, b.seed);
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
                 const std::vector<PointMatch>& matches, int capacity) {
  Matching matching(input.pool_x, input.pool_y,
                    std::max<int>(capacity, matches.size()));
  for (const PointMatch& match : matches) matching.Add(match);
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

void Judge(const FirstStageInput& input, const FirstStageOptions& options,
           const Matching& matching, Contender* contender) {
  contender->matches = matching.Matches();
  const bool complete = matching.size() >= options.matches;
  contender->badness = Badness(input, options, complete, matching);
  contender->mirrored =
      options.orientation_from > 0 &&
      matching.size() >= options.orientation_from &&
      OrientationScore(matching, input.frames_x, input.frames_y) < 0;
}

/// All rounds, the last of which is the full size.
std::vector<SelectionRound> AllRounds(const FirstStageOptions& options) {
  std::vector<SelectionRound> rounds;
  for (const SelectionRound& round : options.rounds) {
    if (round.matches < options.matches) rounds.push_back(round);
  }
  rounds.push_back({options.matches, 1});
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
      work_each_.push_back(double{1} * round.matches * round.matches - begin);
      total_ += contenders * work_each_.back();
      contenders = std::min<double>(contenders, round.keep);
      begin = double{1} * round.matches * round.matches;
    }
  }

  void OneDone(std::size_t round) {
    const MutexLock lock(mutex_);
    done_ += work_each_[round];
    if (report_) report_(std::min(1.0, done_ / total_));
  }

 private:
  Mutex mutex_;
  std::vector<double> work_each_;  ///< of a contender, by round
  double total_ = 0;
  double done_ = 0;
  const std::function<void(double)>& report_;
};

}  // namespace

void Grow(const FirstStageInput& input, const FirstStageOptions& options,
          int target, RandomStream* random, const std::stop_token& stop,
          Matching* matching) {
  while (matching->size() < target && !stop.stop_requested()) {
    // Even sizes sample X and look on Y, odd ones the other way.
    const Side from = matching->size() % 2 == 0 ? kX : kY;
    const CandidateSearch& search =
        from == kX ? input.search_y : input.search_x;
    if (!InsertFrom(from, search, matching)) return;
    if (matching->size() % options.swap_interval == 0) {
      Improve(options, PhaseTemperature(options), random, matching);
    }
  }
}

absl::StatusOr<Matching> RunFirstStage(
    const FirstStageInput& input, const std::vector<Seed>& seeds,
    const FirstStageOptions& options,
    const std::function<void(double)>& progress, const std::stop_token& stop) {
  assert(!seeds.empty());
  std::vector<Contender> contenders;
  for (std::size_t i = 0; i < seeds.size(); ++i) {
    contenders.push_back({i, seeds[i]});
  }
  const std::vector<SelectionRound> rounds = AllRounds(options);
  RoundProgress round_progress(rounds, seeds.size(), progress);
  for (std::size_t r = 0; r < rounds.size(); ++r) {
    const bool last = r + 1 == rounds.size();
    const auto grow_one = [&](std::int64_t i) {
      Contender& contender = contenders[i];
      RandomStream random(options.random_seed,
                          contender.seed * rounds.size() + r);
      Matching matching = Restore(input, contender.matches, rounds[r].matches);
      Grow(input, options, rounds[r].matches, &random, stop, &matching);
      if (last) Improve(options, /*temperature=*/0, &random, &matching);
      Judge(input, options, matching, &contender);
      round_progress.OneDone(r);
    };
    ISOMATCH_RETURN_IF_ERROR(ParallelFor(
        static_cast<std::int64_t>(contenders.size()), stop, grow_one));
    std::sort(contenders.begin(), contenders.end(), Better);
    contenders.erase(
        contenders.begin() +
            std::min<std::size_t>(rounds[r].keep, contenders.size()),
        contenders.end());
  }
  return Restore(input, contenders.front().matches, 0);
}

}  // namespace isomatch
