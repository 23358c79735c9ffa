#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <new>
#include <numeric>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/io/draco_declarations.h"
#include "core/io/draco_mesh.h"
#include "core/io/face_order.h"
#include "draco/attributes/point_attribute.h"
#include "draco/compression/mesh/mesh_edgebreaker_decoder.h"
#include "draco/compression/mesh/mesh_sequential_decoder.h"
#include "draco/core/decoder_buffer.h"
#include "draco/mesh/mesh.h"
#include "draco/metadata/geometry_metadata.h"
#include "draco/metadata/metadata_decoder.h"

namespace isomatch {
namespace {

// Draco writes real meshes with more than 1 bit a face, and never repeats an
// attribute's value for less than its share of that; a stream that claims more
// than these is a bomb. The slack lets the smallest meshes through.
constexpr std::int64_t kMaxFacesPerByte = 64;
constexpr std::int64_t kMaxAttributeBytesPerByte = 1024;
constexpr std::int64_t kSlackBytes = 64;

// Each costs tables of the size of the connectivity; ours needs one.
constexpr int kMaxAttributeConnectivities = 16;

// What decoding takes at most, the mesh that it returns included: for each face
// and vertex that the headers claim, more for each connectivity of attributes,
// and for each byte of attributes.
constexpr std::int64_t kBytesPerFace = 80;
constexpr std::int64_t kBytesPerVertex = 60;
constexpr std::int64_t kBytesPerVertexOfResult = 40;
constexpr std::int64_t kBytesPerFaceAndConnectivity = 20;
constexpr std::int64_t kBytesPerAttributeByte = 3;

// 1.5.5 still reads bitstreams of 2014, by code nobody writes for any more.
constexpr int kMajorVersion = 2;
constexpr int kMinorVersion = 2;

// What a stream may claim, and the first excess found.
struct Budget {
  const DracoLimits& limits;
  std::int64_t stream_bytes;
  absl::Status excess = absl::OkStatus();

  bool Refuse(const std::string& what) {
    excess = absl::InvalidArgumentError(what);
    return false;
  }

  bool Reserve(std::int64_t bytes) {
    if (limits.reserve) excess = limits.reserve(bytes);
    return excess.ok();
  }
};

bool CheckAtMost(std::int64_t found, std::int64_t limit, const char* what,
                 Budget& budget) {
  if (found <= limit) return true;
  return budget.Refuse(absl::StrCat("the stream claims ", found, " ", what,
                                    ", expected at most ", limit, " in ",
                                    budget.stream_bytes, " bytes"));
}

bool CheckCounts(const DracoCounts& counts, Budget& budget) {
  const std::int64_t plausible_faces =
      kMaxFacesPerByte * (budget.stream_bytes + kSlackBytes);
  return CheckAtMost(counts.faces,
                     std::min(budget.limits.max_faces, plausible_faces),
                     "faces", budget) &&
         CheckAtMost(counts.vertices,
                     std::min(budget.limits.max_vertices, 3 * plausible_faces),
                     "vertices", budget) &&
         CheckAtMost(counts.attribute_connectivities,
                     kMaxAttributeConnectivities, "attribute connectivities",
                     budget);
}

// REQUIRES: CheckCounts.
std::int64_t ConnectivityBytes(const DracoCounts& counts) {
  return counts.faces * (kBytesPerFace + kBytesPerFaceAndConnectivity *
                                             counts.attribute_connectivities) +
         counts.vertices * kBytesPerVertex;
}

bool CheckAttributeBytes(std::int64_t bytes, Budget& budget) {
  const std::int64_t plausible_bytes =
      kMaxAttributeBytesPerByte * (budget.stream_bytes + kSlackBytes);
  return CheckAtMost(
      bytes, std::min(budget.limits.max_attribute_bytes, plausible_bytes),
      "bytes of attributes", budget);
}

// The attributes are declared but not allocated yet when this is called.
bool CheckAttributes(const draco::PointCloud& cloud, Budget& budget) {
  if (!CheckAtMost(cloud.num_points(), budget.limits.max_vertices, "points",
                   budget)) {
    return false;
  }
  std::int64_t bytes = 0;
  for (int i = 0; i < cloud.num_attributes(); ++i) {
    bytes += cloud.attribute(i)->byte_stride() *
             static_cast<std::int64_t>(cloud.num_points());
  }
  return CheckAttributeBytes(bytes, budget) &&
         budget.Reserve(bytes * kBytesPerAttributeByte);
}

// One of Draco's mesh decoders, stopped before it allocates for counts that are
// over the budget.
template <typename Decoder>
class Bounded : public Decoder {
 public:
  explicit Bounded(Budget& budget) : budget_(budget) {}

