#include "client/api/result_parts.h"

#include <bit>
#include <cstddef>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr std::size_t kMapEntryBytes = 4;
constexpr std::size_t kPrecisePointBytes = 24;
constexpr std::size_t kConfidenceBytes = 4;

/// Takes little-endian numbers from the front of bytes. REQUIRES: as many are
/// left as are taken.
class Reader {
 public:
  explicit Reader(absl::string_view bytes) : bytes_(bytes) {}

  std::uint32_t Uint32() { return Take<std::uint32_t>(); }
  float Float() { return std::bit_cast<float>(Take<std::uint32_t>()); }
  double Double() { return std::bit_cast<double>(Take<std::uint64_t>()); }

 private:
  template <typename Unsigned>
  Unsigned Take() {
    Unsigned value = 0;
    for (std::size_t i = sizeof(value); i-- > 0;) {
      value = value << 8 | static_cast<unsigned char>(bytes_[i]);
    }
    bytes_.remove_prefix(sizeof(value));
    return value;
  }

  absl::string_view bytes_;
};

absl::Status CheckSize(absl::string_view bytes, std::size_t expected,
                       const char* what) {
  if (bytes.size() == expected) return absl::OkStatus();
  return absl::DataLossError(
      absl::StrCat(what, " has ", bytes.size(), " bytes, expected ", expected));
}

/// 0xFFFFFFFF is kNoVertex.
absl::StatusOr<VertexIndex> ToVertex(std::uint32_t value, PairSize size) {
  const auto vertex = static_cast<VertexIndex>(value);
  if (kNoVertex <= vertex && vertex < size.vertices_y) return vertex;
  return absl::DataLossError(absl::StrCat(
      "the result names vertex ", value, " of Y, which has ", size.vertices_y));
}

absl::StatusOr<PrecisePoint> TakePoint(Reader& reader, PairSize size) {
  PrecisePoint point;
  for (VertexIndex& vertex : point.vertices) {
    ISOMATCH_ASSIGN_OR_RETURN(vertex, ToVertex(reader.Uint32(), size));
  }
  for (double& weight : point.weights) weight = reader.Float();
  const auto none = [](VertexIndex vertex) { return vertex == kNoVertex; };
  const bool first = none(point.vertices[0]);
  if (none(point.vertices[1]) != first || none(point.vertices[2]) != first) {
    return absl::DataLossError(
        "the precise map names one or two vertices of a face, expected three");
  }
  return point;
}

Eigen::VectorXd TakeVector(Reader& reader, Eigen::Index size) {
  Eigen::VectorXd vector(size);
  for (double& value : vector) value = reader.Double();
  return vector;
}

}  // namespace

absl::StatusOr<VertexMap> DecodeMap(absl::string_view bytes, PairSize size) {
  const auto entries = static_cast<std::size_t>(size.vertices_x);
  ISOMATCH_RETURN_IF_ERROR(
      CheckSize(bytes, entries * kMapEntryBytes, "the map"));
  Reader reader(bytes);
  VertexMap y_from_x(entries);
  for (VertexIndex& y : y_from_x) {
    ISOMATCH_ASSIGN_OR_RETURN(y, ToVertex(reader.Uint32(), size));
  }
  return y_from_x;
}

absl::StatusOr<std::vector<PrecisePoint>> DecodePreciseMap(
    absl::string_view bytes, PairSize size) {
  const auto entries = static_cast<std::size_t>(size.vertices_x);
  ISOMATCH_RETURN_IF_ERROR(
      CheckSize(bytes, entries * kPrecisePointBytes, "the precise map"));
  Reader reader(bytes);
  std::vector<PrecisePoint> points(entries);
  for (PrecisePoint& point : points) {
    ISOMATCH_ASSIGN_OR_RETURN(point, TakePoint(reader, size));
  }
  return points;
}

absl::StatusOr<std::vector<float>> DecodeConfidence(absl::string_view bytes,
                                                    PairSize size) {
  const auto entries = static_cast<std::size_t>(size.vertices_x);
  ISOMATCH_RETURN_IF_ERROR(
      CheckSize(bytes, entries * kConfidenceBytes, "the confidence"));
  Reader reader(bytes);
  std::vector<float> confidence(entries);
  for (float& value : confidence) value = reader.Float();
  return confidence;
}

absl::StatusOr<FunctionalMap> DecodeFunctionalMap(absl::string_view bytes) {
  constexpr char kWhat[] = "the functional map";
  if (bytes.size() < sizeof(std::uint32_t)) {
    return CheckSize(bytes, sizeof(std::uint32_t), kWhat);
  }
  Reader reader(bytes);
  const std::size_t k = reader.Uint32();
  // Far above any k in use, and far from overflow.
  constexpr std::size_t kMostFunctions = 1 << 16;
  if (k > kMostFunctions) {
    return absl::DataLossError(absl::StrCat(
        kWhat, " has k = ", k, ", expected at most ", kMostFunctions));
  }
  ISOMATCH_RETURN_IF_ERROR(CheckSize(
      bytes, sizeof(std::uint32_t) + (2 * k + k * k) * sizeof(double), kWhat));
  const auto size = static_cast<Eigen::Index>(k);
  FunctionalMap map;
  map.eigenvalues_x = TakeVector(reader, size);
  map.eigenvalues_y = TakeVector(reader, size);
  map.fmap_x_from_y.resize(size, size);
  for (Eigen::Index row = 0; row < size; ++row) {
    map.fmap_x_from_y.row(row) = TakeVector(reader, size).transpose();
  }
  return map;
}

}  // namespace isomatch
