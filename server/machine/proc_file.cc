#include "server/machine/proc_file.h"

#include <fstream>
#include <limits>

#include "absl/strings/str_cat.h"

namespace isomatch {

std::optional<std::int64_t> ReadProcBytes(const std::string& path,
                                          absl::string_view key) {
  std::ifstream file(path);
  const std::string wanted = absl::StrCat(key, ":");
  std::string word;
  std::int64_t kibibytes = 0;
  while (file >> word) {
    if (word == wanted && file >> kibibytes) return kibibytes * 1024;
    file.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  }
  return std::nullopt;
}

}  // namespace isomatch
