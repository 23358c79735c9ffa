#pragma once

#include <string>

#include "isomatch/v1/service.pb.h"

namespace isomatch {

/// "first insertion" for STAGE_FIRST_INSERTION.
std::string StageLabel(v1::Stage stage);

/// "queued" for STATE_QUEUED.
std::string StateLabel(v1::Job::State state);

/// What a queued job waits for: "3 ahead", or what keeps the server from
/// starting it.
std::string WaitLabel(const v1::Job& job);

/// "good", "doubtful", "bad"; "unknown" where the server did not judge.
std::string VerdictLabel(const v1::Verdict& verdict);

/// "good (mean confidence 0.81)", or "bad (why): what to do".
std::string VerdictText(const v1::Verdict& verdict);

}  // namespace isomatch
