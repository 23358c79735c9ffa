#pragma once

#include <functional>
#include <stop_token>

namespace isomatch {

/// How a caller follows one long step, and ends it.
struct Control {
  /// Called with the fraction that is done, when set.
  std::function<void(double)> progress = {};
  std::stop_token stop = {};
};

}  // namespace isomatch
