#include "tests/support/hostile_draco.h"

#include <cstddef>
#include <cstdint>

namespace isomatch {
namespace {

// Draco 2.2, byte by byte.

enum Method : char { kSequential = 0, kEdgebreaker = 1 };

std::string Header(Method method) {
  return std::string("DRACO\2\2\1") + static_cast<char>(method) +
         std::string(2, '\0');
}

std::string Varint(std::uint32_t value) {
  std::string bytes;
  for (; value >= 128; value >>= 7) {
    bytes += static_cast<char>((value & 127) | 128);
  }
  return bytes + static_cast<char>(value);
}

std::string Padded(std::string bytes, std::size_t size) {
  bytes.resize(size, '\x55');
  return bytes;
}

std::string EdgebreakerClaim(std::uint32_t vertices, std::uint32_t faces,
                             std::size_t size) {
  return Padded(Header(kEdgebreaker) + '\0' + Varint(vertices) + Varint(faces) +
                    '\0' + Varint(faces) + Varint(0),
                size);
}

std::string SequentialClaim(std::uint32_t faces, std::uint32_t points) {
  return Padded(Header(kSequential) + Varint(faces) + Varint(points) + '\1',
                150);
}

/// One attribute, stored raw.
std::string Attribute(char type, char data_type, char components) {
  return std::string("\1\1") + type + data_type + components +
         std::string(3, '\0');
}

std::string Triangle(const std::string& indices, const std::string& rest) {
  return Header(kSequential) + '\1' + '\3' + '\1' + indices + rest;
}

/// A megabyte of faces whose points have 255 doubles each.
std::string WideAttribute() {
  constexpr std::uint32_t kFaces = 340'000;
  return Header(kSequential) + Varint(kFaces) + Varint(3 * kFaces) + '\1' +
         std::string(3 * kFaces, '\0') +
         Attribute(/*type=*/0, /*data_type=*/10, '\xff');
}

/// A triangle of 200 attributes of 255 doubles each.
std::string ManyAttributes() {
  std::string bytes = Triangle(std::string("\0\1\2", 3), "\1\xc8\1");
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
  const std::string positions = Attribute(0, /*data_type=*/9, 3);
  const std::string values(36, '\0');
  return {
      {"150 B, 10^8 faces", EdgebreakerClaim(50'000'000, 100'000'000, 150)},
      {"153 B, 7 10^7 faces", EdgebreakerClaim(35'000'000, 70'000'000, 153)},
      {"150 B, 9 10^6 faces, within the limits",
       EdgebreakerClaim(4'500'000, 9'000'000, 150)},
      {"1 MB, 255 doubles a point", WideAttribute()},
      {"150 B, 10^8 faces, sequential", SequentialClaim(100'000'000, 3)},
      {"2^31 faces", SequentialClaim(kTwoToThe31, 3)},
      {"2^31 points", SequentialClaim(1, kTwoToThe31)},
      {"2^32 - 1 of both", SequentialClaim(~0U, ~0U)},
      {"2^32 - 1 of both, edgebreaker", EdgebreakerClaim(~0U, ~0U, 150)},
      {"200 attributes of 255 doubles", ManyAttributes()},
      {"a face index out of range",
       Triangle(std::string("\0\1\7", 3), positions + values)},
      {"no attribute", Triangle(indices, std::string(1, '\0'))},
      {"no position", Triangle(indices, Attribute(1, 9, 3) + values)},
      {"values cut short", Triangle(indices, positions + values.substr(1))},
      {"1 MB that is not Draco", std::string(1 << 20, '\xff')},
      {"no bytes", ""},
  };
}

}  // namespace isomatch
