#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace isomatch {

// Draco 2.2 bitstreams, byte by byte, for tests of what no encoder writes.

inline constexpr char kDracoSequential = 0;
inline constexpr char kDracoEdgebreaker = 1;
inline constexpr char kDracoMesh = 1;

std::string DracoHeader(char method, char geometry = kDracoMesh, char major = 2,
                        char minor = 2);
std::string DracoVarint(std::uint32_t value);

/// Cut or filled up to `size`.
std::string Padded(std::string bytes, std::size_t size);

/// An edgebreaker mesh's counts, without what they count, in `size` bytes.
std::string EdgebreakerClaim(std::uint32_t vertices, std::uint32_t faces,
                             char connectivities, std::size_t size);

/// One attributes decoder with one attribute, stored raw.
std::string DracoAttribute(char type, char data_type, char components);

/// One triangle of three points with 8-bit indices, then `rest`.
std::string DracoTriangle(const std::string& indices, const std::string& rest);

}  // namespace isomatch
