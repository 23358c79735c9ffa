#pragma once

#include <string>

#include "isomatch/v1/service.pb.h"

namespace isomatch {

/// "good", "doubtful", "bad"; "unknown" where the server did not judge.
std::string VerdictLabel(const v1::Verdict& verdict);

/// "good (mean confidence 0.81)", or "bad (why): what to do".
std::string VerdictText(const v1::Verdict& verdict);

}  // namespace isomatch
