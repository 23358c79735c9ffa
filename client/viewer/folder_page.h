#pragma once

#include <string>
#include <utility>
#include <vector>

#include "absl/strings/string_view.h"

namespace isomatch {

/// One line of a page about many pairs.
struct FolderEntry {
  /// Unique.
  std::string name = {};
  std::string x = {};
  std::string y = {};
  std::string verdict = {};
  /// Of the verdict.
  std::string reason = {};
  /// Names and numbers, as BatchFolderPair has them.
  std::vector<std::pair<std::string, double>> figures = {};
  /// Why the pair cannot be shown; empty when it can.
  std::string failure = {};
  /// A small picture of the pair, as PNG; empty for none.
  std::string png = {};
  /// What FormatPageData returned; empty when the pair has a page of its own.
  std::string data = {};
  /// That page, relative to this one, with / between folders.
  std::string page = {};
};

/// The page without its data, built by client/viewer/build.js; in the binary.
absl::string_view FolderTemplate();

/// Returns one HTML document with a sortable list of pairs, each opened in it
/// with all that its own page has. Entries with `data` need no other file.
std::string FormatFolderPage(absl::string_view title,
                             const std::vector<FolderEntry>& entries);

}  // namespace isomatch
