#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "absl/time/time.h"
#include "server/jobs/caller.h"
#include "server/storage/job_record.h"

namespace isomatch {

// Every error that the service sends, one function each; the table of their
// reasons is in proto/README.md. They live in this layer because a failed job
// keeps its reason too; server/rpc/grpc_status turns them into gRPC's.

// Who calls. No message has any of a key.

absl::Status ApiKeyMissing();                     // UNAUTHENTICATED
absl::Status ApiKeyWrong();                       // UNAUTHENTICATED
absl::Status RoleTooLow(Role role, Role needed);  // PERMISSION_DENIED

// INVALID_ARGUMENT: the request has to change. `field` is the path from the
// request, e.g. "landmarks[3].x"; `problem` says what was found and expected.

absl::Status InvalidField(const std::string& field, const std::string& problem);
absl::Status MeshMalformed(const std::string& field,
                           const std::string& problem);
absl::Status MeshTooLarge(const std::string& field, std::int64_t size_bytes,
                          std::int64_t limit_bytes);
absl::Status MatchOutOfRange(const std::string& field, std::int64_t value,
                             std::int64_t vertices);
absl::Status LandmarksContradict(const std::string& field,
                                 const std::string& problem);
absl::Status UploadMalformed(const std::string& problem);
absl::Status UploadOffsetBeyond(std::uint64_t offset,
                                std::uint64_t received_bytes);
absl::Status DigestMismatch(const std::string& expected,
                            const std::string& found);

// RESOURCE_EXHAUSTED: the same call may succeed later, or elsewhere.

absl::Status QueueFull(std::int64_t queued_jobs, absl::Duration retry_after);
absl::Status TenantQuota(const std::string& tenant, std::int64_t queued_jobs,
                         absl::Duration retry_after);
absl::Status TenantRequestsQuota(const std::string& tenant,
                                 std::int64_t requests,
                                 absl::Duration retry_after);
absl::Status StorageQuota(const std::string& tenant, std::int64_t size_bytes,
                          std::int64_t limit_bytes);
absl::Status UploadQuota(std::int64_t size_bytes, absl::Duration retry_after);
absl::Status TenantUploadQuota(const std::string& tenant,
                               std::int64_t size_bytes,
                               std::int64_t limit_bytes,
                               absl::Duration retry_after);
absl::Status TenantUploadsQuota(const std::string& tenant, std::int64_t uploads,
                                absl::Duration retry_after);
/// RESOURCE_EXHAUSTED if `problem` is, else UNAVAILABLE.
absl::Status StorageFailed(const absl::Status& problem);
absl::Status StorageSilent(const absl::Status& problem);
absl::Status OutOfMemory(
    absl::string_view message = "the server ran out of memory for this job");

// FAILED_PRECONDITION: something else has to be done first, or never helps.

absl::Status JobNeedsMoreMemoryThanBudget(std::int64_t needed_bytes,
                                          std::int64_t budget_bytes);
absl::Status MeshesNeedMoreMemory(std::int64_t needed_bytes,
                                  std::int64_t budget_bytes);
absl::Status MeshMissing(const std::string& field, const std::string& sha256);
absl::Status JobIsTerminal(const std::string& id, JobState state);
absl::Status JobIsNotTerminal(const std::string& id, JobState state);
absl::Status JobHasNoResult(const std::string& id, JobState state);

// Others.

absl::Status Draining(absl::Duration retry_after);  // UNAVAILABLE
absl::Status CrashedRepeatedly(int attempts);       // INTERNAL
absl::Status ContentLost(const std::string& id,     // DATA_LOSS
                         const std::string& what);
absl::Status Unresponsive(int faults);                    // INTERNAL
absl::Status ContentUnavailable(const std::string& what,  // UNAVAILABLE
                                const absl::Status& problem);
absl::Status QueueTimeout(absl::Duration limit);  // DEADLINE_...
absl::Status RunTimeout(absl::Duration limit,     // DEADLINE_...
                        bool is_servers);
absl::Status UploadIdle(absl::Duration limit,  // DEADLINE_...
                        std::int64_t bytes_per_second);
absl::Status JobNotFound(const std::string& id);       // NOT_FOUND
absl::Status ResultPartMissing(const std::string& id,  // NOT_FOUND
                               ResultPart part);
absl::Status RequestIdReused(const std::string& request_id);  // ALREADY_EXISTS
absl::Status OffsetOutOfRange(std::uint64_t offset,           // OUT_OF_RANGE
                              std::int64_t size_bytes);

// Whether it is a StorageFailed, a ContentUnavailable: the same may succeed
// later.
bool IsStorageFailed(const absl::Status& status);
bool IsContentUnavailable(const absl::Status& status);
// Whether it is a JobNeedsMoreMemoryThanBudget or MeshesNeedMoreMemory.
bool IsNeedsMoreMemory(const absl::Status& status);

/// What a client's program may use of an error, beside its code and message.
struct ErrorDetails {
  /// UPPER_SNAKE_CASE; the code's name for errors not made here.
  std::string reason;
  /// The field of the request that is at fault, or empty.
  std::string field;
  std::optional<absl::Duration> retry_after;
  /// Every number and name that the message mentions.
  std::map<std::string, std::string> metadata;
};

/// Returns the details of any error. REQUIRES: !status.ok().
ErrorDetails DetailsOf(const absl::Status& status);

/// Returns what a failed job keeps of it.
JobError JobErrorOf(const absl::Status& status);

/// Returns the path at the head of a message such as "mesh_x.faces[3] is ...",
/// or `otherwise` when the message does not begin with one.
std::string LeadingFieldPath(absl::string_view message,
                             const std::string& otherwise);

}  // namespace isomatch
