#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace isomatch {

/// OK when `path` is a regular file that holds something. `what` says what the
/// caller wants of it, e.g. "a mesh".
///
/// NOT_FOUND: no such file. INVALID_ARGUMENT: a directory, empty, not readable.
/// Messages begin with the quoted path.
absl::Status CheckInputFile(const std::string& path, const std::string& what);

/// Returns the bytes of a file. Errors as CheckInputFile.
absl::StatusOr<std::string> ReadFile(const std::string& path,
                                     const std::string& what);

/// Writes `bytes` so that `path` holds either its old content or all of them: a
/// temporary file beside it, flushed to disk, then renamed. Devices such as
/// /dev/null are written in place.
///
/// INVALID_ARGUMENT: the folder does not exist or cannot be written.
/// UNAVAILABLE: the disk is full or failed.
absl::Status WriteFileAtomically(const std::string& path,
                                 absl::string_view bytes);

/// OK when WriteFileAtomically(path) can be expected to succeed; asked before
/// long work.
absl::Status CheckOutputFile(const std::string& path);

/// Goes over the lines of a text: without comments, without blanks at both
/// ends, and without those that are then empty.
struct LineCursor {
  /// What was not gone over yet; it outlives the lines.
  absl::string_view rest;
  absl::string_view line = {};
  /// 1-based, in the text.
  int number = 0;
  /// Whether a # begins a comment anywhere in a line, not only as its first
  /// letter: cells of tables may have one.
  bool has_comments_behind = true;

  /// Goes to the next line; false at the end.
  bool Next();
};

/// One line of numbers.
struct NumberLine {
  /// 1-based, in the file.
  int line;
  std::vector<std::int64_t> numbers;
};

/// Returns the lines of whole numbers separated by blanks or commas; empty
/// lines and what follows a # are left out. INVALID_ARGUMENT, naming the line,
/// for anything else. `path` is for messages only.
absl::StatusOr<std::vector<NumberLine>> ParseNumberLines(
    const std::string& path, absl::string_view text);

/// Returns what a header says is the number of `of`. INVALID_ARGUMENT, without
/// a path, for anything but 0 to 2^31 - 1.
absl::StatusOr<std::int64_t> ParseHeaderCount(absl::string_view word,
                                              const std::string& of);

/// Returns the words of a line, which `blanks` separate.
std::vector<absl::string_view> SplitWords(absl::string_view line,
                                          absl::string_view blanks = " \t\r\n");

/// The same in place of what `words` has.
void SplitWordsInto(std::vector<absl::string_view>* words,
                    absl::string_view line,
                    absl::string_view blanks = " \t\r\n");

/// The word in quotes, cut short where it is long; what a terminal would obey
/// is written out.
std::string Quoted(absl::string_view word);

/// Appends the shortest text that reads back as the same number.
void AppendNumber(double number, std::string* text);
void AppendNumber(float number, std::string* text);

/// The extension of a path in lower case, with its dot; "" for none.
std::string LowerExtension(const std::string& path);

/// An INVALID_ARGUMENT that begins with 'path', line N.
absl::Status LineError(const std::string& path, int line,
                       const std::string& what);

}  // namespace isomatch
