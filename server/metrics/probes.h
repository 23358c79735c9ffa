#pragma once

#include <functional>
#include <string>

namespace isomatch {

/// What a probe hears: the first line of a body, which says why if it is not
/// well.
struct ProbeAnswer {
  bool is_well = true;
  std::string line;
};
using Probe = std::function<ProbeAnswer()>;

/// Asked at each request, by several threads. They must not wait for anything.
struct Probes {
  /// GET /healthz: whether the process works, or should be started again.
  Probe health = [] { return ProbeAnswer{true, "ok"}; };
  /// GET /readyz: whether it can do its part now.
  Probe readiness = [] { return ProbeAnswer{true, "ready"}; };
};

}  // namespace isomatch
