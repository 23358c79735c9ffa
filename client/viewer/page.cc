#include "client/viewer/page.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <nlohmann/json.hpp>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "client/viewer/explanations.h"
#include "core/base/status_macros.h"
#include "core/io/draco_mesh.h"

namespace isomatch {
namespace {

using Json = nlohmann::ordered_json;

static_assert(std::endian::native == std::endian::little);

/// A box side in 65535 steps: finer than any screen shows.
constexpr int kPositionBits = 16;

constexpr std::uint16_t kNoValue = 65535;

template <typename T>
std::string Base64(absl::Span<const T> values) {
  return absl::Base64Escape(absl::string_view(
      reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)));
}

std::string Base64(absl::Span<const Rgb> colors) {
  static_assert(sizeof(Rgb) == 3);
  return Base64(absl::MakeConstSpan(colors.data()->data(), 3 * colors.size()));
}

absl::StatusOr<Json> MeshJson(const NamedMesh& named) {
  const TriangleMesh normalized = {NormalizedPositions(named.mesh),
                                   named.mesh.faces};
  ISOMATCH_ASSIGN_OR_RETURN(
      const EncodedMesh encoded,
      EncodeDraco(normalized, {.position_bits = kPositionBits}));
  const bool by_id = encoded.vertex_order == VertexOrder::kIdAttribute;
  return Json{{"name", named.name},
              {"vertices", named.mesh.num_vertices()},
              {"faces", named.mesh.num_faces()},
              {"order", by_id ? "id" : "decoded"},
              {"draco", absl::Base64Escape(encoded.bytes)}};
}

/// Least and greatest number of a layer; both 0 without one.
std::pair<float, float> RangeOf(const ScalarLayer& layer) {
  std::vector<float> values = layer.on_x;
  values.insert(values.end(), layer.on_y.begin(), layer.on_y.end());
  std::erase_if(values, [](float value) { return std::isnan(value); });
  if (values.empty()) return {0, 0};
  const auto [least, greatest] =
      std::minmax_element(values.begin(), values.end());
  return {*least, *greatest};
}

std::string Quantized(const std::vector<float>& values,
                      std::pair<float, float> range) {
  std::vector<std::uint16_t> steps;
  steps.reserve(values.size());
  const double extent = double{range.second} - range.first;
  for (const float value : values) {
    const double unit = extent > 0 ? (value - range.first) / extent : 0;
    steps.push_back(std::isnan(value) ? kNoValue
                                      : static_cast<std::uint16_t>(std::lround(
                                            unit * (kNoValue - 1))));
  }
  return Base64(absl::MakeConstSpan(steps));
}

Json LayerJson(const ScalarLayer& layer) {
  const std::pair<float, float> range = RangeOf(layer);
  return {{"id", layer.id},
          {"label", layer.label},
          {"description", layer.description},
          {"low", layer.low},
          {"high", layer.high},
          {"palette", Base64(absl::MakeConstSpan(layer.palette))},
          {"range", {range.first, range.second}},
          {"x", Quantized(layer.on_x, range)},
          {"y", Quantized(layer.on_y, range)}};
}

Json MatchedJson(const std::vector<std::uint8_t>& matched) {
  if (matched.empty()) return nullptr;
  return Base64(absl::MakeConstSpan(matched));
}

Json PreciseJson(const PairView& view) {
  if (view.precise.empty()) return nullptr;
  constexpr double kOne = 65535;
  std::vector<std::int32_t> corners;
  std::vector<std::uint16_t> weights;
  for (const SurfacePoint& point : view.precise) {
    for (int i = 0; i < 3; ++i) {
      corners.push_back(point.face == kNoVertex
                            ? kNoVertex
                            : view.y.mesh.faces(point.face, i));
      weights.push_back(
          static_cast<std::uint16_t>(std::lround(kOne * point.weights[i])));
    }
  }
  return {{"corners", Base64(absl::MakeConstSpan(corners))},
          {"weights", Base64(absl::MakeConstSpan(weights))}};
}

/// Rows that stand above the shapes, not in the table "Quality".
constexpr std::pair<const char*, const char*> kVerdictRows[] = {
    {"verdict", "level"}, {"because", "reason"}, {"what to do", "advice"}};

const char* VerdictField(absl::string_view label) {
  for (const auto& [row, field] : kVerdictRows) {
    if (label == row) return field;
  }
  return nullptr;
}

Json FiguresJson(const std::vector<FigureTable>& figures) {
  Json tables = Json::array();
  for (const FigureTable& figure : figures) {
    Json rows = Json::array();
    for (const auto& [label, value] : figure.rows) {
      if (VerdictField(label) == nullptr) {
        rows.push_back(Json::array({label, value}));
      }
    }
    if (rows.empty()) continue;
    tables.push_back({{"title", figure.title}, {"rows", std::move(rows)}});
  }
  return tables;
}

Json VerdictJson(const std::vector<FigureTable>& figures) {
  Json verdict = {{"level", ""}, {"reason", ""}, {"advice", ""}};
  for (const FigureTable& figure : figures) {
    for (const auto& [label, value] : figure.rows) {
      if (const char* field = VerdictField(label)) verdict[field] = value;
    }
  }
  return verdict["level"] == "" ? Json() : verdict;
}

/// Of the labels that do not explain themselves.
Json ExplanationsJson(const std::vector<FigureTable>& figures) {
  Json texts = Json::object();
  for (const FigureTable& figure : figures) {
    for (const auto& [label, value] : figure.rows) {
      const absl::string_view text = Explanation(label);
      if (!text.empty()) texts[label] = std::string(text);
    }
  }
  return texts;
}

std::string Summary(const PairView& view) {
  return absl::StrCat("A map from X (", view.x.name, ") to Y (", view.y.name,
                      ").");
}

}  // namespace

