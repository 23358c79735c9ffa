#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/api/isomatch_client.h"
#include "client/batch/batch_list.h"

namespace isomatch {

/// Mean geodesic errors of a map, as fractions of Y's diameter.
struct BatchError {
  double direct = 0;
  /// The better of the truth and the mirrored truth; `direct` without one.
  double best = 0;
};

/// What a pair gets beside its map.
struct BatchParts {
  /// NAME.precise.txt, NAME.confidence.txt and NAME.mask_y.txt, as `match`
  /// writes them.
  bool precise = false;
  bool confidence = false;
  bool mask_y = false;
};

/// What a batch has of one pair on disk: NAME.txt, the map, the files of its
/// parts, and NAME.json, the report of `match` with an object `batch`, which
/// has the meshes' paths from the folder as `x` and `y`. NAME.json is written
/// last, so a pair that has it is done.
class BatchRecord {  // NOLINT: moving a json of nlohmann throws nothing
 public:
  /// The record of `pair` in `folder`. `options` is a text of everything that
  /// decides what the map is, beside the files.
  /// Errors: one of the pair's files cannot be read.
  static absl::StatusOr<BatchRecord> Make(const std::string& folder,
                                          const BatchPair& pair,
                                          const std::string& options,
                                          const BatchParts& parts = {});

  std::string map_path() const { return stem_ + ".txt"; }
  std::string precise_path() const { return stem_ + ".precise.txt"; }
  std::string confidence_path() const { return stem_ + ".confidence.txt"; }
  std::string mask_y_path() const { return stem_ + ".mask_y.txt"; }
  std::string report_path() const { return stem_ + ".json"; }

  /// Reads what is there. False unless it was made from the same files with the
  /// same options, and map and parts are as they were written.
  bool Load();

  /// Writes map, parts and report. UNIMPLEMENTED when the result has no such
  /// part.
  absl::Status Save(const MatchResult& result, const TriangleMesh& mesh_y,
                    const std::vector<std::string>& warnings);

  /// The error that was measured against the pair's truth as it is now.
  std::optional<BatchError> error() const;
  absl::Status SaveError(const BatchError& error);

  /// REQUIRES: Load() was true, or Save was OK.
  const nlohmann::ordered_json& report() const { return report_; }

 private:
  absl::Status WriteReport() const;
  /// The paths of the parts that are wanted, by their key in the report.
  std::vector<std::pair<std::string, std::string>> PartPaths() const;
  /// What the file of a part holds; nullopt when the result has no such part.
  std::optional<std::string> PartText(const std::string& path,
                                      const MatchResult& result,
                                      const TriangleMesh& mesh_y) const;

  std::string stem_;
  /// The meshes' paths, from the folder.
  std::string x_;
  std::string y_;
  BatchParts parts_;
  /// SHA-256 of what the map is made from, and of the truth ("" for none).
  std::string fingerprint_;
  std::string truth_sha256_;
  nlohmann::ordered_json report_;
};

}  // namespace isomatch
