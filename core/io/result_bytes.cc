#include "core/io/result_bytes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

// So that numbers in memory have the bytes of those sent.
static_assert(std::endian::native == std::endian::little);
static_assert(sizeof(VertexIndex) == 4 &&
              static_cast<std::uint32_t>(kNoVertex) == 0xFFFFFFFF);

/// A PrecisePoint as it is sent.
struct SentPoint {
  std::array<VertexIndex, 3> vertices;
  std::array<float, 3> weights;
};
static_assert(sizeof(SentPoint) == 24);

template <typename Numbers>
void Append(const Numbers& numbers, std::string* bytes) {
  bytes->append(
      reinterpret_cast<const char*>(numbers.data()),
      static_cast<std::size_t>(numbers.size()) * sizeof(*numbers.data()));
}

template <typename Numbers>
std::string BytesOf(const Numbers& numbers) {
  std::string bytes;
  Append(numbers, &bytes);
  return bytes;
}

/// Fills `numbers` from the front of `bytes`. REQUIRES: there are as many.
template <typename Numbers>
void Take(absl::string_view* bytes, Numbers* numbers) {
  const std::size_t size =
      static_cast<std::size_t>(numbers->size()) * sizeof(*numbers->data());
  if (size > 0) std::memcpy(numbers->data(), bytes->data(), size);
  bytes->remove_prefix(size);
}

absl::Status CheckSize(absl::string_view bytes, std::size_t expected,
                       const char* what) {
  if (bytes.size() == expected) return absl::OkStatus();
  return absl::DataLossError(
      absl::StrCat(what, " has ", bytes.size(), " bytes, expected ", expected));
}

/// What `bytes` hold for each vertex of X.
template <typename Number>
absl::StatusOr<std::vector<Number>> ForEachVertex(absl::string_view bytes,
                                                  PairSize size,
                                                  const char* what) {
  std::vector<Number> numbers(size.vertices_x);
  ISOMATCH_RETURN_IF_ERROR(
      CheckSize(bytes, numbers.size() * sizeof(Number), what));
  Take(&bytes, &numbers);
  return numbers;
}

absl::Status CheckVertex(VertexIndex vertex, PairSize size) {
  if (kNoVertex <= vertex && vertex < size.vertices_y) return absl::OkStatus();
  return absl::DataLossError(absl::StrCat(
      "the result names vertex ", static_cast<std::uint32_t>(vertex),
      " of Y, which has ", size.vertices_y));
}

absl::Status CheckPoint(const SentPoint& point, PairSize size) {
  for (const VertexIndex vertex : point.vertices) {
    ISOMATCH_RETURN_IF_ERROR(CheckVertex(vertex, size));
  }
  const auto none =
      std::count(point.vertices.begin(), point.vertices.end(), kNoVertex);
  if (none == 0 || none == 3) return absl::OkStatus();
  return absl::DataLossError(
      "the precise map names one or two vertices of a face, expected three");
}

}  // namespace

std::string EncodeMap(const VertexMap& y_from_x) { return BytesOf(y_from_x); }

std::string EncodePreciseMap(const std::vector<PrecisePoint>& points) {
  std::vector<SentPoint> sent(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    sent[i].vertices = points[i].vertices;
    for (int corner = 0; corner < 3; ++corner) {
      sent[i].weights[corner] = static_cast<float>(points[i].weights[corner]);
    }
  }
  return BytesOf(sent);
}

std::string EncodeConfidence(const std::vector<float>& confidence) {
  return BytesOf(confidence);
}

std::string EncodeFunctionalMap(const FunctionalMap& map) {
  const std::array<std::uint32_t, 1> k = {
      static_cast<std::uint32_t>(map.fmap_x_from_y.rows())};
  std::string bytes = BytesOf(k);
  Append(map.eigenvalues_x, &bytes);
  Append(map.eigenvalues_y, &bytes);
  Append(Eigen::MatrixXd(map.fmap_x_from_y.transpose()), &bytes);
  return bytes;
}

std::string EncodeMask(const std::vector<char>& matched_y) {
  return {matched_y.begin(), matched_y.end()};
}

absl::StatusOr<VertexMap> DecodeMap(absl::string_view bytes, PairSize size) {
  ISOMATCH_ASSIGN_OR_RETURN(VertexMap map,
                            ForEachVertex<VertexIndex>(bytes, size, "the map"));
  for (const VertexIndex y : map) {
    ISOMATCH_RETURN_IF_ERROR(CheckVertex(y, size));
  }
  return map;
}

absl::StatusOr<std::vector<PrecisePoint>> DecodePreciseMap(
    absl::string_view bytes, PairSize size) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const std::vector<SentPoint> sent,
      ForEachVertex<SentPoint>(bytes, size, "the precise map"));
  std::vector<PrecisePoint> points(sent.size());
  for (std::size_t i = 0; i < sent.size(); ++i) {
    ISOMATCH_RETURN_IF_ERROR(CheckPoint(sent[i], size));
    points[i].vertices = sent[i].vertices;
    std::copy(sent[i].weights.begin(), sent[i].weights.end(),
              points[i].weights.begin());
  }
  return points;
}

absl::StatusOr<std::vector<float>> DecodeConfidence(absl::string_view bytes,
                                                    PairSize size) {
  return ForEachVertex<float>(bytes, size, "the confidence");
}

absl::StatusOr<FunctionalMap> DecodeFunctionalMap(absl::string_view bytes) {
  constexpr char kWhat[] = "the functional map";
  std::array<std::uint32_t, 1> k = {};
  if (bytes.size() < sizeof(k)) return CheckSize(bytes, sizeof(k), kWhat);
  absl::string_view rest = bytes;
  Take(&rest, &k);
  // Far above any k in use, and far from overflow.
  constexpr Eigen::Index kMostFunctions = 1 << 16;
  const Eigen::Index size = k[0];
  if (size > kMostFunctions) {
    return absl::DataLossError(absl::StrCat(
        kWhat, " has k = ", size, ", expected at most ", kMostFunctions));
  }
  const auto numbers = static_cast<std::size_t>(2 * size + size * size);
  ISOMATCH_RETURN_IF_ERROR(
      CheckSize(bytes, sizeof(k) + numbers * sizeof(double), kWhat));
  FunctionalMap map{Eigen::VectorXd(size), Eigen::VectorXd(size),
                    Eigen::MatrixXd(size, size)};
  Take(&rest, &map.eigenvalues_x);
  Take(&rest, &map.eigenvalues_y);
  Take(&rest, &map.fmap_x_from_y);
  map.fmap_x_from_y.transposeInPlace();
  return map;
}

absl::StatusOr<std::vector<char>> DecodeMask(absl::string_view bytes,
                                             PairSize size) {
  ISOMATCH_RETURN_IF_ERROR(CheckSize(
      bytes, static_cast<std::size_t>(size.vertices_y), "the mask of Y"));
  for (const char byte : bytes) {
    if (byte == 0 || byte == 1) continue;
    return absl::DataLossError(
        absl::StrCat("the mask of Y has a byte ",
                     static_cast<int>(static_cast<unsigned char>(byte)),
                     ", expected 0 or 1"));
  }
  return std::vector<char>(bytes.begin(), bytes.end());
}

}  // namespace isomatch
