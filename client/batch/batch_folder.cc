#include "client/batch/batch_folder.h"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <system_error>

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "client/files/text_file.h"

namespace isomatch {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

/// A column of summary.csv and where a report has its number (RFC 6901).
struct Figure {
  const char* column;
  const char* pointer;
};

constexpr Figure kFigures[] = {
    {"confidence", "/quality/mean_confidence"},
    {"geodesic_distortion", "/quality/geodesic_distortion"},
    {"coverage", "/quality/coverage"},
    {"symmetry_confidence", "/symmetry_confidence"},
    {"direct", "/batch/error/direct"},
    {"best", "/batch/error/best"},
    {"vertices_x", "/mesh_x/vertices"},
    {"vertices_y", "/mesh_y/vertices"},
    {"seconds", "/total_seconds"},
};

/// The text at a pointer; nothing for none, or for anything but a text.
std::optional<std::string> TextAt(const Json& report, const char* pointer) {
  const Json::json_pointer at(pointer);
  if (!report.contains(at) || !report[at].is_string()) return std::nullopt;
  return report[at].get<std::string>();
}

/// The path of one of the pair's files; empty when it is not there.
std::string ExistingFile(const std::string& path) {
  std::error_code error;
  return fs::is_regular_file(path, error) ? path : "";
}

void ReadFigures(const Json& report, BatchFolderPair& pair) {
  for (const Figure& figure : kFigures) {
    const Json::json_pointer at(figure.pointer);
    if (report.contains(at) && report[at].is_number()) {
      pair.figures.emplace_back(figure.column, report[at].get<double>());
    }
  }
  pair.verdict = TextAt(report, "/verdict/level").value_or("");
  pair.reason = TextAt(report, "/verdict/reason").value_or("");
}

BatchFolderPair ReadPair(const fs::path& folder, const std::string& name) {
  const std::string stem = (folder / name).string();
  BatchFolderPair pair = {.name = name,
                          .map = stem + ".txt",
                          .precise = ExistingFile(stem + ".precise.txt"),
                          .confidence = ExistingFile(stem + ".confidence.txt"),
                          .mask_y = ExistingFile(stem + ".mask_y.txt"),
                          .report = stem + ".json"};
  const absl::StatusOr<std::string> bytes = ReadFile(pair.report, "a report");
  if (!bytes.ok()) {
    pair.failure = std::string(bytes.status().message());
    return pair;
  }
  const Json report = Json::parse(*bytes, nullptr, /*allow_exceptions=*/false);
  if (!report.is_object()) {
    pair.failure = absl::StrCat("'", pair.report,
                                "': not JSON, expected a report of a batch");
    return pair;
  }
  ReadFigures(report, pair);
  const std::optional<std::string> x = TextAt(report, "/batch/x");
  const std::optional<std::string> y = TextAt(report, "/batch/y");
  if (!x || !y) {
    pair.failure = absl::StrCat(
        "'", pair.report,
        "': batch.x and batch.y, the paths of the meshes, are not there; "
        "`isomatch batch --force` writes them");
    return pair;
  }
  pair.x = (folder / *x).lexically_normal().string();
  pair.y = (folder / *y).lexically_normal().string();
  return pair;
}

/// The records of comma-separated values (RFC 4180).
std::vector<std::vector<std::string>> ParseCsv(absl::string_view text) {
  std::vector<std::vector<std::string>> records;
  std::vector<std::string> record(1);
  bool is_quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char sign = text[i];
    if (sign == '"') {
      const bool is_doubled =
          is_quoted && i + 1 < text.size() && text[i + 1] == '"';
      if (is_doubled) record.back() += text[++i];
      if (!is_doubled) is_quoted = !is_quoted;
    } else if (!is_quoted && sign == ',') {
      record.emplace_back();
    } else if (!is_quoted && sign == '\n') {
      records.push_back(std::move(record));
      record.assign(1, "");
    } else if (is_quoted || sign != '\r') {
      record.back() += sign;
    }
  }
  if (record.size() > 1) records.push_back(std::move(record));
  return records;
}

/// Adds the pairs of summary.csv that are not done. A file that is none of a
/// batch adds nothing.
void AddUnfinished(const fs::path& folder,
                   std::map<std::string, BatchFolderPair>& pairs) {
  const absl::StatusOr<std::string> bytes =
      ReadFile((folder / "summary.csv").string(), "a table");
  if (!bytes.ok()) return;
  std::vector<std::vector<std::string>> records = ParseCsv(*bytes);
  if (records.empty()) return;
  const std::vector<std::string> header = records.front();
  for (std::size_t i = 1; i < records.size(); ++i) {
    std::map<std::string, std::string> cells;
    for (std::size_t c = 0; c < std::min(header.size(), records[i].size());
         ++c) {
      cells[header[c]] = records[i][c];
    }
    const std::string name = absl::StrCat(cells["x"], "__", cells["y"]);
    if (cells["x"].empty() || cells["y"].empty() || pairs.count(name) > 0) {
      continue;
    }
    const std::string& message = cells["message"];
    pairs[name] = {.name = name,
                   .x = cells["x"],
                   .y = cells["y"],
                   .failure = message.empty() ? cells["state"] : message};
  }
}

}  // namespace

absl::StatusOr<std::vector<BatchFolderPair>> ReadBatchFolder(
    const std::string& folder) {
  std::map<std::string, BatchFolderPair> pairs;
  std::error_code error;
  fs::directory_iterator entry(folder, error);
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    const fs::path path = entry->path();
    const std::string name = path.stem().string();
    if (path.extension() != ".json" || name.find("__") == std::string::npos) {
      continue;
    }
    pairs[name] = ReadPair(folder, name);
  }
  if (error) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", folder, "': cannot be read: ", error.message()));
  }
  AddUnfinished(folder, pairs);
  if (pairs.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", folder,
                     "': has no X__Y.json, expected a folder that `isomatch "
                     "batch` wrote"));
  }
  std::vector<BatchFolderPair> sorted;
  sorted.reserve(pairs.size());
  for (auto& [name, pair] : pairs) sorted.push_back(std::move(pair));
  return sorted;
}

}  // namespace isomatch
