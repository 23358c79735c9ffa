#include "client/files/input_file.h"

#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <limits>
#include <system_error>
#include <utility>

#include "absl/functional/function_ref.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "client/files/text_file.h"
#include "core/base/status_macros.h"

namespace isomatch {
namespace {

constexpr absl::string_view kGzipMagic = "\x1f\x8b";
constexpr std::size_t kBlock = std::size_t{1} << 16;

std::string Limit(std::int64_t most_bytes) {
  return absl::StrCat("expected at most ", most_bytes,
                      " bytes, which this machine's memory bears");
}

// The inflater of zlib, which has to be ended.
class Inflater {
 public:
  Inflater() {
    constexpr int kGzipOnly = 16;
    is_ready_ = inflateInit2(&stream_, MAX_WBITS + kGzipOnly) == Z_OK;
  }
  ~Inflater() { inflateEnd(&stream_); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;

  // Hands out what `packed` holds, block by block.
  absl::Status Run(absl::string_view packed,
                   absl::FunctionRef<absl::Status(absl::string_view)> take) {
    if (!is_ready_) return absl::ResourceExhaustedError("no memory for zlib");
    std::array<char, kBlock> block;
    std::size_t next = 0;
    while (true) {
      const std::size_t size = std::min<std::size_t>(
          packed.size() - next, std::numeric_limits<uInt>::max());
      stream_.next_in =
          reinterpret_cast<Bytef*>(const_cast<char*>(packed.data() + next));
      stream_.avail_in = static_cast<uInt>(size);
      stream_.next_out = reinterpret_cast<Bytef*>(block.data());
      stream_.avail_out = static_cast<uInt>(block.size());
      const int code = inflate(&stream_, Z_NO_FLUSH);
      next += size - stream_.avail_in;
      ISOMATCH_RETURN_IF_ERROR(
          take({block.data(), block.size() - stream_.avail_out}));
      if (code == Z_STREAM_END) {
        // Files may be joined; what follows and is no gzip is padding.
        if (!absl::StartsWith(packed.substr(next), kGzipMagic)) break;
        inflateReset(&stream_);
      } else if (code != Z_OK) {
        return Fault(code, next);
      }
    }
    return absl::OkStatus();
  }

 private:
  absl::Status Fault(int code, std::size_t at) const {
    if (code == Z_BUF_ERROR) {
      return absl::InvalidArgumentError(absl::StrCat(
          "byte ", at, " of the packed file: it ends there, expected more"));
    }
    return absl::InvalidArgumentError(
        absl::StrCat("byte ", at, " of the packed file: ",
                     stream_.msg == nullptr ? "not gzip" : stream_.msg,
                     ", expected bytes as gzip writes them"));
  }

  z_stream stream_ = {};
  bool is_ready_ = false;
};

absl::StatusOr<std::string> ReadStandardInput(const std::string& what) {
  // Where it was closed, a library's first file may have its number: an event,
  // which is of no type.
  struct stat about = {};
  if (fstat(STDIN_FILENO, &about) != 0 || (about.st_mode & S_IFMT) == 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("standard input is closed, expected ", what));
  }
  const std::int64_t most = MostUnpackedBytes();
  std::string bytes;
  std::array<char, kBlock> block;
  while (true) {
    const ssize_t count = read(STDIN_FILENO, block.data(), block.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) {
      return absl::InvalidArgumentError(absl::StrCat(
          "standard input cannot be read: ", std::strerror(errno)));
    }
    if (count == 0) break;
    bytes.append(block.data(), static_cast<std::size_t>(count));
    if (static_cast<std::int64_t>(bytes.size()) > most) {
      return absl::InvalidArgumentError(
          absl::StrCat("standard input does not end, ", Limit(most)));
    }
  }
  if (!bytes.empty()) return bytes;
  return absl::InvalidArgumentError(
      absl::StrCat("standard input has nothing, or was read before; expected ",
                   what, ", and '-' once"));
}

}  // namespace

std::int64_t MostUnpackedBytes() {
  constexpr std::int64_t kMost = std::int64_t{2} << 30;
  constexpr std::int64_t kParts = 16;
  const std::int64_t pages = sysconf(_SC_PHYS_PAGES);
  const std::int64_t memory = pages * sysconf(_SC_PAGESIZE);
  return memory <= 0 ? kMost : std::min(kMost, memory / kParts);
}

absl::StatusOr<std::string> Unpack(absl::string_view packed,
                                   std::int64_t most_bytes) {
  std::int64_t total = 0;
  ISOMATCH_RETURN_IF_ERROR(
      Inflater().Run(packed, [&](absl::string_view block) -> absl::Status {
        total += static_cast<std::int64_t>(block.size());
        if (total <= most_bytes) return absl::OkStatus();
        return absl::InvalidArgumentError(
            absl::StrCat("unpacked it is larger, ", Limit(most_bytes)));
      }));
  std::string bytes;
  bytes.reserve(static_cast<std::size_t>(total));
  ISOMATCH_RETURN_IF_ERROR(Inflater().Run(packed, [&](absl::string_view block) {
    absl::StrAppend(&bytes, block);
    return absl::OkStatus();
  }));
  return bytes;
}

std::string WithoutGz(const std::string& path) {
  constexpr absl::string_view kExtension = ".gz";
  return LowerExtension(path) == kExtension
             ? path.substr(0, path.size() - kExtension.size())
             : path;
}

absl::Status CheckInput(const std::string& path, const std::string& what) {
  if (path == kStandardInput) return absl::OkStatus();
  std::error_code ignored;
  if (std::filesystem::is_fifo(path, ignored)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "'", path, "': a pipe, expected ", what,
        "; what another command writes is read from standard input, by -"));
  }
  return CheckInputFile(path, what);
}

absl::StatusOr<InputFile> ReadInput(const std::string& path,
                                    const std::string& what) {
  const bool is_file = path != kStandardInput;
  ISOMATCH_ASSIGN_OR_RETURN(std::string bytes, is_file
                                                   ? ReadFile(path, what)
                                                   : ReadStandardInput(what));
  if (absl::StartsWith(bytes, kGzipMagic)) {
    absl::StatusOr<std::string> unpacked = Unpack(bytes, MostUnpackedBytes());
    if (!unpacked.ok()) {
      return absl::Status(
          unpacked.status().code(),
          absl::StrCat("'", path, "': ", unpacked.status().message()));
    }
    if (unpacked->empty()) {
      return absl::InvalidArgumentError(
          absl::StrCat("'", path, "': the file is empty, expected ", what));
    }
    bytes = *std::move(unpacked);
  }
  std::string extension = is_file ? LowerExtension(WithoutGz(path)) : "";
  // The header of a binary STL may have any bytes.
  if (extension != ".stl" && absl::StartsWith(bytes, kByteOrderMark)) {
    bytes.erase(0, kByteOrderMark.size());
  }
  return InputFile{std::move(bytes), std::move(extension)};
}

}  // namespace isomatch
