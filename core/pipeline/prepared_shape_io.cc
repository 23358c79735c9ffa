#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <boost/crc.hpp>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/base/version.h"
#include "core/descriptor/shot_descriptor.h"
#include "core/pipeline/component_matching.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/matcher_functions.h"
#include "core/pipeline/prepared_shape.h"
#include "core/pipeline/shape_contents.h"

// Layout, in the order of bytes of x86 and ARM: the magic with the version of
// Isomatch, a CRC-32 of what follows, then the values in the order of Fields
// below. Containers are their sizes (int64) and their entries. What follows
// from the mesh by sorting and counting alone is not there; a CRC-32 of the
// solved mesh tells whether it came out as it was.

namespace isomatch {
namespace {

static_assert(std::endian::native == std::endian::little);

std::string Magic() {
  return absl::StrCat("isomatch-prepared ", kVersion, " ");
}

std::uint32_t Crc32(absl::string_view bytes) {
  boost::crc_32_type crc;
  crc.process_bytes(bytes.data(), bytes.size());
  return crc.checksum();
}

/// Whether the entries of a matrix or vector are written.
template <typename T>
constexpr bool kIsScalar = std::is_arithmetic_v<T>;

class Writer {
 public:
  template <typename T>
  void operator()(const T& value) {
    if constexpr (kIsScalar<T>) {
      Append(&value, 1);
    } else if constexpr (requires { value.rows(); }) {
      (*this)(static_cast<std::int64_t>(value.rows()));
      (*this)(static_cast<std::int64_t>(value.cols()));
      Append(value.data(), value.size());
    } else {
      (*this)(static_cast<std::int64_t>(value.size()));
      Append(value.data(), static_cast<std::int64_t>(value.size()));
    }
  }

  std::string Take() { return std::move(bytes_); }

 private:
  template <typename T>
  void Append(const T* values, std::int64_t count) {
    bytes_.append(reinterpret_cast<const char*>(values),
                  static_cast<std::size_t>(count) * sizeof(T));
  }

  std::string bytes_;
};

/// Never allocates more than the bytes at hand can fill.
class Reader {
 public:
  explicit Reader(absl::string_view bytes) : bytes_(bytes) {}

  template <typename T>
  void operator()(T& value) {
    if constexpr (kIsScalar<T>) {
      Read(&value, 1);
    } else if constexpr (requires { value.rows(); }) {
      std::int64_t rows = 0;
      std::int64_t cols = 0;
      (*this)(rows);
      (*this)(cols);
      using Scalar = typename T::Scalar;
      const bool fits_type = T::ColsAtCompileTime == Eigen::Dynamic ||
                             T::ColsAtCompileTime == cols;
      if (!fits_type || cols < 0 || rows < 0 || rows > Room<Scalar>() ||
          cols > Room<Scalar>() || (rows > 0 && cols > Room<Scalar>() / rows)) {
        ok_ = false;
        return;
      }
      value.resize(rows, cols);
      Read(value.data(), value.size());
    } else {
      std::int64_t size = 0;
      (*this)(size);
      using Entry = typename T::value_type;
      if (size < 0 || size > Room<Entry>()) {
        ok_ = false;
        return;
      }
      value.resize(static_cast<std::size_t>(size));
      Read(value.data(), size);
    }
  }

  /// Everything was read, and nothing is left.
  bool ok() const { return ok_ && bytes_.empty(); }

 private:
  template <typename T>
  std::int64_t Room() const {
    return static_cast<std::int64_t>(bytes_.size() / sizeof(T));
  }

  template <typename T>
  void Read(T* values, std::int64_t count) {
    if (!ok_ || count > Room<T>()) {
      ok_ = false;
      return;
    }
    const std::size_t size = static_cast<std::size_t>(count) * sizeof(T);
    if (size > 0) std::memcpy(values, bytes_.data(), size);
    bytes_.remove_prefix(size);
  }

