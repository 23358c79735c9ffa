#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <exception>
#include <memory>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/io/draco_mesh.h"
#include "core/mesh/mesh_geometry.h"
#include "draco/compression/expert_encode.h"
#include "draco/core/encoder_buffer.h"
#include "draco/mesh/mesh.h"
#include "draco/metadata/geometry_metadata.h"

namespace isomatch {
namespace {

// Draco's middle road between speed (10) and size (0).
constexpr int kSpeed = 5;

bool HasRepeatedCorner(const Faces& faces) {
  return ((faces.col(0).array() == faces.col(1).array()) ||
          (faces.col(1).array() == faces.col(2).array()) ||
          (faces.col(2).array() == faces.col(0).array()))
      .any();
}

bool EveryVertexIsOnAFace(const TriangleMesh& mesh) {
  const std::vector<bool> on_face = VerticesOnFaces(mesh);
  return std::find(on_face.begin(), on_face.end(), false) == on_face.end();
}

// Edgebreaker, which is small, drops vertices on no face and faces that repeat
// a corner; sequential, which can be fast, keeps both but holds at most three
// vertices a face.
VertexOrder ChooseOrder(const TriangleMesh& mesh, bool is_local) {
  const bool fits_sequential =
      mesh.num_vertices() <= 3 * std::int64_t{mesh.num_faces()};
  const bool wants_sequential =
      is_local || HasRepeatedCorner(mesh.faces) || !EveryVertexIsOnAFace(mesh);
  return wants_sequential && fits_sequential ? VertexOrder::kDecoded
                                             : VertexOrder::kIdAttribute;
}

// Adds an attribute with one value a point and returns its id.
int AddAttribute(draco::GeometryAttribute::Type type, draco::DataType data_type,
                 int components, draco::Mesh& mesh) {
  draco::GeometryAttribute attribute;
  const int stride = components * draco::DataTypeLength(data_type);
  attribute.Init(type, nullptr, static_cast<std::int8_t>(components), data_type,
                 /*normalized=*/false, stride, /*byte_offset=*/0);
  return mesh.AddAttribute(attribute, /*identity_mapping=*/true,
                           mesh.num_points());
}

int AddPositions(const TriangleMesh& from, draco::Mesh& mesh) {
  const Positions& positions = from.positions;
  const Eigen::RowVector3d origin = SentOriginOf(from);
  const int id = AddAttribute(draco::GeometryAttribute::POSITION,
                              draco::DT_FLOAT32, 3, mesh);
  for (Eigen::Index v = 0; v < positions.rows(); ++v) {
    const Eigen::RowVector3f position =
        (positions.row(v) - origin).cast<float>();
    mesh.attribute(id)->SetAttributeValue(
        draco::AttributeValueIndex(static_cast<std::uint32_t>(v)),
        position.data());
  }
  return id;
}

void AddVertexIds(draco::Mesh& mesh) {
  const int id = AddAttribute(draco::GeometryAttribute::GENERIC,
                              draco::DT_UINT32, 1, mesh);
  for (std::uint32_t v = 0; v < mesh.num_points(); ++v) {
    mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(v), &v);
  }
  auto metadata = std::make_unique<draco::AttributeMetadata>();
  metadata->AddEntryString("name", "vertex_id");
  mesh.AddAttributeMetadata(id, std::move(metadata));
}

void AddFaces(const Faces& faces, draco::Mesh& mesh) {
  mesh.SetNumFaces(static_cast<std::size_t>(faces.rows()));
  for (Eigen::Index f = 0; f < faces.rows(); ++f) {
    draco::Mesh::Face face;
    for (int corner = 0; corner < 3; ++corner) {
      face[corner] =
          draco::PointIndex(static_cast<std::uint32_t>(faces(f, corner)));
    }
    mesh.SetFace(draco::FaceIndex(static_cast<std::uint32_t>(f)), face);
  }
}

absl::StatusOr<std::string> Compress(const draco::Mesh& mesh, VertexOrder order,
                                     int position_id,
                                     const DracoOptions& options) {
  draco::ExpertEncoder encoder(mesh);
  encoder.SetSpeedOptions(kSpeed, kSpeed);
  if (order == VertexOrder::kIdAttribute) {
    encoder.SetEncodingMethod(draco::MESH_EDGEBREAKER_ENCODING);
  } else {
    encoder.SetEncodingMethod(draco::MESH_SEQUENTIAL_ENCODING);
    encoder.options().SetGlobalBool("compress_connectivity", !options.is_local);
  }
  if (options.position_bits > 0) {
    encoder.SetAttributeQuantization(position_id, options.position_bits);
  }
  draco::EncoderBuffer buffer;
  if (options.is_local) {  // nearly all: three numbers a face and a vertex
    buffer.buffer()->reserve(12 * (mesh.num_faces() + mesh.num_points()));
  }
  const draco::Status status = encoder.EncodeToBuffer(&buffer);
  if (!status.ok()) {
    return absl::InternalError(
        absl::StrCat("Draco cannot encode: ", status.error_msg_string()));
  }
  return std::string(buffer.data(), buffer.size());
}

}  // namespace

absl::StatusOr<EncodedMesh> EncodeDraco(const TriangleMesh& mesh,
                                        const DracoOptions& options) {
  const VertexOrder order = ChooseOrder(mesh, options.is_local);
  draco::Mesh encoded;
  encoded.set_num_points(static_cast<std::uint32_t>(mesh.num_vertices()));
  const int position_id = AddPositions(mesh, encoded);
  if (order == VertexOrder::kIdAttribute) AddVertexIds(encoded);
  AddFaces(mesh.faces, encoded);
  ISOMATCH_ASSIGN_OR_RETURN(std::string bytes,
                            Compress(encoded, order, position_id, options));
  return EncodedMesh{std::move(bytes), order};
}

}  // namespace isomatch
