#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace isomatch {

/// What some editors write before a text in UTF-8.
inline constexpr absl::string_view kByteOrderMark = "\xEF\xBB\xBF";

/// The path that stands for standard input.
inline constexpr char kStandardInput[] = "-";

/// What a file has, unpacked.
struct InputFile {
  std::string bytes;
  /// Its name's, in lower case, without .gz: ".off" of "Cat.OFF.gz"; "" for
  /// standard input, whose content has to tell.
  std::string extension;
};

/// Returns the bytes of a file, or of standard input for "-". Those that begin
/// as gzip does are unpacked, whatever the file's name. A byte order mark is
/// left out, but of an STL, whose header may have any bytes.
///
/// INVALID_ARGUMENT, naming the path and, in packed bytes, the offset: not
/// whole, another checksum, unpacked more than MostUnpackedBytes; nothing on
/// standard input, which can be read once. Else errors as ReadFile.
absl::StatusOr<InputFile> ReadInput(const std::string& path,
                                    const std::string& what);

/// OK for "-"; of a pipe INVALID_ARGUMENT, which names "-"; else as
/// CheckInputFile.
absl::Status CheckInput(const std::string& path, const std::string& what);

/// A sixteenth of this machine's memory, since what is read of a text may take
/// several times as much, at most 2 GiB.
std::int64_t MostUnpackedBytes();

/// Returns what gzip packed, all members of it. Bytes are counted before any
/// memory is taken for them. INVALID_ARGUMENT, without a path, as ReadInput.
absl::StatusOr<std::string> Unpack(absl::string_view packed,
                                   std::int64_t most_bytes);

/// The path without .gz.
std::string WithoutGz(const std::string& path);

}  // namespace isomatch