std::string EscapeHtml(absl::string_view text) {
  return absl::StrReplaceAll(
      text, {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}});
}

absl::StatusOr<std::string> FormatPageData(const PairView& view,
                                           const PageStart& start) {
  ISOMATCH_ASSIGN_OR_RETURN(Json x, MeshJson(view.x));
  ISOMATCH_ASSIGN_OR_RETURN(Json y, MeshJson(view.y));
  Json layers = Json::array();
  for (const ScalarLayer& scalar : view.layers) {
    layers.push_back(LayerJson(scalar));
  }
  std::vector<double> rotation;
  for (const auto& row : view.rotation.rowwise()) {
    rotation.insert(rotation.end(), row.begin(), row.end());
  }
  const Json data = {{"title", view.title},
                     {"summary", Summary(view)},
                     {"layer", start.layer},
                     {"pattern", start.pattern},
                     {"verdict", VerdictJson(view.figures)},
                     {"figures", FiguresJson(view.figures)},
                     {"explanations", ExplanationsJson(view.figures)},
                     {"warnings", view.warnings},
                     {"rotation", rotation},
                     {"x", std::move(x)},
                     {"y", std::move(y)},
                     {"map", Base64(absl::MakeConstSpan(view.y_from_x))},
                     {"matched_y", MatchedJson(view.matched_y)},
                     {"precise", PreciseJson(view)},
                     {"colors", Base64(absl::MakeConstSpan(view.colors_y))},
                     {"layers", std::move(layers)}};
  // File names need not be UTF-8, and must not end the script element.
  return absl::StrReplaceAll(
      data.dump(-1, ' ', /*ensure_ascii=*/true, Json::error_handler_t::replace),
      {{"<", "\\u003c"}});
}

std::string PageWithData(absl::string_view title, absl::string_view data) {
  std::string page = absl::StrReplaceAll(
      PageTemplate(),
      {{"<!--TITLE-->", EscapeHtml(title)}, {"<!--PAIR-->", data}});
  assert(page.size() > PageTemplate().size());
  return page;
}

absl::StatusOr<std::string> FormatPage(const PairView& view,
                                       const PageStart& start) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::string data,
                            FormatPageData(view, start));
  return PageWithData(view.title, data);
}

}  // namespace isomatch
