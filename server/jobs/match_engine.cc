#include "server/jobs/match_engine.h"

namespace isomatch {

MatchEngine CoreMatchEngine() {
  return {Match, EstimateMemoryBytes, ValidateLandmarks};
}

}  // namespace isomatch
