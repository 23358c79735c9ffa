#pragma once

#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/cli/terminal.h"
#include "client/viewer/pair_view.h"

namespace isomatch {

/// What is shown of one pair; paths, "" for none.
struct ViewFiles {
  std::string x = {};
  std::string y = {};
  /// A map or a --precise file.
  std::string map = {};
  std::string confidence = {};
  std::string mask_y = {};
  std::string truth = {};
  std::string report = {};
  std::string title = {};
  /// Of --up: "x", "y", "z", or "".
  std::string up = {};
  /// Of --weld.
  std::string weld = {};
  /// Shows the vertex colors that the files of X and Y have.
  bool file_colors = false;
};

/// Reads and measures all that a page or picture shows. Long work is told to a
/// person who waits.
///
/// INVALID_ARGUMENT or NOT_FOUND, naming file and line, for what is wrong with
/// a file. CANCELLED after terminal.stop.
absl::StatusOr<PairView> LoadPairView(const ViewFiles& files,
                                      const Terminal& terminal);

/// Tells it to a person who waits at `terminal`.
void TellWaiting(const Terminal& terminal, const std::string& what);

}  // namespace isomatch
