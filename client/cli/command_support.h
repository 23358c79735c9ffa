#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "absl/status/status.h"
#include "client/cli/terminal.h"

namespace CLI {
class App;
}  // namespace CLI

namespace isomatch {

/// Adds --weld; `weld` outlives `command`.
void AddWeldOption(CLI::App* command, std::string* weld);

/// INVALID_ARGUMENT unless the extension of `path`, in any case, is one of
/// `allowed`; "" allows a name without one, as devices have, and with one that
/// is of no format known, as in "map_0.5" and "map.v2". "" passes for no path.
absl::Status CheckExtension(const std::string& option, const std::string& path,
                            const std::vector<std::string>& allowed);

/// What a file of lines may be called.
inline const std::vector<std::string> kTextExtensions = {".txt", ""};
inline const std::vector<std::string> kJsonExtensions = {".json", ""};

/// Prints `json` for machines, indented. File names in it need not be UTF-8.
/// Errors as Print.
absl::Status PrintJson(const nlohmann::ordered_json& json,
                       const Terminal& terminal);

/// INVALID_ARGUMENT when `output`, the value of `option`, is one of the files
/// that are read.
absl::Status CheckNotInput(const std::string& option, const std::string& output,
                           const std::vector<std::string>& inputs);

}  // namespace isomatch
