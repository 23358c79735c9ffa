#include "server/engine/result_parts.h"

#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace isomatch {
namespace {

template <typename Unsigned>
void AppendLittleEndian(std::string& bytes, Unsigned value) {
  for (size_t i = 0; i < sizeof(value); ++i) {
    bytes.push_back(static_cast<char>(value >> (8 * i) & 0xFF));
  }
}

/// kNoVertex becomes 0xFFFFFFFF.
void AppendVertex(std::string& bytes, VertexIndex vertex) {
  AppendLittleEndian(bytes, static_cast<std::uint32_t>(vertex));
}

void AppendFloat(std::string& bytes, float value) {
  AppendLittleEndian(bytes, std::bit_cast<std::uint32_t>(value));
}

void AppendDouble(std::string& bytes, double value) {
  AppendLittleEndian(bytes, std::bit_cast<std::uint64_t>(value));
}

std::string EncodeMap(const VertexMap& y_from_x) {
  std::string bytes;
  bytes.reserve(y_from_x.size() * sizeof(std::uint32_t));
  for (const VertexIndex y : y_from_x) AppendVertex(bytes, y);
  return bytes;
}

std::string EncodePreciseMap(const std::vector<PrecisePoint>& points) {
  constexpr size_t kPointBytes = 3 * (sizeof(std::uint32_t) + sizeof(float));
  std::string bytes;
  bytes.reserve(points.size() * kPointBytes);
  for (const PrecisePoint& point : points) {
    for (const VertexIndex y : point.vertices) AppendVertex(bytes, y);
    for (const double weight : point.weights) {
      AppendFloat(bytes, static_cast<float>(weight));
    }
  }
  return bytes;
}

std::string EncodeConfidence(const std::vector<float>& confidence) {
  std::string bytes;
  bytes.reserve(confidence.size() * sizeof(float));
  for (const float value : confidence) AppendFloat(bytes, value);
  return bytes;
}

std::string EncodeFunctionalMap(const Correspondence& found) {
  std::string bytes;
  AppendLittleEndian(bytes,
                     static_cast<std::uint32_t>(found.functional_map.rows()));
  for (const double value : found.eigenvalues_x) AppendDouble(bytes, value);
  for (const double value : found.eigenvalues_y) AppendDouble(bytes, value);
  for (const double value : found.functional_map.reshaped<Eigen::RowMajor>()) {
    AppendDouble(bytes, value);
  }
  return bytes;
}

}  // namespace

std::vector<EncodedPart> EncodeParts(const Correspondence& found) {
  std::vector<EncodedPart> parts;
  parts.push_back({ResultPart::kMap, EncodeMap(found.y_from_x)});
  if (!found.precise.empty()) {
    parts.push_back({ResultPart::kPreciseMap, EncodePreciseMap(found.precise)});
  }
  if (!found.confidence.empty()) {
    parts.push_back(
        {ResultPart::kConfidence, EncodeConfidence(found.confidence)});
  }
  if (!found.alternatives.empty()) {
    parts.push_back({ResultPart::kAlternativeMap,
                     EncodeMap(found.alternatives.front().y_from_x)});
  }
  if (found.functional_map.size() > 0) {
    parts.push_back({ResultPart::kFunctionalMap, EncodeFunctionalMap(found)});
  }
  return parts;
}

}  // namespace isomatch