  absl::string_view bytes_;
  bool ok_ = true;
};

/// The parts of a BasisPoints.
struct BasisParts {
  std::vector<VertexIndex> points;
  VertexIndex num_vertices = 0;
  std::vector<float> fields;
};

std::uint32_t CrcOf(const TriangleMesh& mesh) {
  Writer writer;
  writer(mesh.positions);
  writer(mesh.faces);
  return Crc32(writer.Take());
}

/// Gives every value that is stored to `visit`, in order.
template <typename Visitor, typename Contents, typename Basis, typename Crc>
void Fields(Visitor& visit, Contents& contents, Basis& basis, Crc& crc) {
  visit(contents.key.solved_vertices);
  visit(contents.key.pool_size);
  visit(contents.key.eigenpairs);
  visit(contents.key.curvature_radius);
  visit(contents.key.descriptor_radius);
  visit(contents.mesh.positions);
  visit(contents.mesh.faces);
  visit(crc);
  auto& prepared = contents.prepared;
  visit(prepared.hash.farthest_points);
  visit(basis.points);
  visit(basis.num_vertices);
  visit(basis.fields);
  visit(prepared.spectral.eigenvalues);
  visit(prepared.spectral.functions);
  visit(prepared.curvature);
  visit(prepared.descriptors.vertices);
  visit(prepared.descriptors.columns);
  visit(prepared.descriptor_radius);
}

bool Distinct(const std::vector<VertexIndex>& vertices, VertexIndex n) {
  std::vector<char> seen(n, false);
  for (const VertexIndex v : vertices) {
    if (v < 0 || v >= n || seen[v]) return false;
    seen[v] = true;
  }
  return true;
}

bool IsDistance(float value) { return value >= 0 && value <= kUnreachable; }

/// A checksum keeps accidents out, not a file made to do harm: whatever is used
/// as an index or a size is compared with the mesh, numbers must be finite.
bool Consistent(const PreparedShape::Contents& contents,
                const BasisParts& basis) {
  const PreparedMesh& prepared = contents.prepared;
  const VertexIndex n = prepared.solved().mesh.num_vertices();
  const std::vector<VertexIndex>& farthest = prepared.hash.farthest_points;
  if (basis.num_vertices != n ||
      static_cast<int>(basis.points.size()) != BasisPoints::DefaultCount(n) ||
      basis.fields.size() != std::size_t(n) * basis.points.size() ||
      !std::all_of(basis.fields.begin(), basis.fields.end(), IsDistance)) {
    return false;
  }
  if (!Distinct(farthest, n) || farthest.size() < basis.points.size() ||
      !std::equal(basis.points.begin(), basis.points.end(), farthest.begin())) {
    return false;
  }
  const SpectralBasis& spectral = prepared.spectral;
  const Eigen::Index pairs = std::min<Eigen::Index>(contents.key.eigenpairs, n);
  if (spectral.eigenvalues.size() != pairs ||
      spectral.functions.cols() != pairs ||
      (pairs > 0 && spectral.functions.rows() != n) ||
      !spectral.eigenvalues.allFinite() || !spectral.functions.allFinite() ||
      prepared.curvature.size() != n || !prepared.curvature.allFinite()) {
    return false;
  }
  const ShapeDescriptors& descriptors = prepared.descriptors;
  const bool described =
      prepared.solved().oriented && contents.key.descriptor_radius > 0;
  if (!described) return descriptors.vertices.empty();
  return !descriptors.vertices.empty() && Distinct(descriptors.vertices, n) &&
         descriptors.columns.rows() == kShotSize &&
         descriptors.columns.cols() ==
             static_cast<Eigen::Index>(descriptors.vertices.size()) &&
         descriptors.columns.allFinite() &&
         prepared.descriptor_radius >= contents.key.descriptor_radius &&
         std::isfinite(prepared.descriptor_radius);
}

/// What of the rest follows from what was read.
void Complete(BasisParts basis, PreparedShape::Contents* contents) {
  PreparedMesh& prepared = contents->prepared;
  prepared.hash.basis = BasisPoints::FromFields(
      std::move(basis.points), basis.num_vertices, std::move(basis.fields));
  prepared.laplacian = BuildCotanLaplacian(prepared.solved().mesh);
  if (contents->key.eigenpairs > 0) {
    prepared.spectral.mass = prepared.laplacian.mass;
  }
  ShapeDescriptors& descriptors = prepared.descriptors;
  if (!descriptors.vertices.empty()) {
    descriptors.column_of_vertex.assign(prepared.solved().mesh.num_vertices(),
                                        -1);
  }
  for (std::size_t i = 0; i < descriptors.vertices.size(); ++i) {
    descriptors.column_of_vertex[descriptors.vertices[i]] = static_cast<int>(i);
  }
}

}  // namespace

std::string SerializePreparedShape(const PreparedShape& shape) {
  const PreparedShape::Contents& contents = shape.contents();
  const BasisPoints& points = contents.prepared.hash.basis;
  const BasisParts basis = {points.points(), points.num_vertices(),
                            points.fields()};
  const std::uint32_t crc = CrcOf(contents.prepared.solved().mesh);
  Writer writer;
  Fields(writer, contents, basis, crc);
  const std::string payload = writer.Take();
  Writer checksum;
  checksum(Crc32(payload));
  return absl::StrCat(Magic(), checksum.Take(), payload);
}

absl::StatusOr<PreparedShape> ParsePreparedShapeHere(absl::string_view bytes,
                                                     std::stop_token stop) {
  const std::string magic = Magic();
  if (bytes.substr(0, magic.size()) != magic) {
    return absl::DataLossError(
        absl::StrCat("prepared shape: does not begin with \"", magic, "\""));
  }
  bytes.remove_prefix(magic.size());
  std::uint32_t checksum = 0;
  const bool has_checksum = bytes.size() >= sizeof(checksum);
  if (has_checksum) {
    std::memcpy(&checksum, bytes.data(), sizeof(checksum));
    bytes.remove_prefix(sizeof(checksum));
  }
  if (!has_checksum || Crc32(bytes) != checksum) {
    return absl::DataLossError(
        "prepared shape: the checksum is wrong, the bytes were changed or cut "
        "off");
  }
  auto contents = std::make_shared<PreparedShape::Contents>();
  BasisParts basis;
  std::uint32_t crc = 0;
  Reader reader(bytes);
  Fields(reader, *contents, basis, crc);
  if (!reader.ok()) {
    return absl::DataLossError("prepared shape: the sizes do not fit");
  }
  PreparedMesh& prepared = contents->prepared;
  MatchOptions options;
  options.solved_vertices = contents->key.solved_vertices;
  const absl::Status valid = options.Validate();
  const absl::Status valid_mesh = ValidateMesh(contents->mesh, "mesh");
  if (!valid.ok() || !valid_mesh.ok()) {
    return absl::DataLossError(absl::StrCat(
        "prepared shape: ", (valid.ok() ? valid_mesh : valid).message()));
  }
  ISOMATCH_ASSIGN_OR_RETURN(MeshParts parts,
                            SplitIntoParts(contents->mesh, stop));
  contents->large_components = static_cast<std::int32_t>(parts.large.size());
  ISOMATCH_RETURN_IF_ERROR(
      PrepareSurface(std::move(parts.clean), options, stop, &prepared));
  if (CrcOf(prepared.solved().mesh) != crc) {
    return absl::DataLossError(
        "prepared shape: the mesh is cleaned or decimated otherwise here than "
        "where it was prepared");
  }
  if (!Consistent(*contents, basis)) {
    return absl::DataLossError("prepared shape: the parts do not fit");
  }
  Complete(std::move(basis), contents.get());
  return PreparedShape(std::move(contents));
}

}  // namespace isomatch
