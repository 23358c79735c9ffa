#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <boost/crc.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "core/base/status_macros.h"
#include "core/base/version.h"
#include "core/descriptor/shot_descriptor.h"
#include "core/pipeline/component_matching.h"
#include "core/pipeline/match_options.h"
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

/// The members of a BasisPoints.
struct BasisFields {
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

/// Gives every value that is stored of any shape to `visit`, in order.
template <typename Visitor, typename Key, typename Mesh, typename Crc>
void MeshFields(Visitor& visit, Key& key, Mesh& mesh, Crc& crc) {
  visit(key.solved_vertices);
  visit(key.pool_size);
  visit(key.eigenpairs);
  visit(key.curvature_radius);
  visit(key.descriptor_radius);
  visit(mesh.positions);
  visit(mesh.faces);
  visit(crc);
}

/// And those that follow unless its components are matched one by one.
template <typename Visitor, typename Prepared, typename Basis>
void PreparedFields(Visitor& visit, Prepared& prepared, Basis& basis) {
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
bool Consistent(const PreparationKey& key, const PreparedMesh& prepared,
                const BasisFields& basis) {
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
  const Eigen::Index pairs = std::min<Eigen::Index>(key.eigenpairs, n);
  if (spectral.eigenvalues.size() != pairs ||
      spectral.functions.cols() != pairs ||
      (pairs > 0 && spectral.functions.rows() != n) ||
      !spectral.eigenvalues.allFinite() || !spectral.functions.allFinite() ||
      prepared.curvature.size() != n || !prepared.curvature.allFinite()) {
    return false;
  }
  const ShapeDescriptors& descriptors = prepared.descriptors;
  const bool described =
      prepared.solved().oriented && key.descriptor_radius > 0;
  if (!described) return descriptors.vertices.empty();
  return !descriptors.vertices.empty() && Distinct(descriptors.vertices, n) &&
         descriptors.columns.rows() == kShotSize &&
         descriptors.columns.cols() ==
             static_cast<Eigen::Index>(descriptors.vertices.size()) &&
         descriptors.columns.allFinite() &&
         prepared.descriptor_radius >= key.descriptor_radius &&
         std::isfinite(prepared.descriptor_radius);
}

/// What of the rest follows from what was read.
void Complete(const PreparationKey& key, BasisFields basis,
              PreparedMesh* into) {
  PreparedMesh& prepared = *into;
  prepared.hash.basis = BasisPoints::FromFields(
      std::move(basis.points), basis.num_vertices, std::move(basis.fields));
  prepared.laplacian = BuildCotanLaplacian(prepared.solved().mesh);
  if (key.eigenpairs > 0) {
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

absl::Status DataLoss(absl::string_view problem) {
  return absl::DataLossError(absl::StrCat("prepared shape: ", problem));
}

/// Removes magic and checksum from `bytes`.
absl::Status CheckAndStrip(absl::string_view* bytes) {
  const std::string magic = Magic();
  if (!absl::ConsumePrefix(bytes, magic)) {
    return DataLoss(absl::StrCat("does not begin with \"", magic, "\""));
  }
  std::uint32_t checksum = 0;
  const bool has_checksum = bytes->size() >= sizeof(checksum);
  if (has_checksum) {
    std::memcpy(&checksum, bytes->data(), sizeof(checksum));
    bytes->remove_prefix(sizeof(checksum));
  }
  if (!has_checksum || Crc32(*bytes) != checksum) {
    return DataLoss("the checksum is wrong, the bytes were changed or cut off");
  }
  return absl::OkStatus();
}

/// What a shape is read from.
struct Stored {
  TriangleMesh mesh;
  PreparationKey key;
  std::uint32_t crc = 0;
  /// Without what follows from the mesh; none of a shape that is split.
  std::optional<PreparedMesh> whole;
  BasisFields basis;
};

absl::StatusOr<Stored> ReadStored(absl::string_view bytes) {
  Stored stored;
  Reader reader(bytes);
  MeshFields(reader, stored.key, stored.mesh, stored.crc);
  if (!reader.ok()) {
    PreparedFields(reader, stored.whole.emplace(), stored.basis);
  }
  if (!reader.ok()) return DataLoss("the sizes do not fit");
  MatchOptions options;
  options.solved_vertices = stored.key.solved_vertices;
  const absl::Status valid = options.Validate();
  const absl::Status valid_mesh = ValidateMesh(stored.mesh, "mesh");
  if (valid.ok() && valid_mesh.ok()) return stored;
  return DataLoss((valid.ok() ? valid_mesh : valid).message());
}

/// Cleans and decimates as before.
absl::Status CompleteWhole(CleanMesh clean, const std::stop_token& stop,
                           Stored* stored) {
  MatchOptions options;
  options.solved_vertices = stored->key.solved_vertices;
  PreparedMesh& whole = *stored->whole;
  ISOMATCH_RETURN_IF_ERROR(
      PrepareSurface(std::move(clean), options, stop, &whole));
  if (CrcOf(whole.solved().mesh) != stored->crc) {
    return DataLoss(
        "the mesh is cleaned or decimated otherwise here than where it was "
        "prepared");
  }
  if (!Consistent(stored->key, whole, stored->basis)) {
    return DataLoss("the members do not fit");
  }
  Complete(stored->key, std::move(stored->basis), &whole);
  return absl::OkStatus();
}

}  // namespace

std::string SerializePreparedShape(const PreparedShape& shape) {
  const PreparedShape::Contents& contents = shape.contents();
  const std::uint32_t crc = CrcOf(contents.whole ? contents.whole->solved().mesh
                                  : contents.split ? contents.split->clean.mesh
                                                   : *contents.mesh);
  Writer writer;
  MeshFields(writer, contents.key, *contents.mesh, crc);
  if (contents.whole) {
    const BasisPoints& points = contents.whole->hash.basis;
    const BasisFields basis = {points.points(), points.num_vertices(),
                               points.fields()};
    PreparedFields(writer, *contents.whole, basis);
  }
  const std::string payload = writer.Take();
  Writer checksum;
  checksum(Crc32(payload));
  return absl::StrCat(Magic(), checksum.Take(), payload);
}

absl::StatusOr<PreparedShape> ParsePreparedShapeHere(
    absl::string_view bytes, const std::stop_token& stop) {
  ISOMATCH_RETURN_IF_ERROR(CheckAndStrip(&bytes));
  ISOMATCH_ASSIGN_OR_RETURN(Stored stored, ReadStored(bytes));
  ISOMATCH_ASSIGN_OR_RETURN(SplitMesh split,
                            SplitIntoComponents(stored.mesh, stop));
  const std::size_t large = split.large.size();
  if (stored.whole) {
    ISOMATCH_RETURN_IF_ERROR(
        CompleteWhole(std::move(split.clean), stop, &stored));
  } else if (!MatchedByComponents(large) ||
             CrcOf(split.clean.mesh) != stored.crc) {
    return DataLoss(
        "the mesh has other components here than where it was prepared");
  }
  auto contents =
      std::make_shared<PreparedShape::Contents>(PreparedShape::Contents{
          .mesh = std::move(stored.mesh),
          .key = stored.key,
          .large_components = static_cast<std::int32_t>(large),
          .whole = std::move(stored.whole)});
  if (!contents->whole) contents->split = std::move(split);
  return PreparedShape(std::move(contents));
}

}  // namespace isomatch
