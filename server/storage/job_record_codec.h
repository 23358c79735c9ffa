#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// Returns the record as CBOR: a map by the names of the members, so that later
/// versions can add some. All numbers come back as they were, NaN too; times
/// beyond the years 1677 to 2262 as the nearest of these.
std::string EncodeJobRecord(const JobRecord& record);

/// Reads it back; members that are not there have their defaults, and
/// bytes of strings that are not UTF-8 are replaced. DATA_LOSS: not what
/// EncodeJobRecord wrote.
absl::StatusOr<JobRecord> DecodeJobRecord(absl::string_view bytes);

}  // namespace isomatch
