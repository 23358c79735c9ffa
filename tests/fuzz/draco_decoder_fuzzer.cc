// Any bytes end in a status or in a mesh whose faces name its vertices. The
// first byte chooses how vertices are numbered, the rest is the stream.

#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "core/io/draco_mesh.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  using isomatch::VertexOrder;
  if (size == 0) return 0;
  const VertexOrder order =
      data[0] % 2 == 0 ? VertexOrder::kDecoded : VertexOrder::kIdAttribute;
  const absl::string_view bytes(reinterpret_cast<const char*>(data) + 1,
                                size - 1);
  isomatch::DracoLimits limits;
  limits.max_vertices = 100'000;
  limits.max_faces = 200'000;
  limits.max_attribute_bytes = 16 << 20;
  const absl::StatusOr<isomatch::TriangleMesh> mesh =
      isomatch::DecodeDraco(bytes, order, /*vertex_count=*/0, limits);
  if (!mesh.ok() || mesh->num_faces() == 0) return 0;
  if (mesh->faces.minCoeff() < 0 ||
      mesh->faces.maxCoeff() >= mesh->num_vertices()) {
    std::abort();
  }
  return 0;
}
