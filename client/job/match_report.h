#pragma once

#include <string>
#include <vector>

#include "client/api/isomatch_client.h"

namespace isomatch {

/// Returns the text of REPORT.json; client/README.md lists its fields.
/// `warnings` are those of reading the files.
std::string FormatReport(const MatchResult& result,
                         const std::vector<std::string>& warnings);

}  // namespace isomatch
