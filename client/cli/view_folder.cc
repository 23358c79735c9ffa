#include "client/cli/view_folder.h"

#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/batch/batch_folder.h"
#include "client/cli/view_pair.h"
#include "client/files/text_file.h"
#include "client/picture/image.h"
#include "client/viewer/folder_page.h"
#include "client/viewer/picture.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

constexpr int kPictureWidth = 240;
constexpr int kPictureHeight = 120;

/// Fills in what is shown of a pair.
absl::Status ShowPair(const BatchFolderPair& pair,
                      const FolderViewOptions& options,
                      const Terminal& terminal, FolderEntry& entry) {
  const ViewFiles files = {
      .x = pair.x,
      .y = pair.y,
      .map = pair.precise.empty() ? pair.map : pair.precise,
      .confidence = pair.confidence,
      .mask_y = pair.mask_y,
      .report = pair.report,
      .up = options.up,
      .weld = options.weld};
  ISOMATCH_ASSIGN_OR_RETURN(const PairView view, LoadPairView(files, terminal));
  PageStart start = options.start;
  if (FindLayer(view, start.layer) == nullptr) start.layer = PageStart().layer;
  ISOMATCH_ASSIGN_OR_RETURN(entry.data, FormatPageData(view, start));
  ISOMATCH_ASSIGN_OR_RETURN(entry.png,
                            EncodePng(DrawPair(view, {.width = kPictureWidth,
                                                      .height = kPictureHeight,
                                                      .layer = start.layer})));
  return absl::OkStatus();
}

/// The pages of a folder's pairs, while they are made.
class FolderPages {
 public:
  explicit FolderPages(const FolderViewOptions& options) : options_(options) {
    const fs::path page = options.page;
    folder_ = page.parent_path() / (page.stem().string() + "_pairs");
  }

  /// Adds an entry. When all take too much, each gets a page of its own.
  absl::Status Add(FolderEntry entry) {
    entries_.push_back(std::move(entry));
    bytes_ += static_cast<std::int64_t>(entries_.back().data.size());
    if (bytes_ <= options_.embedded_bytes) return absl::OkStatus();
    for (FolderEntry& shown : entries_) {
      ISOMATCH_RETURN_IF_ERROR(MovePage(shown));
    }
    return absl::OkStatus();
  }

  /// "" when there are no pages.
  std::string folder() const { return has_folder_ ? folder_.string() : ""; }
  const std::vector<FolderEntry>& entries() const { return entries_; }

 private:
  /// Does nothing for an entry without data.
  absl::Status MovePage(FolderEntry& entry) {
    if (entry.data.empty()) return absl::OkStatus();
    std::error_code error;
    fs::create_directories(folder_, error);
    if (error) {
      return absl::InvalidArgumentError(absl::StrCat(
          "'", folder_.string(),
          "': cannot be made, expected a folder for pages: ", error.message()));
    }
    has_folder_ = true;
    const std::string file = entry.name + ".html";
    ISOMATCH_RETURN_IF_ERROR(WriteFileAtomically(
        (folder_ / file).string(),
        PageWithData(absl::StrCat(entry.x, " \u2192 ", entry.y), entry.data)));
    entry.page = absl::StrCat(folder_.filename().string(), "/", file);
    entry.data.clear();
    return absl::OkStatus();
  }

  const FolderViewOptions& options_;
  fs::path folder_;
  bool has_folder_ = false;
  std::int64_t bytes_ = 0;
  std::vector<FolderEntry> entries_;
};

std::string TitleOf(const FolderViewOptions& options) {
  if (!options.title.empty()) return options.title;
  std::error_code error;
  const fs::path folder = fs::weakly_canonical(options.folder, error);
  return folder.filename().string();
}

}  // namespace

absl::StatusOr<FolderViewOutcome> WriteFolderPage(
    const FolderViewOptions& options, const Terminal& terminal) {
  ISOMATCH_ASSIGN_OR_RETURN(const std::vector<BatchFolderPair> pairs,
                            ReadBatchFolder(options.folder));
  FolderPages pages(options);
  FolderViewOutcome outcome = {.pairs = static_cast<int>(pairs.size())};
  for (const BatchFolderPair& pair : pairs) {
    if (terminal.stop.stop_requested()) {
      return absl::CancelledError("interrupted; no page was written");
    }
    TellWaiting(terminal, absl::StrCat("reading ", pair.name));
    FolderEntry entry = {.name = pair.name,
                         .x = fs::path(pair.x).filename().string(),
                         .y = fs::path(pair.y).filename().string(),
                         .verdict = pair.verdict,
                         .reason = pair.reason,
                         .figures = pair.figures,
                         .failure = pair.failure};
    if (entry.failure.empty()) {
      const absl::Status shown = ShowPair(pair, options, terminal, entry);
      if (!shown.ok()) entry.failure = std::string(shown.message());
    }
    if (!entry.failure.empty()) {
      entry.data.clear();
      outcome.failures.push_back(absl::StrCat(entry.name, ": ", entry.failure));
    }
    ISOMATCH_RETURN_IF_ERROR(pages.Add(std::move(entry)));
  }
  if (outcome.failures.size() == pairs.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", options.folder, "': none of ", pairs.size(),
                     " pairs can be shown; ", outcome.failures.front()));
  }
  outcome.pages = pages.folder();
  ISOMATCH_RETURN_IF_ERROR(WriteFileAtomically(
      options.page, FormatFolderPage(TitleOf(options), pages.entries())));
  return outcome;
}

}  // namespace isomatch
