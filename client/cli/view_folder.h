#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/cli/terminal.h"
#include "client/viewer/page.h"

namespace isomatch {

/// A page about a folder that `isomatch batch` wrote.
struct FolderViewOptions {
  std::string folder = {};
  /// The page to write.
  std::string page = {};
  /// "" for the folder's name.
  std::string title = {};
  /// As ViewFiles has them.
  std::string up = {};
  std::string weld = {};
  /// A pair without that layer begins with "colors".
  PageStart start = {};
  /// What all pairs may take in the page itself. Beyond that each has a page
  /// of its own in a folder beside it.
  std::int64_t embedded_bytes = std::int64_t{64} << 20;
};

/// What WriteFolderPage wrote.
struct FolderViewOutcome {
  int pairs = 0;
  /// The folder of their pages; "" when all are in the page.
  std::string pages = {};
  /// Of each pair that cannot be shown, its name and why.
  std::vector<std::string> failures = {};
};

/// Reads all pairs, writes their pages or none, and last the page.
///
/// INVALID_ARGUMENT: no pair, or none that can be shown; else as
/// ReadBatchFolder and WriteFileAtomically. CANCELLED after terminal.stop.
absl::StatusOr<FolderViewOutcome> WriteFolderPage(
    const FolderViewOptions& options, const Terminal& terminal);

}  // namespace isomatch
