#pragma once

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/cli/terminal.h"

namespace isomatch {

/// Makes a folder of one's own for files of this moment and returns its path.
/// UNAVAILABLE: there is no place for it.
absl::StatusOr<std::string> MakeTemporaryFolder();

/// Opens a page in the person's browser by xdg-open, which is not waited for,
/// and says where the page is. Where there is no display or no xdg-open, says
/// how to open it instead. Errors as Print.
absl::Status OpenPage(const std::string& path, const Terminal& terminal);

}  // namespace isomatch
