#pragma once

#include <array>
#include <cstdint>
#include <cstring>

namespace isomatch {

/// Values that are computed with at once.
inline constexpr int kLanes = 8;

/// By the vector extension of GCC and Clang, which makes one or two registers
/// of it, or plain code: the one way to vectorize by hand here, besides Eigen's
/// arrays. Operators go lane by lane, as `a < b ? a : b` does.
using Lanes = float __attribute__((vector_size(kLanes * sizeof(float))));
/// What comparing Lanes gives: -1 where it holds, else 0.
using LaneBits =
    std::int32_t __attribute__((vector_size(kLanes * sizeof(std::int32_t))));

/// A vector of each lane.
using LaneVector = std::array<Lanes, 3>;

inline Lanes LoadLanes(const float* from) {
  Lanes lanes;
  std::memcpy(&lanes, from, sizeof lanes);
  return lanes;
}

inline void StoreLanes(Lanes lanes, float* to) {
  std::memcpy(to, &lanes, sizeof lanes);
}

/// The values of `table` at kLanes places.
inline Lanes GatherLanes(const float* table, const int* places) {
  return Lanes{table[places[0]], table[places[1]], table[places[2]],
               table[places[3]], table[places[4]], table[places[5]],
               table[places[6]], table[places[7]]};
}

inline Lanes AllLanes(float value) { return Lanes{} + value; }

/// Where b is not a number, a.
inline Lanes MinLanes(Lanes a, Lanes b) { return b < a ? b : a; }
inline Lanes MaxLanes(Lanes a, Lanes b) { return b > a ? b : a; }

inline Lanes AbsLanes(Lanes lanes) {
  return (Lanes)((LaneBits)lanes & 0x7fffffff);
}

/// Exactly rounded. One instruction a register, as built without errno.
inline Lanes SqrtLanes(Lanes lanes) {
  Lanes roots;
  for (int lane = 0; lane < kLanes; ++lane) {
    roots[lane] = __builtin_sqrtf(lanes[lane]);
  }
  return roots;
}

inline Lanes DotLanes(const LaneVector& a, const LaneVector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// In one order, whatever the instruction set.
inline float SumOfLanes(Lanes lanes) {
  const float quarters[4] = {lanes[0] + lanes[4], lanes[1] + lanes[5],
                             lanes[2] + lanes[6], lanes[3] + lanes[7]};
  return (quarters[0] + quarters[2]) + (quarters[1] + quarters[3]);
}

inline bool AnyLane(LaneBits bits) {
  std::int64_t words[kLanes / 2];
  std::memcpy(words, &bits, sizeof words);
  return ((words[0] | words[1]) | (words[2] | words[3])) != 0;
}

}  // namespace isomatch
