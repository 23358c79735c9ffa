#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <pqxx/pqxx>

#include "server/postgres/postgres_blob_store.h"
#include "server/postgres/postgres_pool.h"
#include "server/storage/blob_store.h"
#include "tests/support/postgres_server.h"

namespace isomatch {

/// Of a store that forgets nothing and knows everything at once.
PostgresBlobStore::Options ExactOptions(std::int64_t capacity_bytes);

/// The database of this test process with new tables, and a connection to look
/// at those of blobs. One at a time.
class BlobDatabase {
 public:
  BlobDatabase();

  std::unique_ptr<PostgresPool> OpenPool() const;

  PostgresServer& server() { return *server_; }
  PostgresPool* pool() { return pool_.get(); }

  /// Runs a statement as somebody else; returns what it finds first, or "".
  std::string Do(const std::string& sql);

  // What the job store does.
  void AddReference(const std::string& job, const BlobKey& key);
  void RemoveReferences(const std::string& job);

 private:
  PostgresServer* server_;
  std::unique_ptr<PostgresPool> pool_;
  std::unique_ptr<pqxx::connection> database_;
};

}  // namespace isomatch
