#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/base/file_descriptor.h"

namespace isomatch {

/// A small file beside a journal that says how far the journal has come, so
/// that one whose end is lost is noticed. It is written after the journal and
/// not synchronized: it may lag behind, but is never ahead of what was on disk.
///
/// Not thread-safe.
class JournalMark {
 public:
  struct State {
    /// Since the journal was made.
    std::int64_t commits = 0;
    /// Records that ever came into it.
    std::int64_t jobs = 0;
  };

  /// Opens the file, or makes it. Where that cannot be, there is no mark.
  explicit JournalMark(const std::string& path);

  /// What Write wrote last; nullopt when that is not known.
  std::optional<State> Read() const;

  /// Takes no room on disk but the first time; does nothing if that is refused.
  void Write(const State& state);

 private:
  const FileDescriptor file_;
};

}  // namespace isomatch
