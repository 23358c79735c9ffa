#include "server/postgres/postgres_job_store.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "server/postgres/job_rows.h"
#include "server/postgres/migrations.h"
#include "server/storage/kept_jobs.h"

namespace isomatch {
namespace {

using Repeat = PostgresPool::Repeat;

/// Jobs that one transaction of Prune removes, so that it ends in time, and one
/// call.
constexpr std::size_t kPrunedAtOnce = 500;
constexpr std::size_t kMostPruned = 10000;

std::string SelectJobs(absl::string_view condition) {
  return absl::StrCat("SELECT ", kJobColumns, "FROM ", kJobTables, condition);
}

std::vector<std::string> FirstColumn(const pqxx::result& rows) {
  std::vector<std::string> texts;
  for (const pqxx::row& row : rows) texts.push_back(row[0].as<std::string>());
  return texts;
}

absl::StatusOr<JobRecord> TheOne(const absl::StatusOr<pqxx::result>& rows,
                                 const std::string& what) {
  ISOMATCH_RETURN_IF_ERROR(rows.status());
  if (!rows->empty()) return RecordOf((*rows)[0]);
  return absl::NotFoundError(absl::StrCat("no job ", what));
}

}  // namespace

absl::StatusOr<JobRecord> PostgresJobStore::Insert(JobRecord record) {
  std::optional<std::string> grace;
  if (record.cancel_when_unwatched) {
    grace = IntervalOf(options_.unwatched_grace);
  }
  ISOMATCH_RETURN_IF_ERROR(InsertRow(pool_, record, grace));
  return record;
}

absl::StatusOr<JobRecord> PostgresJobStore::Update(JobRecord record) {
  ISOMATCH_RETURN_IF_ERROR(UpdateRow(pool_, record));
  return record;
}

absl::StatusOr<JobRecord> PostgresJobStore::Get(const std::string& id) const {
  return TheOne(pool_.Ask(Repeat::kOnce, SelectJobs("WHERE j.id = $1"), id),
                id);
}

absl::StatusOr<JobRecord> PostgresJobStore::FindByRequestId(
    const std::string& tenant, const std::string& request_id) const {
  return TheOne(pool_.Ask(Repeat::kOnce,
                          SelectJobs("WHERE j.tenant = $1 AND j.request_id = $2"
                                     " AND j.request_id <> ''"),
                          tenant, WithoutZeros(request_id)),
                absl::StrCat("of request ", request_id));
}

absl::StatusOr<bool> PostgresJobStore::HasInput(
    const std::string& tenant, const std::string& sha256) const {
  ISOMATCH_ASSIGN_OR_RETURN(
      const pqxx::result rows,
      pool_.Ask(Repeat::kOnce,
                "SELECT EXISTS (SELECT FROM isomatch.jobs WHERE tenant = $1 "
                "AND $2 = ANY (inputs))",
                tenant, sha256));
  return rows[0][0].as<bool>();
}

absl::StatusOr<std::vector<JobRecord>> PostgresJobStore::List(
    const JobFilter& filter) const {
  std::vector<int> states;
  for (const JobState state : filter.states) {
    states.push_back(static_cast<int>(state));
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      const pqxx::result rows,
      pool_.Ask(Repeat::kOnce,
                SelectJobs("WHERE ($1::text IS NULL OR j.tenant = $1) "
                           "AND ($2::bigint = 0 OR j.number < $2) "
                           "AND ($3::int[] = '{}' OR "
                           "coalesce(l.state, j.state) = ANY ($3::int[])) "
                           "AND j.labels @> $4::jsonb "
                           "ORDER BY j.number DESC LIMIT $5"),
                OrNull(filter.tenant), filter.before_number,
                ArrayOfNumbers(states), LabelsJson(filter.labels),
                std::max(filter.limit, 0)));
  return RecordsOf(rows);
}

absl::StatusOr<JobRecord> PostgresJobStore::Delete(const std::string& id) {
  std::vector<JobRecord> removed;
  ISOMATCH_RETURN_IF_ERROR(pool_.Run([&](pqxx::work& transaction) {
    removed = RemoveRows(transaction, {id}, options_.blob_grace);
    return absl::OkStatus();
  }));
  if (!removed.empty()) return std::move(removed.front());
  ISOMATCH_ASSIGN_OR_RETURN(const JobRecord job, Get(id));
  return absl::FailedPreconditionError(
      absl::StrCat("job ", id, " is ", JobStateName(job.state)));
}

absl::StatusOr<std::vector<JobRecord>> PostgresJobStore::Prune(
    const KeepLimits& limits) {
  ISOMATCH_ASSIGN_OR_RETURN(const pqxx::result rows,
                            pool_.Ask(Repeat::kOnce, kKeptQuery));
  const std::vector<std::string> ids = KeptIn(rows, absl::Now()).Excess(limits);
  std::vector<JobRecord> removed;
  // The rest the next time.
  const std::size_t count = std::min<std::size_t>(ids.size(), kMostPruned);
  for (std::size_t begin = 0; begin < count; begin += kPrunedAtOnce) {
    const std::size_t end = std::min(begin + kPrunedAtOnce, count);
    std::vector<JobRecord> piece;
    ISOMATCH_RETURN_IF_ERROR(pool_.Run([&](pqxx::work& transaction) {
      piece = RemoveRows(
          transaction,
          std::vector<std::string>(ids.begin() + begin, ids.begin() + end),
          options_.blob_grace);
      return absl::OkStatus();
    }));
    std::move(piece.begin(), piece.end(), std::back_inserter(removed));
  }
  return removed;
}

// Leases.

absl::StatusOr<std::optional<JobRecord>> PostgresJobStore::Claim(
    const ClaimRequest& request) {
  // A claim that nobody hears of ends with its lease.
  ISOMATCH_ASSIGN_OR_RETURN(
      const pqxx::result rows,
      pool_.Ask(Repeat::kNever,
                absl::StrCat("SELECT ", kJobColumns,
                             "FROM isomatch.claim_job($1, $2, $3, "
                             "$4::interval, $5, $6, $7, $8, $9::text[]) l "
                             "CROSS JOIN LATERAL isomatch.job_now(l.number) j"),
                request.worker, request.free_bytes, request.total_bytes,
                IntervalOf(request.lease), request.max_running_per_tenant,
                request.max_passes, request.max_overtakes, request.alone_after,
                ArrayOf(request.meshes)));
  std::optional<JobRecord> claimed;
  if (rows.empty()) return claimed;
  claimed = RecordOf(rows[0]);
  return claimed;
}

absl::StatusOr<std::vector<std::string>> PostgresJobStore::Renew(
    const std::vector<LeasedJob>& jobs, absl::Duration lease) {
  std::vector<std::string> ids;
  std::vector<std::uint64_t> claims;
  std::vector<std::int32_t> stages;
  std::vector<double> stage_fractions;
  std::vector<double> total_fractions;
  std::vector<bool> has_maps;
  for (const LeasedJob& job : jobs) {
    ids.push_back(job.id);
    claims.push_back(job.claim);
    stages.push_back(job.progress.stage);
    stage_fractions.push_back(job.progress.stage_fraction);
    total_fractions.push_back(job.progress.total_fraction);
    has_maps.push_back(job.progress.has_map);
  }
  ISOMATCH_ASSIGN_OR_RETURN(
      const pqxx::result rows,
      pool_.Ask(Repeat::kOnce,
                "SELECT * FROM isomatch.renew_leases($1::text[], $2::bigint[], "
                "$3::int[], $4::float8[], $5::float8[], $6::boolean[], "
                "$7::interval)",
                ArrayOf(ids), ArrayOfNumbers(claims), ArrayOfNumbers(stages),
                ArrayOfNumbers(stage_fractions),
                ArrayOfNumbers(total_fractions), ArrayOfNumbers(has_maps),
                IntervalOf(lease)));
  const std::vector<std::string> own = FirstColumn(rows);
  std::vector<std::string> lost;
  for (const std::string& id : ids) {
    if (std::find(own.begin(), own.end(), id) == own.end()) lost.push_back(id);
  }
  return lost;
}

absl::StatusOr<std::vector<JobRecord>> PostgresJobStore::Expired(
    absl::Duration lease) {
  // While the database was away nobody could renew.
  ISOMATCH_ASSIGN_OR_RETURN(
      const pqxx::result rows,
      pool_.Ask(Repeat::kOnce,
                SelectJobs("WHERE l.state = 2 AND l.lease_until < now() AND "
                           "pg_postmaster_start_time() + $1::interval < now()"),
                IntervalOf(lease)));
  return RecordsOf(rows);
}

absl::StatusOr<bool> PostgresJobStore::TakeBack(const JobRecord& job,
                                                int faults) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const pqxx::result rows,
      pool_.Ask(Repeat::kOnce, "SELECT isomatch.take_back_job($1, $2, $3)",
                job.id, job.claim, faults));
  return rows[0][0].as<bool>();
}

