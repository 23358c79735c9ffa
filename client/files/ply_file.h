#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "absl/types/span.h"
#include "core/mesh/triangle_mesh.h"

namespace isomatch {

/// How the numbers after a PLY header are written.
enum class PlyFormat { kAscii, kLittleEndian, kBigEndian };

/// A number's type in a PLY file.
struct PlyType {
  enum class Kind { kSigned, kUnsigned, kFloat };
  int bytes = 0;
  Kind kind = Kind::kSigned;
};

/// Of one element: a number, or a list of numbers that begins with their count.
struct PlyProperty {
  std::string name;
  PlyType type;
  /// Not set for a single number.
  std::optional<PlyType> count_type;
};

struct PlyElement {
  std::string name;
  std::int64_t count = 0;
  std::vector<PlyProperty> properties;
};

struct PlyHeader {
  PlyFormat format = PlyFormat::kAscii;
  std::vector<PlyElement> elements;
};

/// Takes the header off the front of the bytes of a PLY file.
/// INVALID_ARGUMENT without the path.
absl::StatusOr<PlyHeader> TakePlyHeader(absl::string_view& bytes);

/// The numbers after a PLY header, in order.
class PlyBody {
 public:
  PlyBody(absl::string_view rest, PlyFormat format)
      : rest_(rest), format_(format) {}

  /// False when fewer than `count` numbers of this type are left.
  bool Skip(std::int64_t count, const PlyType& type);

  /// Nothing where a length should be.
  std::optional<std::int64_t> TakeLength(const PlyType& type);

  /// Nothing where a number should be. Exact for all but 8-byte integers, which
  /// PLY does not have.
  std::optional<double> TakeNumber(const PlyType& type);

  /// What was not taken yet.
  absl::string_view rest() const { return rest_; }

 private:
  absl::string_view TakeWord();
  std::optional<std::uint64_t> TakeBytes(int count);

  absl::string_view rest_;
  PlyFormat format_;
};

/// A property of the vertices of a PLY file to be written.
struct PlyColumn {
  enum class Type { kFloat, kInt, kUchar };
  std::string name;
  Type type = Type::kFloat;
  /// The value of a vertex; in the range of the type.
  std::function<double(VertexIndex)> value;
};

/// Returns the bytes of a binary little-endian PLY file: single-precision
/// coordinates, then `columns`, of each vertex, and the triangles.
std::string FormatPly(const TriangleMesh& mesh,
                      absl::Span<const PlyColumn> columns = {});

}  // namespace isomatch
