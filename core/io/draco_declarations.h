#pragma once

#include <cstdint>

#include "draco/compression/mesh/mesh_edgebreaker_decoder.h"
#include "draco/compression/mesh/mesh_sequential_decoder.h"
#include "draco/core/decoder_buffer.h"

namespace isomatch {

// What a Draco 2.2 stream says of itself, read ahead of Draco, which believes
// it. Nothing here allocates.

/// What a stream's headers claim.
struct DracoCounts {
  std::uint32_t vertices = 0;
  std::uint32_t faces = 0;
  std::uint8_t attribute_connectivities = 0;
};

/// Reads what a mesh's connectivity begins with and moves `buffer` past it;
/// false where it is cut short. The decoder's type says which of Draco's two
/// encodings it is.
bool ReadCounts(const draco::MeshSequentialDecoder&,
                draco::DecoderBuffer& buffer, DracoCounts* counts);
bool ReadCounts(const draco::MeshEdgebreakerDecoder&,
                draco::DecoderBuffer& buffer, DracoCounts* counts);

/// Returns the bytes a point of all attributes that the stream declares behind
/// the connectivity whose counts were read from `buffer`, as far as can be told
/// without decoding it: 0 where it is compressed.
std::int64_t DeclaredAttributeStride(const draco::MeshSequentialDecoder&,
                                     draco::DecoderBuffer buffer,
                                     const DracoCounts& counts);
std::int64_t DeclaredAttributeStride(const draco::MeshEdgebreakerDecoder&,
                                     draco::DecoderBuffer buffer,
                                     const DracoCounts& counts);

}  // namespace isomatch
