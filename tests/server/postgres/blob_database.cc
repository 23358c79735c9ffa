#include "tests/server/postgres/blob_database.h"

#include <utility>

#include <gtest/gtest.h>

#include "tests/server/postgres/test_database.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

/// Of a machine that is busy with other tests.
constexpr absl::Duration kPatience = absl::Seconds(20);

}  // namespace

PostgresBlobStore::Options ExactOptions(std::int64_t capacity_bytes) {
  return {.capacity_bytes = capacity_bytes,
          .grace = absl::ZeroDuration(),
          .use_resolution = absl::ZeroDuration(),
          .figures_age = absl::ZeroDuration()};
}

BlobDatabase::BlobDatabase() {
  auto pool = NewDatabase(kPatience);
  EXPECT_THAT(pool, IsOk());
  pool_ = *std::move(pool);
  server_ = *TheServer();
}

std::unique_ptr<PostgresPool> BlobDatabase::OpenPool() const {
  auto pool =
      PostgresPool::Open({.url = server_->url(), .patience = kPatience});
  EXPECT_THAT(pool, IsOk());
  return *std::move(pool);
}

std::string BlobDatabase::Do(const std::string& sql) {
  if (database_ == nullptr) {
    database_ = std::make_unique<pqxx::connection>(server_->url());
  }
  pqxx::nontransaction transaction(*database_);
  const pqxx::result rows = transaction.exec(sql);
  return rows.empty() ? "" : rows[0][0].as<std::string>("");
}

void BlobDatabase::AddReference(const std::string& job, const BlobKey& key) {
  Do("INSERT INTO isomatch.job_blobs VALUES ('" + job + "', '" + key.tenant +
     "', '" + key.sha256 + "', 1)");
}

void BlobDatabase::RemoveReferences(const std::string& job) {
  Do("DELETE FROM isomatch.job_blobs WHERE job_id = '" + job + "'");
}

}  // namespace isomatch
