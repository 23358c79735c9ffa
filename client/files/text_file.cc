#include "client/files/text_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bitset>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <limits>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/base/file_bytes.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

namespace fs = std::filesystem;

std::string InQuotes(absl::string_view text) {
  return absl::StrCat("'", text, "'");
}

absl::Status OutputError(const std::string& path, int error) {
  const std::string message = absl::StrCat(
      InQuotes(path), ": cannot be written: ", std::strerror(error));
  const bool disk = error == ENOSPC || error == EIO || error == EDQUOT;
  return disk ? absl::UnavailableError(message)
              : absl::InvalidArgumentError(message);
}

// Writes to an open file, flushes it to the disk and closes it. Returns an
// errno, 0 when all went well.
int WriteAndClose(int file, absl::string_view bytes) {
  int error = WriteAll(file, bytes);
  // Pipes and devices cannot be synced, and need not.
  if (error == 0 && fsync(file) != 0 && errno != EINVAL && errno != EROFS) {
    error = errno;
  }
  return close(file) == 0 || error != 0 ? error : errno;
}

absl::Status WriteInPlace(const std::string& path, absl::string_view bytes) {
  const int file = open(path.c_str(), O_WRONLY | O_CLOEXEC);
  if (file < 0) return OutputError(path, errno);
  const int error = WriteAndClose(file, bytes);
  return error == 0 ? absl::OkStatus() : OutputError(path, error);
}

// The folder that will hold `path`.
fs::path FolderOf(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

template <typename Number>
void AppendShortest(Number number, std::string* text) {
  std::array<char, 32> digits;
  const std::to_chars_result end =
      std::to_chars(digits.data(), digits.data() + digits.size(), number);
  text->append(digits.data(), end.ptr);
}

bool IsDevice(const std::string& path) {
  std::error_code ignored;
  return fs::exists(path, ignored) && !fs::is_regular_file(path, ignored) &&
         !fs::is_directory(path, ignored);
}

}  // namespace

absl::Status CheckInputFile(const std::string& path, const std::string& what) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (status.type() == fs::file_type::not_found) {
    return absl::NotFoundError(
        absl::StrCat(InQuotes(path), ": no such file, expected ", what));
  }
  if (error || status.type() != fs::file_type::regular) {
    const char* found =
        fs::is_directory(status) ? "a directory" : "not a regular file";
    return absl::InvalidArgumentError(
        absl::StrCat(InQuotes(path), ": ", found, ", expected ", what));
  }
  if (fs::file_size(path, error) == 0) {
    return absl::InvalidArgumentError(
        absl::StrCat(InQuotes(path), ": the file is empty, expected ", what));
  }
  if (access(path.c_str(), R_OK) != 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        InQuotes(path), ": cannot be read: ", std::strerror(errno)));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> ReadFile(const std::string& path,
                                     const std::string& what) {
  ISOMATCH_RETURN_IF_ERROR(CheckInputFile(path, what));
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat about = {};
  std::string bytes;
  // One byte more would tell that it has grown meanwhile.
  const auto most = [&] { return static_cast<std::size_t>(about.st_size) + 1; };
  const bool is_read = file >= 0 && fstat(file, &about) == 0 &&
                       ReadUpTo(most(), file, &bytes) == 0;
  if (file >= 0) close(file);
  if (is_read && bytes.size() + 1 == most()) return bytes;
  return absl::InvalidArgumentError(absl::StrCat(
      InQuotes(path),
      is_read ? ": it changed while it was read, expected a file at rest"
              : ": cannot be read to its end"));
}

absl::Status CheckOutputFile(const std::string& path) {
  if (path == "-") {
    return absl::InvalidArgumentError(
        "'-': expected a file to write (./- for one of that name); of all "
        "outputs only a map goes to standard output, by -o -");
  }
  std::error_code error;
  if (fs::is_directory(path, error)) {
    return absl::InvalidArgumentError(absl::StrCat(
        InQuotes(path), ": a directory, expected a file to write"));
  }
  const fs::path folder = FolderOf(path);
  if (!fs::is_directory(folder, error)) {
    return absl::InvalidArgumentError(
        absl::StrCat(InQuotes(path), ": there is no folder ",
                     InQuotes(folder.string()), " to write it to"));
  }
  if (!IsDevice(path) && access(folder.c_str(), W_OK) != 0) {
    return OutputError(path, errno);
  }
  return absl::OkStatus();
}

