#include "server/storage/job_record_codec.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"

namespace nlohmann {

/// Absent is null.
template <typename T>
struct adl_serializer<std::optional<T>> {
  static void to_json(json& j, const std::optional<T>& value) {
    j = value ? json(*value) : json(nullptr);
  }
  static void from_json(const json& j, std::optional<T>& value) {
    if (j.is_null()) {
      value.reset();
    } else {
      value = j.get<T>();
    }
  }
};

/// Nanoseconds since 1970; null for the infinite past.
template <>
struct adl_serializer<absl::Time> {
  static void to_json(json& j, absl::Time value) {
    constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
    // Years 1677 to 2262; a clock may be beyond.
    const absl::Time kept = std::clamp(value, absl::FromUnixNanos(-kMost),
                                       absl::FromUnixNanos(kMost));
    j = value == absl::InfinitePast() ? json(nullptr)
                                      : json(absl::ToUnixNanos(kept));
  }
  static void from_json(const json& j, absl::Time& value) {
    value = j.is_null() ? absl::InfinitePast()
                        : absl::FromUnixNanos(j.get<std::int64_t>());
  }
};

/// Nanoseconds.
template <>
struct adl_serializer<absl::Duration> {
  static void to_json(json& j, absl::Duration value) {
    j = absl::ToInt64Nanoseconds(value);
  }
  static void from_json(const json& j, absl::Duration& value) {
    value = absl::Nanoseconds(j.get<std::int64_t>());
  }
};

}  // namespace nlohmann

namespace isomatch {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(JobProgress, stage,
                                                stage_fraction, total_fraction)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(JobError, code, reason, message)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(StageSeconds, stage, seconds)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(MeshSummary, vertices, faces,
                                                area, warnings)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(StoredPart, part, sha256, bytes)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(
    StoredScores, embedding_error, orientation_score, curvature_mismatch,
    normal_mismatch, descriptor_mismatch, stretch, landmark_contradiction,
    rank_value)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(StoredQuality,
                                                geodesic_distortion, coverage,
                                                area_distortion,
                                                mean_confidence)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(StoredVerdict, level, reason,
                                                advice)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(VertexMatch, x, y)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(StoredLandmark, landmark, kept,
                                                y_found, distance)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(
    JobResult, mesh_x, mesh_y, parts, unmatched, scores, quality, verdict,
    symmetry_confidence, alternatives, landmarks, objective, stage_times,
    run_seconds, peak_resident_bytes, warnings, profile, random_seed)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(
    JobRecord, id, tenant, state, progress, memory_estimate_bytes, error,
    result, create_time, start_time, end_time, labels, request_id, call_id,
    request_sha256, priority, shared_priority, threads, attempt, faults,
    unresponsive, queue_timeout, run_timeout, cancel_when_unwatched, inputs,
    sequence, number)

namespace {

/// Whether all strings are UTF-8, as those of answers have to be.
bool IsUtf8(const nlohmann::json& value) {
  try {
    (void)value.dump();
    return true;
  } catch (const nlohmann::json::type_error&) {
    return false;
  }
}

/// Replaces what is not UTF-8.
void RepairStrings(nlohmann::json& value) {
  using nlohmann::json;
  if (value.is_string()) {
    value =
        json::parse(value.dump(-1, ' ', false, json::error_handler_t::replace));
  }
  if (value.is_array()) {
    for (json& element : value) RepairStrings(element);
  }
  if (!value.is_object()) return;
  json repaired = json::object();
  for (auto& [key, element] : value.items()) {
    RepairStrings(element);
    json name = key;
    RepairStrings(name);
    repaired[name.get<std::string>()] = std::move(element);
  }
  value = std::move(repaired);
}

}  // namespace

std::string EncodeJobRecord(const JobRecord& record) {
  std::string bytes;
  nlohmann::json::to_cbor(nlohmann::json(record), bytes);
  return bytes;
}

absl::StatusOr<JobRecord> DecodeJobRecord(absl::string_view bytes) {
  try {
    nlohmann::json json = nlohmann::json::from_cbor(bytes.begin(), bytes.end());
    if (!IsUtf8(json)) RepairStrings(json);
    JobRecord record = json.get<JobRecord>();
    const bool known = record.state >= JobState::kQueued &&
                       record.state <= JobState::kCancelled;
    const bool whole =
        record.state != JobState::kSucceeded || record.result.has_value();
    if (known && whole && !record.id.empty()) return record;
    return absl::DataLossError(
        "a record without an id or its result, or with another state");
  } catch (const nlohmann::json::exception& error) {
    return absl::DataLossError(absl::StrCat("a record: ", error.what()));
  }
}

}  // namespace isomatch
