#pragma once

#include <cstdint>

namespace isomatch {

/// How much more memory this process came to hold since this was made, for
/// which freed memory is given back first (Linux; 0 elsewhere). One at a time.
class MemoryGrowth {
 public:
  MemoryGrowth();

  /// At its highest so far.
  std::int64_t Bytes() const;

 private:
  std::int64_t before_;
};

}  // namespace isomatch
