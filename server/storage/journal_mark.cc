#include "server/storage/journal_mark.h"

#include <fcntl.h>
#include <unistd.h>

#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "core/base/sha256.h"

namespace isomatch {
namespace {

constexpr size_t kChecksumDigits = 16;

/// Always as long, so that a new one takes the place of the old one.
std::string ToLine(const JournalMark::State& state) {
  const std::string text =
      absl::StrFormat("%020d %020d", state.commits, state.jobs);
  return absl::StrFormat("%s %s\n", text,
                         Sha256Hex(text).substr(0, kChecksumDigits));
}

}  // namespace

JournalMark::JournalMark(const std::string& path)
    : file_(FileDescriptor::Open(path, O_CREAT | O_RDWR)) {}

std::optional<JournalMark::State> JournalMark::Read() const {
  std::string line(ToLine({}).size(), '\0');
  const ssize_t got = pread(file_.get(), line.data(), line.size(), 0);
  if (got != static_cast<ssize_t>(line.size())) return std::nullopt;
  const std::vector<absl::string_view> words = absl::StrSplit(line, ' ');
  State state;
  if (words.size() != 3 || !absl::SimpleAtoi(words[0], &state.commits) ||
      !absl::SimpleAtoi(words[1], &state.jobs) || line != ToLine(state)) {
    return std::nullopt;
  }
  return state;
}

void JournalMark::Write(const State& state) {
  const std::string line = ToLine(state);
  // Half a line, or none, is no mark: see Read.
  [[maybe_unused]] const ssize_t written =
      pwrite(file_.get(), line.data(), line.size(), 0);
}

}  // namespace isomatch
