#include "server/jobs/match_engine.h"

namespace isomatch {

MatchEngine CoreMatchEngine() {
  return {Match,
          Prepare,
          PrepareBoth,
          MatchPrepared,
          EstimateMemoryBytes,
          ValidateLandmarks};
}

}  // namespace isomatch
