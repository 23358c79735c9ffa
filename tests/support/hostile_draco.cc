#include "tests/support/hostile_draco.h"

#include <cstddef>
#include <cstdint>

#include "tests/support/draco_stream.h"

namespace isomatch {
namespace {

std::string SequentialClaim(std::uint32_t faces, std::uint32_t points) {
  return Padded(DracoHeader(kDracoSequential) + DracoVarint(faces) +
                    DracoVarint(points) + '\1',
                150);
}

/// A megabyte of faces whose points have 255 doubles each.
std::string WideAttribute() {
  constexpr std::uint32_t kFaces = 340'000;
  return DracoHeader(kDracoSequential) + DracoVarint(kFaces) +
         DracoVarint(3 * kFaces) + '\1' + std::string(3 * kFaces, '\0') +
         DracoAttribute(/*type=*/0, /*data_type=*/10, '\xff');
}

/// A triangle of 200 attributes of 255 doubles each.
std::string ManyAttributes() {
  std::string bytes = DracoTriangle(std::string("\0\1\2", 3), "\1\xc8\1");
  bytes.pop_back();
  for (int i = 0; i < 200; ++i) {
    bytes += std::string("\4\xa\xff\0", 4) + static_cast<char>(i);
  }
  return bytes;
}

}  // namespace

std::vector<HostileDraco> HostileDracoFiles() {
  constexpr std::uint32_t kTwoToThe31 = std::uint32_t{1} << 31;
  const std::string indices("\0\1\2", 3);
  const std::string positions = DracoAttribute(0, /*data_type=*/9, 3);
  const std::string values(36, '\0');
  return {
      {"150 B, 10^8 faces", EdgebreakerClaim(50'000'000, 100'000'000, 0, 150)},
      {"153 B, 7 10^7 faces", EdgebreakerClaim(35'000'000, 70'000'000, 0, 153)},
      {"150 B, 9 10^6 faces, within the limits",
       EdgebreakerClaim(4'500'000, 9'000'000, 0, 150)},
      {"1 MB, 255 doubles a point", WideAttribute()},
      {"150 B, 10^8 faces, sequential", SequentialClaim(100'000'000, 3)},
      {"2^31 faces", SequentialClaim(kTwoToThe31, 3)},
      {"2^31 points", SequentialClaim(1, kTwoToThe31)},
      {"2^32 - 1 of both", SequentialClaim(~0U, ~0U)},
      {"2^32 - 1 of both, edgebreaker", EdgebreakerClaim(~0U, ~0U, 0, 150)},
      {"200 attributes of 255 doubles", ManyAttributes()},
      {"a face index out of range",
       DracoTriangle(std::string("\0\1\7", 3), positions + values)},
      {"no attribute", DracoTriangle(indices, std::string(1, '\0'))},
      {"no position", DracoTriangle(indices, DracoAttribute(1, 9, 3) + values)},
      {"values cut short",
       DracoTriangle(indices, positions + values.substr(1))},
      {"1 MB that is not Draco", std::string(1 << 20, '\xff')},
      {"no bytes", ""},
  };
}

}  // namespace isomatch
