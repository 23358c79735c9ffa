#include "core/io/draco_declarations.h"

#include <array>
#include <cstdint>

#include "draco/core/draco_types.h"
#include "draco/core/varint_decoding.h"

namespace isomatch {
namespace {

/// Moves past the corners of all faces where a sequential stream has them
/// uncompressed; false where it has not.
bool SkipCorners(std::int64_t faces, std::uint32_t vertices,
                 draco::DecoderBuffer& buffer) {
  constexpr std::uint8_t kCompressed = 0;
  constexpr std::uint8_t kVarintGoesOn = 128;
  std::uint8_t method = kCompressed;
  if (!buffer.Decode(&method) || method == kCompressed) return false;
  const std::int64_t corners = 3 * faces;
  if (vertices < (1U << 8)) {
    buffer.Advance(corners);
  } else if (vertices < (1U << 16)) {
    buffer.Advance(2 * corners);
  } else if (vertices < (1U << 21)) {
    std::uint8_t byte = 0;
    for (std::int64_t left = corners; left > 0 && buffer.Decode(&byte);) {
      if (byte < kVarintGoesOn) --left;
    }
  } else {
    buffer.Advance(4 * corners);
  }
  return true;
}

/// Adds the bytes of a value of each attribute of one attributes decoder;
/// false where the stream cannot be read on.
bool AddDeclaredValues(draco::DecoderBuffer& buffer, std::int64_t* stride) {
  std::uint32_t attributes = 0;
  if (!draco::DecodeVarint(&attributes, &buffer)) return false;
  for (std::uint32_t i = 0; i < attributes; ++i) {
    // Semantic, data type, components, whether normalized.
    std::array<std::uint8_t, 4> declared;
    std::uint32_t id = 0;
    if (!buffer.Decode(&declared) || !draco::DecodeVarint(&id, &buffer)) {
      return false;
    }
    const auto [semantic, data_type, components, normalized] = declared;
    if (data_type == draco::DT_INVALID || data_type >= draco::DT_TYPES_COUNT) {
      return false;
    }
    *stride += std::int64_t{components} *
               draco::DataTypeLength(static_cast<draco::DataType>(data_type));
  }
  // A byte each says how it is coded.
  buffer.Advance(attributes);
  return true;
}

}  // namespace

bool ReadCounts(const draco::MeshSequentialDecoder&,
                draco::DecoderBuffer& buffer, DracoCounts* counts) {
  return draco::DecodeVarint(&counts->faces, &buffer) &&
         draco::DecodeVarint(&counts->vertices, &buffer);
}

bool ReadCounts(const draco::MeshEdgebreakerDecoder&,
                draco::DecoderBuffer& buffer, DracoCounts* counts) {
  return draco::DecodeVarint(&counts->vertices, &buffer) &&
         draco::DecodeVarint(&counts->faces, &buffer) &&
         buffer.Decode(&counts->attribute_connectivities);
}

std::int64_t DeclaredAttributeStride(const draco::MeshSequentialDecoder&,
                                     draco::DecoderBuffer buffer,
                                     const DracoCounts& counts) {
  std::int64_t stride = 0;
  std::uint8_t decoders = 0;
  if (!SkipCorners(counts.faces, counts.vertices, buffer) ||
      !buffer.Decode(&decoders)) {
    return stride;
  }
  while (decoders > 0 && AddDeclaredValues(buffer, &stride)) --decoders;
  return stride;
}

std::int64_t DeclaredAttributeStride(const draco::MeshEdgebreakerDecoder&,
                                     draco::DecoderBuffer /*buffer*/,
                                     const DracoCounts& /*counts*/) {
  // Edgebreaker always compresses.
  return 0;
}

}  // namespace isomatch