 protected:
  bool DecodeConnectivity() override {
    draco::DecoderBuffer ahead = *this->buffer();
    DracoCounts counts;
    // Faces are not read, which takes Draco 30 ms a megabyte, where what
    // follows them is refused.
    return ReadCounts(*this, ahead, &counts) && CheckCounts(counts, budget_) &&
           CheckAttributeBytes(
               counts.vertices * DeclaredAttributeStride(*this, ahead, counts),
               budget_) &&
           budget_.Reserve(ConnectivityBytes(counts)) &&
           Decoder::DecodeConnectivity();
  }
  bool DecodeAllAttributes() override {
    return CheckAttributes(*this->point_cloud(), budget_) &&
           Decoder::DecodeAllAttributes();
  }

 private:
  Budget& budget_;
};

absl::Status ReadHeader(draco::DecoderBuffer buffer,
                        draco::DracoHeader* header) {
  if (!draco::PointCloudDecoder::DecodeHeader(&buffer, header).ok()) {
    return absl::InvalidArgumentError(
        "not a Draco stream: expected the letters DRACO at its beginning");
  }
  if (header->encoder_type != draco::TRIANGULAR_MESH) {
    return absl::InvalidArgumentError(
        "a Draco point cloud, expected a triangle mesh");
  }
  if (header->version_major != kMajorVersion ||
      header->version_minor != kMinorVersion) {
    return absl::InvalidArgumentError(absl::StrCat(
        "Draco bitstream ", header->version_major, ".", header->version_minor,
        ", expected ", kMajorVersion, ".", kMinorVersion));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<draco::MeshDecoder>> MakeDecoder(
    int encoder_method, Budget& budget) {
  switch (encoder_method) {
    case draco::MESH_SEQUENTIAL_ENCODING:
      return std::make_unique<Bounded<draco::MeshSequentialDecoder>>(budget);
    case draco::MESH_EDGEBREAKER_ENCODING:
      return std::make_unique<Bounded<draco::MeshEdgebreakerDecoder>>(budget);
    default:
      return absl::InvalidArgumentError(
          absl::StrCat("Draco encoding method ", encoder_method,
                       ", expected 0 (sequential) or 1 (edgebreaker)"));
  }
}

absl::StatusOr<std::unique_ptr<draco::Mesh>> DecodeBounded(
    absl::string_view bytes, const DracoLimits& limits) {
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  draco::DracoHeader header;
  ISOMATCH_RETURN_IF_ERROR(ReadHeader(buffer, &header));
  Budget budget{limits, static_cast<std::int64_t>(bytes.size())};
  ISOMATCH_ASSIGN_OR_RETURN(const std::unique_ptr<draco::MeshDecoder> decoder,
                            MakeDecoder(header.encoder_method, budget));
  auto mesh = std::make_unique<draco::Mesh>();
  const draco::DecoderOptions options;
  const draco::Status status = decoder->Decode(options, &buffer, mesh.get());
  ISOMATCH_RETURN_IF_ERROR(budget.excess);
  if (!status.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("damaged or truncated Draco stream of ", bytes.size(),
                     " bytes: ", status.error_msg_string()));
  }
  return mesh;
}

absl::Status CheckFaces(const draco::Mesh& mesh) {
  for (draco::FaceIndex f(0); f < mesh.num_faces(); ++f) {
    for (const draco::PointIndex& p : mesh.face(f)) {
      if (p.value() >= mesh.num_points()) {
        return absl::InvalidArgumentError(
            absl::StrCat("face ", f.value(), " names vertex ", p.value(),
                         ", expected less than ", mesh.num_points()));
      }
    }
  }
  return absl::OkStatus();
}

// The index of the value of `attribute` at `point`, checked: 1.5.5 decodes
// maps that point beyond the values.
absl::StatusOr<draco::AttributeValueIndex> ValueIndex(
    const draco::PointAttribute& attribute, draco::PointIndex point) {
  const bool mapped = attribute.is_mapping_identity() ||
                      point.value() < attribute.indices_map_size();
  if (mapped) {
    const draco::AttributeValueIndex value = attribute.mapped_index(point);
    const std::size_t end =
        (value.value() + std::size_t{1}) * attribute.byte_stride();
    if (value.value() < attribute.size() &&
        end <= attribute.buffer()->data_size()) {
      return value;
    }
  }
  return absl::InvalidArgumentError(
      absl::StrCat("point ", point.value(), " has no value of an attribute"));
}

// n x 3, of the points in decoded order.
absl::StatusOr<Positions> ReadPositions(const draco::Mesh& mesh) {
  const draco::PointAttribute* attribute =
      mesh.GetNamedAttribute(draco::GeometryAttribute::POSITION);
  // Draco would read bytes other than 0 and 1 as bool: undefined behavior.
  if (attribute == nullptr || attribute->num_components() != 3 ||
      attribute->data_type() == draco::DT_BOOL) {
    return absl::InvalidArgumentError(
        "the stream has no POSITION attribute of 3 numbers");
  }
  Positions positions(mesh.num_points(), 3);
  for (draco::PointIndex p(0); p < mesh.num_points(); ++p) {
    ISOMATCH_ASSIGN_OR_RETURN(const draco::AttributeValueIndex value,
                              ValueIndex(*attribute, p));
    if (!attribute->ConvertValue<double, 3>(value,
                                            positions.row(p.value()).data())) {
      return absl::InvalidArgumentError("positions are not numbers");
    }
  }
  return positions;
}

const draco::PointAttribute* FindIdAttribute(const draco::Mesh& mesh) {
  const int id = mesh.GetAttributeIdByMetadataEntry("name", "vertex_id");
  if (id < 0 || id >= mesh.num_attributes()) return nullptr;
  const draco::PointAttribute* attribute = mesh.attribute(id);
  const bool suits = attribute->data_type() == draco::DT_UINT32 &&
                     attribute->num_components() == 1;
  return suits ? attribute : nullptr;
}

// The user's index of each point; every entry is below `end`.
absl::StatusOr<std::vector<VertexIndex>> ReadIds(const draco::Mesh& mesh,
                                                 std::int64_t end) {
  const draco::PointAttribute* attribute = FindIdAttribute(mesh);
  if (attribute == nullptr) {
    return absl::InvalidArgumentError(
        "the stream has no attribute with metadata name=vertex_id of one "
        "uint32 to number its vertices by");
  }
  std::vector<VertexIndex> ids(mesh.num_points());
  for (draco::PointIndex p(0); p < mesh.num_points(); ++p) {
    ISOMATCH_ASSIGN_OR_RETURN(const draco::AttributeValueIndex value,
                              ValueIndex(*attribute, p));
    std::uint32_t id = 0;
    attribute->GetValue(value, &id);
    if (id >= end) {
      return absl::InvalidArgumentError(
          absl::StrCat("point ", p.value(), " has vertex_id ", id,
                       ", expected less than ", end));
    }
    ids[p.value()] = static_cast<VertexIndex>(id);
  }
  return ids;
}

Faces ReadFaces(const draco::Mesh& mesh) {
  Faces faces(mesh.num_faces(), 3);
  for (draco::FaceIndex f(0); f < mesh.num_faces(); ++f) {
    for (int corner = 0; corner < 3; ++corner) {
      faces(f.value(), corner) =
          static_cast<VertexIndex>(mesh.face(f)[corner].value());
    }
  }
  return faces;
}

absl::StatusOr<TriangleMesh> InDecodedOrder(const draco::Mesh& mesh,
                                            std::int64_t vertex_count) {
  if (vertex_count != 0 && vertex_count != mesh.num_points()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the stream has ", mesh.num_points(),
                     " vertices, expected vertex_count ", vertex_count));
  }
  ISOMATCH_ASSIGN_OR_RETURN(Positions positions, ReadPositions(mesh));
  return TriangleMesh{std::move(positions), ReadFaces(mesh)};
}

absl::StatusOr<TriangleMesh> InIdOrder(const draco::Mesh& mesh,
                                       std::int64_t vertex_count,
                                       const DracoLimits& limits) {
  ISOMATCH_ASSIGN_OR_RETURN(const Positions of_points, ReadPositions(mesh));
  const std::int64_t end =
      vertex_count != 0 ? vertex_count : limits.max_vertices;
  ISOMATCH_ASSIGN_OR_RETURN(const std::vector<VertexIndex> ids,
                            ReadIds(mesh, end));
  VertexIndex last = -1;
  for (const VertexIndex id : ids) last = std::max(last, id);
  const std::int64_t count =
      vertex_count != 0 ? vertex_count : std::int64_t{last} + 1;
  // The headers tell of points, not of the vertices beyond them.
  if (limits.reserve) {
    ISOMATCH_RETURN_IF_ERROR(
        limits.reserve(kBytesPerVertexOfResult *
                       std::max<std::int64_t>(0, count - mesh.num_points())));
  }
  TriangleMesh result{Positions::Zero(count, 3), ReadFaces(mesh)};
  for (std::size_t p = 0; p < ids.size(); ++p) {
    result.positions.row(ids[p]) = of_points.row(static_cast<Eigen::Index>(p));
  }
  for (VertexIndex& corner : result.faces.reshaped()) corner = ids[corner];
  return result;
}

absl::StatusOr<TriangleMesh> DecodeUnguarded(absl::string_view bytes,
                                             VertexOrder order,
                                             std::int64_t vertex_count,
                                             const DracoLimits& limits) {
  if (vertex_count < 0 || vertex_count > limits.max_vertices) {
    return absl::InvalidArgumentError(
        absl::StrCat("vertex_count is ", vertex_count, ", expected at most ",
                     limits.max_vertices));
  }
  ISOMATCH_ASSIGN_OR_RETURN(const std::unique_ptr<draco::Mesh> mesh,
                            DecodeBounded(bytes, limits));
  ISOMATCH_RETURN_IF_ERROR(CheckFaces(*mesh));
  ISOMATCH_ASSIGN_OR_RETURN(TriangleMesh result,
                            order == VertexOrder::kIdAttribute
                                ? InIdOrder(*mesh, vertex_count, limits)
                                : InDecodedOrder(*mesh, vertex_count));
  SortFaces(result.num_vertices(), result.faces);
  return result;
}

bool NamesVertexIds(absl::string_view bytes) {
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  draco::DracoHeader header;
  draco::GeometryMetadata metadata;
  return draco::PointCloudDecoder::DecodeHeader(&buffer, &header).ok() &&
         (header.flags & METADATA_FLAG_MASK) != 0 &&
         draco::MetadataDecoder().DecodeGeometryMetadata(&buffer, &metadata) &&
         metadata.GetAttributeMetadataByStringEntry("name", "vertex_id") !=
             nullptr;
}

}  // namespace

bool RenumbersVertices(absl::string_view bytes) {
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  draco::DracoHeader header;
  return ReadHeader(buffer, &header).ok() &&
         header.encoder_method == draco::MESH_EDGEBREAKER_ENCODING;
}

bool HasVertexIds(absl::string_view bytes) {
  try {
    return NamesVertexIds(bytes);
  } catch (const std::exception&) {
    return false;  // DecodeDraco says why
  }
}

absl::StatusOr<TriangleMesh> DecodeDraco(absl::string_view bytes,
                                         VertexOrder order,
                                         std::int64_t vertex_count,
                                         const DracoLimits& limits) {
  // Draco reports some damage by what the standard library throws; the only
  // place where the core catches.
  try {
    return DecodeUnguarded(bytes, order, vertex_count, limits);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(
        "not enough memory to decode the Draco stream");
  } catch (const std::exception& error) {
    return absl::InvalidArgumentError(
        absl::StrCat("damaged Draco stream: ", error.what()));
  }
}

}  // namespace isomatch
