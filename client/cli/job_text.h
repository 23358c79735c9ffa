#pragma once

#include <string>
#include <vector>

#include <google/protobuf/message.h>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "isomatch/v1/service.pb.h"

namespace isomatch {

/// Returns a message as JSON in one line, with the field names of service.proto
/// and every field, as proto3's JSON mapping has it (64-bit numbers are
/// strings).
std::string ToJsonLine(const google::protobuf::Message& message);

/// The state that StateLabel gives `text` for, in any case. INVALID_ARGUMENT
/// lists what is allowed.
absl::StatusOr<v1::Job::State> ParseState(const std::string& text);

/// "jobs/ID" for "jobs/ID" and for "ID".
std::string FullJobName(const std::string& word);

/// What is known about one job, in lines.
std::string FormatJob(const v1::Job& job);

/// A table with a line for each job; `now` is for their age.
std::string FormatJobs(const std::vector<v1::Job>& jobs, absl::Time now);

/// What a server says about itself, in lines.
std::string FormatServerInfo(const v1::GetServerInfoResponse& info);

}  // namespace isomatch
