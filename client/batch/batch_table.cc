#include "client/batch/batch_table.h"

#include <algorithm>

#include <nlohmann/json.hpp>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"

namespace isomatch {
namespace {

using Json = nlohmann::ordered_json;

const char* StateName(BatchState state) {
  switch (state) {
    case BatchState::kWaiting:
      return "waiting";
    case BatchState::kDone:
      return "done";
    case BatchState::kKept:
      return "kept";
    case BatchState::kFailed:
      return "failed";
  }
  return "";
}

bool HasMap(const BatchRow& row) {
  return row.state == BatchState::kDone || row.state == BatchState::kKept;
}

std::string FormatError(const std::optional<BatchError>& error,
                        double BatchError::*which) {
  return error ? absl::StrFormat("%.4f", (*error).*which) : "";
}

// The columns of a row, in the order of `kColumns`; empty where unknown.
constexpr const char* kColumns[] = {
    "x",           "y",          "state",
    "vertices_x",  "vertices_y", "seconds",
    "direct",      "best",       "geodesic_distortion",
    "coverage",    "confidence", "symmetry_confidence",
    "orientation", "verdict",    "message"};

std::vector<std::string> Cells(const BatchRow& row) {
  std::vector<std::string> cells = {row.x, row.y, StateName(row.state)};
  if (!HasMap(row)) {
    cells.resize(std::size(kColumns) - 1);
    cells.push_back(row.message);
    return cells;
  }
  cells.push_back(absl::StrCat(row.vertices_x));
  cells.push_back(absl::StrCat(row.vertices_y));
  cells.push_back(absl::StrFormat("%.2f", row.seconds));
  cells.push_back(FormatError(row.error, &BatchError::direct));
  cells.push_back(FormatError(row.error, &BatchError::best));
  cells.push_back(absl::StrFormat("%.4f", row.geodesic_distortion));
  cells.push_back(absl::StrFormat("%.3f", row.coverage));
  cells.push_back(absl::StrFormat("%.3f", row.mean_confidence));
  cells.push_back(absl::StrFormat("%.2f", row.symmetry_confidence));
  cells.push_back(absl::StrFormat("%.2f", row.orientation_score));
  cells.push_back(row.verdict);
  cells.push_back(row.message);
  return cells;
}

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

std::string Errors(const std::vector<BatchRow>& rows) {
  std::vector<double> direct;
  std::vector<double> best;
  for (const BatchRow& row : rows) {
    if (!row.error) continue;
    direct.push_back(row.error->direct);
    best.push_back(row.error->best);
  }
  if (direct.empty()) return "";
  return absl::StrFormat(
      "; error / diameter of Y over %d pairs: direct mean %.4f, best mean %.4f",
      direct.size(), Mean(direct), Mean(best));
}

std::string SummaryLine(const std::vector<BatchRow>& rows) {
  const auto count = [&](BatchState state) {
    return std::count_if(
        rows.begin(), rows.end(),
        [state](const BatchRow& row) { return row.state == state; });
  };
  std::string line =
      absl::StrFormat("%d pairs: %d done, %d kept from before, %d failed",
                      rows.size(), count(BatchState::kDone),
                      count(BatchState::kKept), count(BatchState::kFailed));
  for (const char* const level : {"doubtful", "bad"}) {
    const auto judged =
        std::count_if(rows.begin(), rows.end(), [level](const BatchRow& row) {
          return HasMap(row) && row.verdict == level;
        });
    if (judged > 0) absl::StrAppend(&line, ", ", judged, " ", level);
  }
  if (const auto waiting = count(BatchState::kWaiting); waiting > 0) {
    absl::StrAppend(&line, ", ", waiting, " waiting");
  }
  return absl::StrCat(line, Errors(rows), "\n");
}

// A cell of a CSV file (RFC 4180).
std::string Quoted(const std::string& cell) {
  if (cell.find_first_of(",\"\r\n") == std::string::npos) return cell;
  return absl::StrCat("\"", absl::StrReplaceAll(cell, {{"\"", "\"\""}}), "\"");
}

}  // namespace

void SetFigures(const BatchRecord& record, BatchRow* row) {
  const Json& report = record.report();
  const Json& quality = report["quality"];
  row->vertices_x = report["mesh_x"]["vertices"];
  row->vertices_y = report["mesh_y"]["vertices"];
  row->seconds = report["total_seconds"];
  row->geodesic_distortion = quality["geodesic_distortion"];
  row->coverage = quality["coverage"];
  row->mean_confidence = quality["mean_confidence"];
  row->symmetry_confidence = report["symmetry_confidence"];
  row->orientation_score = report["orientation_score"];
  row->verdict =
      report.value("verdict", Json::object()).value("level", std::string());
  row->error = record.error();
}

std::string FormatBatchTable(const std::vector<BatchRow>& rows) {
  std::vector<std::vector<std::string>> table = {
      {"X", "Y", "state", "n_X", "n_Y", "seconds", "direct", "best",
       "distortion", "coverage", "confidence", "symmetry", "orient", "verdict",
       ""}};
  for (const BatchRow& row : rows) table.push_back(Cells(row));
  std::vector<std::size_t> widths(table[0].size(), 0);
  for (const std::vector<std::string>& cells : table) {
    for (std::size_t i = 0; i < cells.size(); ++i) {
      widths[i] = std::max(widths[i], cells[i].size());
    }
  }
  constexpr std::size_t kTextColumns = 3;
  std::string text;
  for (const std::vector<std::string>& cells : table) {
    std::string line;
    for (std::size_t i = 0; i + 1 < cells.size(); ++i) {
      const int width = static_cast<int>(widths[i]);
      absl::StrAppendFormat(&line, "%*s  ", i < kTextColumns ? -width : width,
                            cells[i]);
    }
    absl::StrAppend(&line, cells.back());
    absl::StripTrailingAsciiWhitespace(&line);
    absl::StrAppend(&text, line, "\n");
  }
  return absl::StrCat(text, "\n", SummaryLine(rows));
}

std::string FormatBatchCsv(const std::vector<BatchRow>& rows) {
  std::string text = absl::StrJoin(kColumns, ",") + "\n";
  for (const BatchRow& row : rows) {
    std::vector<std::string> cells;
    for (const std::string& cell : Cells(row)) cells.push_back(Quoted(cell));
    absl::StrAppend(&text, absl::StrJoin(cells, ","), "\n");
  }
  return text;
}

std::string FormatBatchJson(const std::vector<BatchRow>& rows) {
  std::string text;
  for (const BatchRow& row : rows) {
    Json json = {{"x", row.x}, {"y", row.y}, {"state", StateName(row.state)}};
    if (HasMap(row)) {
      json.update({{"vertices_x", row.vertices_x},
                   {"vertices_y", row.vertices_y},
                   {"seconds", row.seconds},
                   {"geodesic_distortion", row.geodesic_distortion},
                   {"coverage", row.coverage},
                   {"confidence", row.mean_confidence},
                   {"symmetry_confidence", row.symmetry_confidence},
                   {"orientation", row.orientation_score},
                   {"verdict", row.verdict}});
    }
    if (row.error) {
      json["direct"] = row.error->direct;
      json["best"] = row.error->best;
    }
    if (!row.message.empty()) json["message"] = row.message;
    absl::StrAppend(
        &text, json.dump(-1, ' ', false, Json::error_handler_t::replace), "\n");
  }
  return text;
}

}  // namespace isomatch
