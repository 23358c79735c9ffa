#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// What a vertex's index means, given that Draco may reorder vertices.
enum class VertexOrder {
  /// Vertex i is the i-th point of the decoded stream.
  kDecoded,
  /// A uint32 GENERIC attribute with metadata name=vertex_id gives each point
  /// its index; points with equal ids are one vertex.
  kIdAttribute,
};

/// Bounds on what a stream may make the decoder allocate.
struct DracoLimits {
  std::int64_t max_vertices = 5'000'000;
  std::int64_t max_faces = 10'000'000;
  /// Sum over all attributes of points x stride.
  std::int64_t max_attribute_bytes = 512LL << 20;
  /// Called, unless empty, before the decoder allocates memory. `more_bytes` is
  /// what decoding may take, its result included, beyond what earlier calls
  /// said. An error ends decoding.
  std::function<absl::Status(std::int64_t more_bytes)> reserve;
};

/// Returns the mesh that `bytes` hold, its vertices numbered as `order` says.
/// Faces keep their orientation. Each begins with its smallest vertex, and they
/// are sorted, so that a mesh and its map do not depend on the encoder.
///
/// Safe on hostile bytes: counts in the headers are compared with the limits
/// and with the bytes that are there before anything is allocated for them.
/// With kIdAttribute, `vertex_count` (when not 0) is the number of vertices of
/// the result, of which those without a point are on no face and lie at the
/// origin; with kDecoded it must equal the decoded count.
///
/// INVALID_ARGUMENT: not a Draco triangle mesh, over a limit, a face index out
/// of range, no positions, no or bad ids, another vertex count.
/// RESOURCE_EXHAUSTED: there is no memory for it. An error of limits.reserve is
/// returned as it is.
absl::StatusOr<TriangleMesh> DecodeDraco(absl::string_view bytes,
                                         VertexOrder order,
                                         std::int64_t vertex_count,
                                         const DracoLimits& limits = {});

/// Returns whether `bytes` are a mesh encoded by edgebreaker, whose decoder
/// returns the vertices in another order than the encoder was given them. Reads
/// the header only.
bool RenumbersVertices(absl::string_view bytes);

/// Returns whether the metadata of `bytes` name a vertex_id attribute, which
/// DecodeDraco checks with kIdAttribute.
bool HasVertexIds(absl::string_view bytes);

/// A mesh as Draco bytes, and how they number its vertices.
struct EncodedMesh {
  std::string bytes;
  VertexOrder vertex_order;
};

struct DracoOptions {
  /// Bits of quantization of each coordinate, 8 to 30; 0 keeps every bit of
  /// the single-precision coordinates.
  int position_bits = 0;
  /// Where the bytes stay on the machine: not compressed (but where vertices
  /// are more than three a face), which takes a tenth of the time to encode, a
  /// third to decode, and twice the bytes.
  bool is_local = false;
};

/// Returns the point from which EncodeDraco counts coordinates. It is the
/// origin unless the mesh lies far from it, compared with the mesh's extent.
/// Then it is a point near the mesh whose coordinates are multiples of a power
/// of two, which is 8 to 16 times the extent. REQUIRES: a face.
Eigen::RowVector3d SentOriginOf(const TriangleMesh& mesh);

/// Returns `mesh` compressed: edgebreaker with a vertex_id attribute when every
/// vertex is on a face, else, or where it stays local, sequential, which keeps
/// order and isolated vertices. Decoding gives every vertex its index back in
/// either case. Coordinates are counted from SentOriginOf(mesh) and rounded to
/// single precision: counted from the origin, little would be left of a mesh
/// far from it, as georeferenced ones are. Matching does not depend on where a
/// mesh lies. REQUIRES: ValidateMesh(mesh). INTERNAL when Draco refuses.
absl::StatusOr<EncodedMesh> EncodeDraco(const TriangleMesh& mesh,
                                        const DracoOptions& options = {});

}  // namespace isomatch