absl::StatusOr<std::vector<JobRecord>> PostgresJobStore::Overdue() {
  ISOMATCH_ASSIGN_OR_RETURN(
      const pqxx::result rows,
      pool_.Ask(Repeat::kOnce,
                SelectJobs("WHERE l.state = 1 AND l.queue_deadline < now()")));
  return RecordsOf(rows);
}

// Watchers.

absl::Status PostgresJobStore::KeepWatched(const std::vector<std::string>& ids,
                                           absl::Duration grace) {
  return pool_
      .Ask(Repeat::kOnce,
           "SELECT isomatch.keep_watched($1::text[], $2::interval)",
           ArrayOf(ids), IntervalOf(grace))
      .status();
}

absl::StatusOr<std::vector<std::string>> PostgresJobStore::Unwatched() {
  ISOMATCH_ASSIGN_OR_RETURN(
      const pqxx::result rows,
      pool_.Ask(Repeat::kOnce,
                "SELECT id FROM isomatch.live_jobs "
                "WHERE watched_until < now() AND "
                "pg_postmaster_start_time() + $1::interval < now()",
                IntervalOf(options_.unwatched_grace)));
  return FirstColumn(rows);
}

absl::StatusOr<std::map<std::string, std::uint64_t>>
PostgresJobStore::LiveSequences(const std::vector<std::string>& ids) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const pqxx::result rows,
      pool_.Ask(Repeat::kOnce,
                "SELECT id, sequence FROM isomatch.live_jobs "
                "WHERE id = ANY ($1::text[])",
                ArrayOf(ids)));
  std::map<std::string, std::uint64_t> sequences;
  for (const pqxx::row& row : rows) {
    sequences[row[0].as<std::string>()] = row[1].as<std::uint64_t>();
  }
  return sequences;
}

