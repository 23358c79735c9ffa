#include "server/storage/job_record_codec.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
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

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(JobError, code, reason, message)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(StoredPart, part, sha256, bytes)

namespace {

/// The stage that `json` names: by its number or, in records of before there
/// were numbers, by its place among the stages that there were then.
std::int32_t StageOf(const nlohmann::json& json) {
  constexpr std::int32_t kNumbers[] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 10};
  const std::int32_t number = json.value("stage_number", -1);
  if (number >= 0) return number;
  const std::int32_t place = json.value("stage", -1);
  const bool is_known =
      place >= 0 && place < static_cast<std::int32_t>(std::size(kNumbers));
  return is_known ? kNumbers[place] : kNoStage;
}

}  // namespace

void to_json(nlohmann::json& json, const JobProgress& progress) {
  json = {{"stage_number", progress.stage},
          {"stage_fraction", progress.stage_fraction},
          {"total_fraction", progress.total_fraction},
          {"has_map", progress.has_map}};
}

void from_json(const nlohmann::json& json, JobProgress& progress) {
  progress = {StageOf(json), json.value("stage_fraction", 0.0),
              json.value("total_fraction", 0.0), json.value("has_map", false)};
}

void to_json(nlohmann::json& json, const StageSeconds& time) {
  json = {{"stage_number", time.stage}, {"seconds", time.seconds}};
}

void from_json(const nlohmann::json& json, StageSeconds& time) {
  time = {StageOf(json), json.value("seconds", 0.0)};
}

void to_json(nlohmann::json& json, const JobResult& result) {
  json = {{"parts", result.parts},
          {"stage_times", result.stage_times},
          {"run_seconds", result.run_seconds},
          {"peak_resident_bytes", result.peak_resident_bytes}};
  if (result.old_info.empty()) {
    const auto* begin =
        reinterpret_cast<const std::uint8_t*>(result.info.data());
    json["info"] = nlohmann::json::binary({begin, begin + result.info.size()});
  } else {
    json.update(nlohmann::json::from_cbor(result.old_info));
  }
}

void from_json(const nlohmann::json& json, JobResult& result) {
  result.parts = json.value("parts", result.parts);
  result.stage_times = json.value("stage_times", result.stage_times);
  result.run_seconds = json.value("run_seconds", 0.0);
  result.peak_resident_bytes =
      json.value("peak_resident_bytes", std::int64_t{0});
  if (json.contains("info")) {
    const auto& info = json["info"].get_binary();
    result.info.assign(info.begin(), info.end());
    return;
  }
  nlohmann::json old = json;
  for (const char* kept :
       {"parts", "stage_times", "run_seconds", "peak_resident_bytes"}) {
    old.erase(kept);
  }
  nlohmann::json::to_cbor(old, result.old_info);
}

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(
    JobRecord, id, tenant, state, progress, memory_estimate_bytes, error,
    result, create_time, start_time, end_time, aged_from, labels, request_id,
    call_id, trace_parent, request_sha256, priority, shared_priority, threads,
    attempt, faults, unresponsive, queue_timeout, run_timeout, deadline,
    cancel_when_unwatched, inputs, sequence, number)

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
