#include "server/jobs/match_engine.h"

#include "core/pipeline/matcher.h"
#include "core/pipeline/memory_estimate.h"

namespace isomatch {

MatchEngine CoreMatchEngine() {
  return {.match = Match,
          .prepare = Prepare,
          .prepare_both = PrepareBoth,
          .match_prepared = MatchPrepared,
          .estimate_prepared_extra = EstimatePreparedExtraBytes,
          .estimate = EstimateMemoryBytes,
          .plan = PlanWithinMemory,
          .validate_landmarks = ValidateLandmarks};
}

}  // namespace isomatch
