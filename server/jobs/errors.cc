#include "server/jobs/errors.h"

#include <initializer_list>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/cord.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"

namespace isomatch {
namespace {

// Details travel as payloads of the status under these names.
constexpr char kReason[] = "isomatch/reason";
constexpr char kField[] = "isomatch/field";
constexpr char kRetryAfter[] = "isomatch/retry_after";
constexpr char kStorageFailed[] = "STORAGE_FAILED";
constexpr char kContentUnavailable[] = "CONTENT_UNAVAILABLE";
constexpr char kNeedsMoreMemory[] = "JOB_NEEDS_MORE_MEMORY_THAN_BUDGET";
constexpr char kMetadata[] = "isomatch/metadata/";

/// Disks fill and empty slowly.
constexpr absl::Duration kRetryStorageFailed = absl::Seconds(10);
constexpr absl::Duration kRetryStorageSilent = absl::Seconds(2);
constexpr absl::Duration kRetryContentUnavailable = absl::Seconds(5);
constexpr absl::Duration kRetryOutOfMemory = absl::Seconds(5);
constexpr absl::Duration kRetryStorageQuota = absl::Seconds(10);

using Metadata =
    std::initializer_list<std::pair<absl::string_view, std::string>>;

/// What callers may know of it: not where the database is. (The log says it.)
std::string ForCallers(const absl::Status& problem) {
  if (absl::IsUnavailable(problem) &&
      absl::StartsWith(problem.message(), "database: ")) {
    return "its database does not answer";
  }
  return std::string(problem.message());
}

absl::Status Make(absl::StatusCode code, absl::string_view reason,
                  const std::string& message, Metadata metadata = {}) {
  absl::Status status(code, message);
  status.SetPayload(kReason, absl::Cord(reason));
  for (const auto& [key, value] : metadata) {
    status.SetPayload(absl::StrCat(kMetadata, key), absl::Cord(value));
  }
  return status;
}

absl::Status WithField(absl::Status status, const std::string& field) {
  status.SetPayload(kField, absl::Cord(field));
  return status;
}

absl::Status WithRetry(absl::Status status, absl::Duration retry_after) {
  status.SetPayload(kRetryAfter, absl::Cord(absl::FormatDuration(retry_after)));
  return status;
}

absl::Status Invalid(absl::string_view reason, const std::string& field,
                     const std::string& problem, Metadata metadata = {}) {
  // Messages of core begin with the field already.
  const std::string message = absl::StartsWith(problem, field)
                                  ? problem
                                  : absl::StrCat(field, ": ", problem);
  return WithField(
      Make(absl::StatusCode::kInvalidArgument, reason, message, metadata),
      field);
}

absl::Status WrongState(absl::string_view reason, const std::string& id,
                        JobState state, absl::string_view expected) {
  const std::string name = JobStateName(state);
  return Make(absl::StatusCode::kFailedPrecondition, reason,
              absl::StrCat("jobs/", id, " is ", name, ", not ", expected),
              {{"job", absl::StrCat("jobs/", id)}, {"state", name}});
}

absl::Status Timeout(absl::string_view reason, absl::string_view what,
                     absl::Duration limit) {
  const std::string text = absl::FormatDuration(limit);
  return Make(absl::StatusCode::kDeadlineExceeded, reason,
              absl::StrCat(what, " for more than ", text), {{"limit", text}});
}

absl::Status NeedsMoreMemory(absl::string_view what, std::int64_t needed_bytes,
                             std::int64_t budget_bytes) {
  return Make(
      absl::StatusCode::kFailedPrecondition, kNeedsMoreMemory,
      absl::StrCat(what, " may need ", needed_bytes, " bytes, the server has ",
                   budget_bytes, " for that; retrying does not help"),
      {{"needed_bytes", absl::StrCat(needed_bytes)},
       {"budget_bytes", absl::StrCat(budget_bytes)}});
}

}  // namespace

absl::Status ApiKeyMissing() {
  return Make(absl::StatusCode::kUnauthenticated, "API_KEY_MISSING",
              "this server wants an API key, in the metadata "
              "`authorization: Bearer KEY` or `api-key: KEY`");
}

absl::Status ApiKeyWrong() {
  return Make(absl::StatusCode::kUnauthenticated, "API_KEY_WRONG",
              "this server does not know the API key of this call");
}

absl::Status RoleTooLow(Role role, Role needed) {
  return Make(absl::StatusCode::kPermissionDenied, "ROLE_TOO_LOW",
              absl::StrCat("the API key has the role ", RoleName(role),
                           ", this call needs ", RoleName(needed)),
              {{"role", RoleName(role)}, {"needed", RoleName(needed)}});
}

absl::Status InvalidField(const std::string& field,
                          const std::string& problem) {
  return Invalid("INVALID_FIELD", field, problem);
}

absl::Status MeshMalformed(const std::string& field,
                           const std::string& problem) {
  return Invalid("MESH_MALFORMED", field, problem);
}

absl::Status MeshTooLarge(const std::string& field, std::int64_t size_bytes,
                          std::int64_t limit_bytes) {
  return Invalid(
      "MESH_TOO_LARGE", field,
      absl::StrCat(size_bytes, " bytes, expected at most ", limit_bytes),
      {{"size_bytes", absl::StrCat(size_bytes)},
       {"limit_bytes", absl::StrCat(limit_bytes)}});
}

absl::Status MatchOutOfRange(const std::string& field, std::int64_t value,
                             std::int64_t vertices) {
  return Invalid(
      "MATCH_OUT_OF_RANGE", field,
      absl::StrCat(value, ", expected less than the ", vertices,
                   " vertices of the mesh"),
      {{"value", absl::StrCat(value)}, {"vertices", absl::StrCat(vertices)}});
}

absl::Status LandmarksContradict(const std::string& field,
                                 const std::string& problem) {
  return Invalid("LANDMARKS_CONTRADICT", field, problem);
}

absl::Status UploadMalformed(const std::string& problem) {
  return Invalid("UPLOAD_MALFORMED", "part", problem);
}

absl::Status UploadOffsetBeyond(std::uint64_t offset,
                                std::uint64_t received_bytes) {
  return Invalid("UPLOAD_MALFORMED", "offset",
                 absl::StrCat(offset, ", expected at most the ", received_bytes,
                              " bytes that the server has"),
                 {{"offset", absl::StrCat(offset)},
                  {"received_bytes", absl::StrCat(received_bytes)}});
}

absl::Status DigestMismatch(const std::string& expected,
                            const std::string& found) {
  return Invalid("DIGEST_MISMATCH", "header.sha256",
                 absl::StrCat("the chunks have ", found, ", not ", expected),
                 {{"expected", expected}, {"found", found}});
}

absl::Status QueueFull(std::int64_t queued_jobs, absl::Duration retry_after) {
  return WithRetry(
      Make(absl::StatusCode::kResourceExhausted, "QUEUE_FULL",
           absl::StrCat("the queue is full, ", queued_jobs, " jobs wait"),
           {{"queued_jobs", absl::StrCat(queued_jobs)}}),
      retry_after);
}

absl::Status TenantQuota(const std::string& tenant, std::int64_t queued_jobs,
                         absl::Duration retry_after) {
  return WithRetry(
      Make(absl::StatusCode::kResourceExhausted, "TENANT_QUOTA",
           absl::StrCat(queued_jobs, " jobs of ", tenant,
                        " wait, which is the most allowed"),
           {{"tenant", tenant}, {"queued_jobs", absl::StrCat(queued_jobs)}}),
      retry_after);
}

absl::Status TenantRequestsQuota(const std::string& tenant,
                                 std::int64_t requests,
                                 absl::Duration retry_after) {
  return WithRetry(
      Make(absl::StatusCode::kResourceExhausted, "TENANT_QUOTA",
           absl::StrCat(requests, " requests of ", tenant,
                        " wait, which is the most allowed"),
           {{"tenant", tenant}, {"requests", absl::StrCat(requests)}}),
      retry_after);
}

absl::Status StorageFailed(const absl::Status& problem) {
  const absl::StatusCode code = absl::IsResourceExhausted(problem)
                                    ? problem.code()
                                    : absl::StatusCode::kUnavailable;
  return WithRetry(Make(code, kStorageFailed,
                        absl::StrCat("the server cannot store the job: ",
                                     ForCallers(problem))),
                   kRetryStorageFailed);
}

absl::Status StorageSilent(const absl::Status& problem) {
  return WithRetry(
      Make(absl::StatusCode::kUnavailable, kStorageFailed,
           absl::StrCat("the server cannot read its jobs just now: ",
                        ForCallers(problem))),
      kRetryStorageSilent);
}

absl::Status StorageQuota(const std::string& tenant, std::int64_t size_bytes,
                          std::int64_t limit_bytes) {
  return WithRetry(
      Make(absl::StatusCode::kResourceExhausted, "STORAGE_QUOTA",
           absl::StrCat("no room for ", size_bytes, " bytes: ", tenant,
                        " may have ", limit_bytes,
                        " here, and jobs need what is there; wait for them, "
                        "or delete jobs that have ended"),
           {{"tenant", tenant},
            {"size_bytes", absl::StrCat(size_bytes)},
            {"limit_bytes", absl::StrCat(limit_bytes)}}),
      kRetryStorageQuota);
}

absl::Status UploadQuota(std::int64_t size_bytes, absl::Duration retry_after) {
  return WithRetry(Make(absl::StatusCode::kResourceExhausted, "UPLOAD_QUOTA",
                        absl::StrCat("no room for ", size_bytes, " bytes now"),
                        {{"size_bytes", absl::StrCat(size_bytes)}}),
                   retry_after);
}

absl::Status TenantUploadQuota(const std::string& tenant,
                               std::int64_t size_bytes,
                               std::int64_t limit_bytes,
                               absl::Duration retry_after) {
  return WithRetry(
      Make(absl::StatusCode::kResourceExhausted, "UPLOAD_QUOTA",
           absl::StrCat("no room for ", size_bytes, " bytes now: what ", tenant,
                        " is sending may take ", limit_bytes),
           {{"tenant", tenant},
            {"size_bytes", absl::StrCat(size_bytes)},
            {"limit_bytes", absl::StrCat(limit_bytes)}}),
      retry_after);
}

absl::Status TenantUploadsQuota(const std::string& tenant, std::int64_t uploads,
                                absl::Duration retry_after) {
  return WithRetry(
      Make(absl::StatusCode::kResourceExhausted, "UPLOAD_QUOTA",
           absl::StrCat(uploads, " uploads of ", tenant,
                        " are under way, which is the most allowed"),
           {{"tenant", tenant}, {"uploads", absl::StrCat(uploads)}}),
      retry_after);
}

absl::Status OutOfMemory(absl::string_view message) {
  return WithRetry(Make(absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY",
                        std::string(message)),
                   kRetryOutOfMemory);
}

absl::Status JobNeedsMoreMemoryThanBudget(std::int64_t needed_bytes,
                                          std::int64_t budget_bytes) {
  return NeedsMoreMemory("the job", needed_bytes, budget_bytes);
}

absl::Status MeshesNeedMoreMemory(std::int64_t needed_bytes,
                                  std::int64_t budget_bytes) {
  return NeedsMoreMemory("reading the meshes", needed_bytes, budget_bytes);
}

absl::Status MeshMissing(const std::string& field, const std::string& sha256) {
  return WithField(
      Make(absl::StatusCode::kFailedPrecondition, "MESH_MISSING",
           absl::StrCat(field, ": no mesh ", sha256,
                        " here; send it with UploadMesh, then try again"),
           {{"sha256", sha256}}),
      field);
}

absl::Status JobIsTerminal(const std::string& id, JobState state) {
  return WrongState("JOB_TERMINAL", id, state, "QUEUED or RUNNING");
}

absl::Status JobIsNotTerminal(const std::string& id, JobState state) {
  return WrongState("JOB_NOT_TERMINAL", id, state, "terminal");
}

absl::Status JobHasNoResult(const std::string& id, JobState state) {
  return WrongState("JOB_NOT_SUCCEEDED", id, state, "SUCCEEDED");
}

absl::Status Draining(absl::Duration retry_after) {
  return WithRetry(Make(absl::StatusCode::kUnavailable, "DRAINING",
                        "the server is stopping and takes no new jobs"),
                   retry_after);
}

absl::Status CrashedRepeatedly(int attempts) {
  return Make(absl::StatusCode::kInternal, "CRASHED_REPEATEDLY",
              absl::StrCat("the server went down ", attempts,
                           " times while the job ran"),
              {{"attempts", absl::StrCat(attempts)}});
}

absl::Status ContentLost(const std::string& id, const std::string& what) {
  return Make(absl::StatusCode::kDataLoss, "CONTENT_LOST",
              absl::StrCat("the ", what, " of jobs/", id,
                           " is damaged or not there any more; create the job "
                           "again"),
              {{"job", absl::StrCat("jobs/", id)}, {"what", what}});
}

absl::Status ContentUnavailable(const std::string& what,
                                const absl::Status& problem) {
  return WithRetry(Make(absl::StatusCode::kUnavailable, kContentUnavailable,
                        absl::StrCat("the ", what, " cannot be read just now: ",
                                     problem.message()),
                        {{"what", what}}),
                   kRetryContentUnavailable);
}

bool IsStorageFailed(const absl::Status& status) {
  return status.GetPayload(kReason) == absl::Cord(kStorageFailed);
}

bool IsNeedsMoreMemory(const absl::Status& status) {
  return status.GetPayload(kReason) == absl::Cord(kNeedsMoreMemory);
}

bool IsContentUnavailable(const absl::Status& status) {
  return status.GetPayload(kReason) == absl::Cord(kContentUnavailable);
}

absl::Status QueueTimeout(absl::Duration limit) {
  return Timeout("QUEUE_TIMEOUT", "the job waited", limit);
}

absl::Status RunTimeout(absl::Duration limit, bool is_servers) {
  const std::string text = absl::FormatDuration(limit);
  const char* const whose =
      is_servers ? "the server's --max-run-time" : "its run_timeout";
  return Make(absl::StatusCode::kDeadlineExceeded, "RUN_TIMEOUT",
              absl::StrCat("the job ran for more than ", text, ", ", whose),
              {{"limit", text}, {"limit_of", is_servers ? "server" : "job"}});
}

absl::Status Unresponsive(int faults) {
  return Make(absl::StatusCode::kInternal, "UNRESPONSIVE",
              absl::StrCat("the job did not stop when asked to, or took the "
                           "server down, ",
                           faults, " times"),
              {{"faults", absl::StrCat(faults)}});
}

absl::Status UploadIdle(absl::Duration limit, std::int64_t bytes_per_second) {
  return Timeout("UPLOAD_IDLE",
                 absl::StrCat("the upload sent less than ", bytes_per_second,
                              " bytes a second"),
                 limit);
}

absl::Status JobNotFound(const std::string& id) {
  return Make(absl::StatusCode::kNotFound, "JOB_NOT_FOUND",
              absl::StrCat("no job jobs/", id),
              {{"job", absl::StrCat("jobs/", id)}});
}

absl::Status ResultPartMissing(const std::string& id, ResultPart part) {
  const std::string name = ResultPartName(part);
  return WithField(
      Make(absl::StatusCode::kNotFound, "RESULT_PART_MISSING",
           absl::StrCat("the result of jobs/", id, " has no part ", name),
           {{"job", absl::StrCat("jobs/", id)}, {"part", name}}),
      "part");
}

absl::Status RequestIdReused(const std::string& request_id) {
  return WithField(Make(absl::StatusCode::kAlreadyExists, "REQUEST_ID_REUSED",
                        absl::StrCat("request_id ", request_id,
                                     " came before with another request"),
                        {{"request_id", request_id}}),
                   "request_id");
}

absl::Status OffsetOutOfRange(std::uint64_t offset, std::int64_t size_bytes) {
  return WithField(Make(absl::StatusCode::kOutOfRange, "OFFSET_OUT_OF_RANGE",
                        absl::StrCat("offset ", offset, " is past the ",
                                     size_bytes, " bytes of the part"),
                        {{"offset", absl::StrCat(offset)},
                         {"size_bytes", absl::StrCat(size_bytes)}}),
                   "offset");
}

ErrorDetails DetailsOf(const absl::Status& status) {
  ErrorDetails details;
  details.reason = absl::StatusCodeToString(status.code());
  status.ForEachPayload([&](absl::string_view name, const absl::Cord& cord) {
    const std::string value(cord);
    if (name == kReason) details.reason = value;
    if (name == kField) details.field = value;
    if (name == kRetryAfter) {
      details.retry_after.emplace();
      absl::ParseDuration(value, &*details.retry_after);
    }
    if (absl::ConsumePrefix(&name, kMetadata)) {
      details.metadata[std::string(name)] = value;
    }
  });
  return details;
}

JobError JobErrorOf(const absl::Status& status) {
  return {status.code(), DetailsOf(status).reason,
          std::string(status.message())};
}

std::string LeadingFieldPath(absl::string_view message,
                             const std::string& otherwise) {
  size_t end = 0;
  while (end < message.size() &&
         (absl::ascii_isalnum(message[end]) || message[end] == '_' ||
          message[end] == '.' || message[end] == '[' || message[end] == ']')) {
    ++end;
  }
  if (!absl::StartsWith(message, otherwise)) return otherwise;
  return std::string(message.substr(0, end));
}

}  // namespace isomatch