absl::Status WriteFileAtomically(const std::string& path,
                                 absl::string_view bytes) {
  ISOMATCH_RETURN_IF_ERROR(CheckOutputFile(path));
  if (IsDevice(path)) return WriteInPlace(path, bytes);
  std::string temporary = absl::StrCat(path, ".XXXXXX");
  const int file = mkstemp(temporary.data());
  if (file < 0) return OutputError(path, errno);
  // What the user's umask would give a new file; mkstemp gives 0600.
  const mode_t mask = umask(0);
  umask(mask);
  fchmod(file, 0666 & ~mask);
  int error = WriteAndClose(file, bytes);
  if (error == 0 && std::rename(temporary.c_str(), path.c_str()) != 0) {
    error = errno;
  }
  if (error == 0) return absl::OkStatus();
  unlink(temporary.c_str());
  return OutputError(path, error);
}

bool LineCursor::Next() {
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('\n'), rest.size() - 1);
    line = rest.substr(0, end + 1);
    line = absl::StripAsciiWhitespace(line);
    if (has_comments_behind || absl::StartsWith(line, "#")) {
      line = absl::StripTrailingAsciiWhitespace(line.substr(0, line.find('#')));
    }
    rest.remove_prefix(end + 1);
    ++number;
    if (!line.empty()) return true;
  }
  return false;
}

absl::StatusOr<std::vector<NumberLine>> ParseNumberLines(
    const std::string& path, absl::string_view text) {
  std::vector<NumberLine> lines;
  for (LineCursor rows = {text}; rows.Next();) {
    std::vector<std::int64_t> numbers;
    for (const absl::string_view word : SplitWords(rows.line, " \t\r,")) {
      std::int64_t number = 0;
      if (!absl::SimpleAtoi(word, &number)) {
        return LineError(
            path, rows.number,
            absl::StrCat("found ", Quoted(word), ", expected a whole number"));
      }
      numbers.push_back(number);
    }
    if (!numbers.empty()) lines.push_back({rows.number, std::move(numbers)});
  }
  return lines;
}

absl::StatusOr<std::int64_t> ParseHeaderCount(absl::string_view word,
                                              const std::string& of) {
  constexpr std::int64_t kMaxCount = std::numeric_limits<std::int32_t>::max();
  std::int64_t count = 0;
  if (absl::SimpleAtoi(word, &count) && count >= 0 && count <= kMaxCount) {
    return count;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("the header's number of ", of, " is ", Quoted(word),
                   ", expected 0 to ", kMaxCount));
}

std::vector<absl::string_view> SplitWords(absl::string_view line,
                                          absl::string_view blanks) {
  std::vector<absl::string_view> words;
  SplitWordsInto(&words, line, blanks);
  return words;
}

void SplitWordsInto(std::vector<absl::string_view>* words,
                    absl::string_view line, absl::string_view blanks) {
  // absl::StrSplit takes a quarter of the time in which a mesh is read.
  std::bitset<256> is_blank;
  for (const unsigned char blank : blanks) is_blank.set(blank);
  words->clear();
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= line.size(); ++i) {
    if (i < line.size() && !is_blank[static_cast<unsigned char>(line[i])]) {
      continue;
    }
    if (i > begin) words->push_back(line.substr(begin, i - begin));
    begin = i + 1;
  }
}

std::string Quoted(absl::string_view word) {
  constexpr std::size_t kMostShown = 40;
  return InQuotes(absl::Utf8SafeCHexEscape(word.substr(0, kMostShown)));
}

void AppendNumber(double number, std::string* text) {
  AppendShortest(number, text);
}

void AppendNumber(float number, std::string* text) {
  AppendShortest(number, text);
}

std::string LowerExtension(const std::string& path) {
  return absl::AsciiStrToLower(fs::path(path).extension().string());
}

absl::Status LineError(const std::string& path, int line,
                       const std::string& what) {
  return absl::InvalidArgumentError(
      absl::StrCat(InQuotes(path), ", line ", line, ": ", what));
}

}  // namespace isomatch
