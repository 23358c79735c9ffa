#pragma once

#include <memory>
#include <string>

#include <prometheus/exposer.h>

#include "server/metrics/probes.h"

namespace isomatch {

/// Returns an endpoint that listens at HOST:PORT and answers GET /metrics and,
/// by 200 or 503, GET and HEAD of the paths of `probes`, which outlive it. A
/// request of any length holds one of its threads for three seconds at most, of
/// which there are enough for 50 such at a time.
/// Throws a std::exception, which says nothing, when it cannot listen there.
std::unique_ptr<prometheus::Exposer> OpenEndpoint(const std::string& address,
                                                  const Probes& probes);

/// Ends it, after the requests under way; `address` is where it listens.
void CloseEndpoint(std::unique_ptr<prometheus::Exposer> exposer,
                   const std::string& address);

}  // namespace isomatch
