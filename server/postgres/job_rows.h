#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <pqxx/pqxx>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/postgres/postgres_pool.h"
#include "server/storage/job_record.h"
#include "server/storage/kept_jobs.h"

namespace isomatch {

/// What a query selects of `isomatch.jobs j LEFT JOIN isomatch.live_jobs l` for
/// RecordOf, in this order.
extern const char kJobColumns[];

/// The tables that these are of.
extern const char kJobTables[];

/// Returns the record of a row of kJobColumns. One that cannot be read is that
/// of a job without inputs, or if it is over of one that failed for it.
JobRecord RecordOf(const pqxx::row& row);

/// Returns those of all rows.
std::vector<JobRecord> RecordsOf(const pqxx::result& rows);

/// Returns an array of PostgreSQL with these elements, WithoutZeros.
std::string ArrayOf(const std::vector<std::string>& texts);

/// The same of numbers, which are written as they are.
template <typename Number>
std::string ArrayOfNumbers(const std::vector<Number>& numbers) {
  std::string array = "{";
  for (const Number number : numbers) {
    if (array.size() > 1) array += ',';
    array += pqxx::to_string(number);
  }
  return array + "}";
}

/// Returns other text for every text, without bytes of 0, which PostgreSQL has
/// none of. For what is looked for: what is shown is in the record.
std::string WithoutZeros(const std::string& text);

/// Returns labels as JSON that can be looked for.
std::string LabelsJson(const std::map<std::string, std::string>& labels);

/// Returns an interval of PostgreSQL.
std::string IntervalOf(absl::Duration duration);

/// A parameter that may be NULL.
inline const char* OrNull(const std::optional<std::string>& text) {
  return text ? text->c_str() : nullptr;
}

/// Adds the rows of a new job, and the references to its inputs; the record
/// gets number, sequence and time. `unwatched_grace`, an interval: it is
/// cancelled when nobody has watched it for so long. ALREADY_EXISTS;
/// FAILED_PRECONDITION: an input is not there.
absl::Status InsertRow(PostgresPool& pool, JobRecord& record,
                       const std::optional<std::string>& unwatched_grace);

/// Replaces what the rows of a job say; the record gets its new sequence. Once
/// the job is over its references are those to its results. NOT_FOUND, ABORTED.
absl::Status UpdateRow(PostgresPool& pool, JobRecord& record);

/// Removes those of the jobs that are over, and returns what they were. Their
/// requests and results go after `blob_grace`, unless others need them.
std::vector<JobRecord> RemoveRows(pqxx::work& transaction,
                                  const std::vector<std::string>& ids,
                                  absl::Duration blob_grace);

/// What KeptIn reads.
extern const char kKeptQuery[];

/// Returns the jobs that are over. How long ago they ended counts, by the
/// database's clock, which `now` is the time of.
KeptJobs KeptIn(const pqxx::result& rows, absl::Time now);

}  // namespace isomatch