// The queue.

absl::StatusOr<std::vector<std::string>> PostgresJobStore::InOrder() {
  ISOMATCH_ASSIGN_OR_RETURN(
      const pqxx::result rows,
      pool_.Ask(Repeat::kOnce, "SELECT * FROM isomatch.queue_order()"));
  return FirstColumn(rows);
}

absl::StatusOr<QueueCounts> PostgresJobStore::Count() {
  ISOMATCH_ASSIGN_OR_RETURN(
      const pqxx::result rows,
      pool_.Ask(Repeat::kOnce,
                "SELECT l.state, l.priority, count(*), (extract(epoch FROM "
                "now() - min(j.created)) * 1000000)::bigint "
                "FROM isomatch.live_jobs l JOIN isomatch.jobs j "
                "ON j.number = l.number GROUP BY 1, 2"));
  QueueCounts counts;
  for (const pqxx::row& row : rows) {
    const int count = row[2].as<int>();
    if (row[0].as<int>() != static_cast<int>(JobState::kQueued)) {
      counts.running += count;
      continue;
    }
    counts.queued += count;
    counts.queued_by_priority[row[1].as<std::int32_t>()] += count;
    counts.oldest_queued = std::max(
        counts.oldest_queued, absl::Microseconds(row[3].as<std::int64_t>()));
  }
  return counts;
}

