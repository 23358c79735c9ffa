#include "server/machine/process_name.h"

#include <unistd.h>

#include "absl/strings/str_cat.h"

namespace isomatch {

std::string ProcessName(absl::string_view random) {
  constexpr std::size_t kDigits = 8;
  char host[256] = "";
  (void)gethostname(host, sizeof(host) - 1);
  return absl::StrCat(host, "-", getpid(), "-", random.substr(0, kDigits));
}

}  // namespace isomatch
