#pragma once

#include <memory>
#include <string>

#include <prometheus/exposer.h>

namespace isomatch {

/// Returns an endpoint that listens at HOST:PORT and answers GET /metrics.
/// Throws a std::exception, which says nothing, when it cannot listen there.
std::unique_ptr<prometheus::Exposer> OpenEndpoint(const std::string& address);

/// Ends it, after the requests under way; `address` is where it listens.
void CloseEndpoint(std::unique_ptr<prometheus::Exposer> exposer,
                   const std::string& address);

}  // namespace isomatch