absl::StatusOr<int> PostgresJobStore::CountQueuedOf(const std::string& tenant) {
  ISOMATCH_ASSIGN_OR_RETURN(const pqxx::result rows,
                            pool_.Ask(Repeat::kOnce,
                                      "SELECT count(*) FROM isomatch.live_jobs "
                                      "WHERE tenant = $1 AND state = 1",
                                      tenant));
  return rows[0][0].as<int>();
}

// Processes.

absl::Status PostgresJobStore::Register(const WorkerEntry& entry) {
  return pool_
      .Ask(Repeat::kOnce,
           "INSERT INTO isomatch.workers "
           "(worker, version, slots, threads, memory_bytes) "
           "VALUES ($1, $2, $3, $4, $5) ON CONFLICT (worker) DO UPDATE SET "
           "version = $2, slots = $3, threads = $4, memory_bytes = $5, "
           "seen = now()",
           entry.worker, entry.version, entry.slots, entry.threads,
           entry.memory_bytes)
      .status();
}

absl::Status PostgresJobStore::Unregister(const std::string& worker) {
  return pool_
      .Ask(Repeat::kOnce,
           "DELETE FROM isomatch.workers WHERE worker = $1 "
           "OR seen < now() - interval '1 day'",
           worker)
      .status();
}

absl::StatusOr<std::vector<WorkerEntry>> PostgresJobStore::Workers(
    absl::Duration age) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const pqxx::result rows,
      pool_.Ask(Repeat::kOnce,
                "SELECT worker, version, slots, threads, memory_bytes FROM "
                "isomatch.workers WHERE seen > now() - $1::interval",
                IntervalOf(age)));
  std::vector<WorkerEntry> workers;
  for (const pqxx::row& row : rows) {
    workers.push_back({row[0].as<std::string>(), row[1].as<std::string>(),
                       row[2].as<int>(), row[3].as<int>(),
                       row[4].as<std::int64_t>()});
  }
  return workers;
}

absl::StatusOr<bool> PostgresJobStore::HoldChore(const std::string& chore,
                                                 const std::string& holder,
                                                 absl::Duration term) {
  ISOMATCH_ASSIGN_OR_RETURN(
      const pqxx::result rows,
      pool_.Ask(Repeat::kOnce,
                "INSERT INTO isomatch.chores AS c (chore, holder, held_until) "
                "VALUES ($1, $2, now() + $3::interval) ON CONFLICT (chore) DO "
                "UPDATE SET holder = $2, held_until = now() + $3::interval "
                "WHERE c.holder = $2 OR c.held_until < now() RETURNING holder",
                chore, holder, IntervalOf(term)));
  return !rows.empty();
}

// For the operator.

absl::Status PostgresJobStore::CheckVersion() { return CheckSchema(pool_); }

absl::StatusOr<StoreFigures> PostgresJobStore::Measure() {
  ISOMATCH_ASSIGN_OR_RETURN(
      const pqxx::result rows,
      pool_.Ask(Repeat::kOnce,
                "SELECT n_live_tup, n_dead_tup, pg_total_relation_size(relid), "
                "(SELECT coalesce(extract(epoch FROM "
                "clock_timestamp() - min(xact_start)), 0) * 1000000 "
                "FROM pg_stat_activity WHERE datname = current_database() "
                "AND backend_type = 'client backend' "
                "AND pid <> pg_backend_pid())::bigint "
                "FROM pg_stat_user_tables "
                "WHERE relid = 'isomatch.live_jobs'::regclass"));
  StoreFigures figures;
  if (rows.empty()) return figures;
  figures.live_rows = rows[0][0].as<std::int64_t>();
  figures.dead_rows = rows[0][1].as<std::int64_t>();
  figures.table_bytes = rows[0][2].as<std::int64_t>();
  figures.oldest_transaction =
      absl::Microseconds(rows[0][3].as<std::int64_t>());
  return figures;
}

}  // namespace isomatch
