#include "client/batch/batch_record.h"

#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/files/map_file.h"
#include "client/files/text_file.h"
#include "client/job/match_report.h"
#include "client/job/part_files.h"
#include "core/base/sha256.h"
#include "core/base/status_macros.h"
#include "core/base/version.h"

namespace isomatch {
namespace {

using Json = nlohmann::ordered_json;

absl::StatusOr<std::string> HashOf(const std::string& path,
                                   const std::string& what) {
  if (path.empty()) return "";
  ISOMATCH_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, what));
  return Sha256Hex(bytes);
}

/// Where `path` is from `folder`, which stays true when both are moved.
std::string RelativePath(const std::string& path, const std::string& folder) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path relative = fs::relative(path, folder, error);
  return relative.empty() ? fs::absolute(path, error).string()
                          : relative.string();
}

std::string FileText(const std::string& path) {
  return ReadFile(path, "a result").value_or("");
}

}  // namespace

absl::StatusOr<BatchRecord> BatchRecord::Make(const std::string& folder,
                                              const BatchPair& pair,
                                              const std::string& options,
                                              const BatchParts& parts) {
  BatchRecord record;
  record.parts_ = parts;
  record.stem_ = absl::StrCat(folder, "/", pair.name);
  record.x_ = RelativePath(pair.x, folder);
  record.y_ = RelativePath(pair.y, folder);
  ISOMATCH_ASSIGN_OR_RETURN(const std::string x, HashOf(pair.x, "a mesh"));
  ISOMATCH_ASSIGN_OR_RETURN(const std::string y, HashOf(pair.y, "a mesh"));
  ISOMATCH_ASSIGN_OR_RETURN(std::string landmarks,
                            HashOf(pair.landmarks, "landmarks"));
  for (const std::string& points : {pair.points_x, pair.points_y}) {
    ISOMATCH_ASSIGN_OR_RETURN(const std::string hash, HashOf(points, "points"));
    landmarks += hash;
  }
  ISOMATCH_ASSIGN_OR_RETURN(record.truth_sha256_,
                            HashOf(pair.truth, "a ground truth"));
  record.fingerprint_ = Sha256Hex(
      absl::StrCat(kVersion, "\n", x, "\n", y, "\n", landmarks, "\n", options));
  return record;
}

bool BatchRecord::Load() {
  Json report = Json::parse(FileText(report_path()), /*cb=*/nullptr,
                            /*allow_exceptions=*/false);
  if (!report.is_object() || !report.contains("batch")) return false;
  const Json& batch = report["batch"];
  if (!batch.is_object() ||
      batch.value("fingerprint", Json()) != fingerprint_ ||
      batch.value("map_sha256", Json()) != Sha256Hex(FileText(map_path()))) {
    return false;
  }
  for (const auto& [key, path] : PartPaths()) {
    if (batch.value(key, Json()) != Sha256Hex(FileText(path))) return false;
  }
  report_ = std::move(report);
  return true;
}

std::vector<std::pair<std::string, std::string>> BatchRecord::PartPaths()
    const {
  std::vector<std::pair<std::string, std::string>> paths;
  if (parts_.precise) paths.emplace_back("precise_sha256", precise_path());
  if (parts_.confidence) {
    paths.emplace_back("confidence_sha256", confidence_path());
  }
  if (parts_.mask_y) paths.emplace_back("mask_y_sha256", mask_y_path());
  return paths;
}

std::optional<std::string> BatchRecord::PartText(
    const std::string& path, const MatchResult& result,
    const TriangleMesh& mesh_y) const {
  if (path == precise_path() && result.precise) {
    return FormatPreciseMap(*result.precise, mesh_y);
  }
  if (path == confidence_path() && result.confidence) {
    return FormatConfidence(*result.confidence);
  }
  if (path == mask_y_path() && result.matched_y) {
    return FormatMask(*result.matched_y);
  }
  return std::nullopt;
}

absl::Status BatchRecord::Save(const MatchResult& result,
                               const TriangleMesh& mesh_y,
                               const std::vector<std::string>& warnings) {
  const std::string map = FormatMap(result.y_from_x);
  ISOMATCH_RETURN_IF_ERROR(WriteFileAtomically(map_path(), map));
  report_ = Json::parse(FormatReport(result, warnings));
  report_["batch"] = {{"x", x_},
                      {"y", y_},
                      {"fingerprint", fingerprint_},
                      {"map_sha256", Sha256Hex(map)}};
  for (const auto& [key, path] : PartPaths()) {
    const std::optional<std::string> text = PartText(path, result, mesh_y);
    if (!text) {
      return absl::UnimplementedError(
          absl::StrCat("'", path,
                       "': the server's result has no such part, "
                       "expected a newer isomatch-server"));
    }
    ISOMATCH_RETURN_IF_ERROR(WriteFileAtomically(path, *text));
    report_["batch"][key] = Sha256Hex(*text);
  }
  return WriteReport();
}

std::optional<BatchError> BatchRecord::error() const {
  const Json& batch = report_["batch"];
  if (truth_sha256_.empty() || !batch.contains("error")) return std::nullopt;
  const Json& error = batch["error"];
  if (error.value("truth_sha256", "") != truth_sha256_) return std::nullopt;
  return BatchError{error.value("direct", 0.0), error.value("best", 0.0)};
}

absl::Status BatchRecord::SaveError(const BatchError& error) {
  report_["batch"]["error"] = {{"truth_sha256", truth_sha256_},
                               {"direct", error.direct},
                               {"best", error.best}};
  return WriteReport();
}

absl::Status BatchRecord::WriteReport() const {
  constexpr int kIndent = 2;
  // Paths need not be UTF-8.
  return WriteFileAtomically(report_path(),
                             report_.dump(kIndent, ' ', /*ensure_ascii=*/false,
                                          Json::error_handler_t::replace) +
                                 "\n");
}

}  // namespace isomatch
