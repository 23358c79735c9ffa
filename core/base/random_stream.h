#pragma once

#include <cstdint>
#include <random>

namespace isomatch {

/// A reproducible stream of random numbers: the same on every platform, unlike
/// the standard's distributions. One stream per stage or task index, so that
/// results do not depend on the order in which tasks run.
///
/// Not thread-safe.
class RandomStream {
 public:
  /// Streams of different `index` under one `random_seed` are independent.
  RandomStream(std::uint64_t random_seed, std::uint64_t index) {
    std::seed_seq sequence{static_cast<std::uint32_t>(random_seed),
                           static_cast<std::uint32_t>(random_seed >> 32),
                           static_cast<std::uint32_t>(index),
                           static_cast<std::uint32_t>(index >> 32)};
    engine_.seed(sequence);
  }

  /// Returns an integer in [0, bound). REQUIRES: 0 < bound < 2^32. The bias of
  /// the multiply-shift is below bound / 2^32.
  std::int32_t Below(std::int64_t bound) {
    return static_cast<std::int32_t>(
        ((engine_() >> 32) * static_cast<std::uint64_t>(bound)) >> 32);
  }

  /// Returns a number in [0, 1).
  double Unit() {
    constexpr double kTwoToMinus53 = 0x1p-53;
    return static_cast<double>(engine_() >> 11) * kTwoToMinus53;
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace isomatch
