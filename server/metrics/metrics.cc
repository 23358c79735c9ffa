#include "server/metrics/metrics.h"

namespace isomatch {

Metrics& NullMetrics() {
  static Metrics metrics;
  return metrics;
}

}  // namespace isomatch
