#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace isomatch {

/// One pair of a batch; paths of files.
struct BatchPair {
  /// X__Y, of the files' names without folder and extension.
  std::string name;
  std::string x;
  std::string y;
  /// Empty for none: lines `x y`, or points on X and on Y.
  std::string landmarks;
  std::string points_x = {};
  std::string points_y = {};
  std::string truth;
};

/// Returns the pairs of a list: lines `X Y [LANDMARKS]` or `X Y X_POINTS
/// Y_POINTS`, # starts a comment. Blanks separate them, in a line with tabs
/// these alone; what stands between double quotes is one of them, whatever it
/// has. Paths are relative to the list's folder; a mesh's extension may be left
/// out.
///
/// INVALID_ARGUMENT, naming file and line: another number of paths, a quote
/// without its partner, a mesh that is not there, two pairs of one name.
/// NOT_FOUND: no such list.
absl::StatusOr<std::vector<BatchPair>> ReadBatchList(const std::string& path);

/// Returns a pair of `template_mesh` (X) with each mesh of `targets` (Y), which
/// are files or folders of meshes; with `reverse` the template is Y. Meshes of
/// a folder come in the order of their names; the template is not paired with
/// itself.
///
/// INVALID_ARGUMENT: a folder without meshes, two pairs of one name. NOT_FOUND:
/// no such file.
absl::StatusOr<std::vector<BatchPair>> PairWithTemplate(
    const std::string& template_mesh, const std::vector<std::string>& targets,
    bool reverse);

/// Gives each pair the truth FOLDER/gt_X__Y.txt where there is one.
/// INVALID_ARGUMENT when there is none at all.
absl::Status AddTruths(const std::string& folder,
                       std::vector<BatchPair>* pairs);

}  // namespace isomatch
