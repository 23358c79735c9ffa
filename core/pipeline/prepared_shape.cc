#include "core/pipeline/prepared_shape.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "core/pipeline/instruction_set.h"
#include "core/pipeline/shape_contents.h"

namespace isomatch {
namespace {

std::int64_t Bytes(std::int64_t count, std::size_t size) {
  return count * static_cast<std::int64_t>(size);
}

/// What is computed on the solved vertices.
std::int64_t SolvedBytes(const PreparedMesh& prepared) {
  return Bytes(static_cast<std::int64_t>(prepared.hash.basis.fields().size()),
               sizeof(float)) +
         Bytes(prepared.spectral.functions.size(), sizeof(double)) +
         Bytes(prepared.descriptors.columns.size(), sizeof(float));
}

}  // namespace

std::string PreparationText(const MatchOptions& options) {
  const PreparationKey key = PreparationKey::Of(options);
  return absl::StrCat(InstructionSet(), " ", key.solved_vertices, " ",
                      key.pool_size, " ", key.eigenpairs, " ",
                      key.curvature_radius, " ", key.descriptor_radius);
}

std::int64_t PreparedShapeBytes(const PreparedShape& shape) {
  // Bytes of each vertex, and of each face beyond two a vertex: mesh, clean
  // mesh, stars, numberings and, where decimated, embedding. Measured, with a
  // third to spare.
  constexpr std::int64_t kVertex = 900;
  constexpr std::int64_t kFace = 150;
  const PreparedShape::Contents& contents = shape.contents();
  const std::int64_t vertices = contents.mesh->num_vertices();
  const std::int64_t faces = contents.mesh->num_faces();
  const std::int64_t of_mesh =
      kVertex * vertices +
      kFace * std::max<std::int64_t>(0, faces - 2 * vertices);
  if (!contents.whole) return of_mesh;
  return of_mesh + kVertex * contents.whole->solved().mesh.num_vertices() +
         SolvedBytes(*contents.whole);
}

}  // namespace isomatch
