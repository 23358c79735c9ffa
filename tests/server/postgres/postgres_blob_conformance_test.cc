#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "absl/time/time.h"
#include "server/postgres/postgres_blob_store.h"
#include "tests/server/postgres/blob_database.h"
#include "tests/server/storage/blob_store_conformance.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

class PostgresHarness {
 public:
  static constexpr int kRandomSteps = 150;

  PostgresHarness() = default;
  explicit PostgresHarness(std::string folder) : folder_(std::move(folder)) {}

  std::unique_ptr<BlobStore> Make(std::int64_t capacity_bytes) {
    return Make(ExactOptions(capacity_bytes));
  }
  std::unique_ptr<BlobStore> MakeKeeping(std::int64_t capacity_bytes) {
    PostgresBlobStore::Options options = ExactOptions(capacity_bytes);
    options.grace = absl::Minutes(1);
    return Make(options);
  }
  void Hold(BlobStore& /*store*/, const BlobKey& key) {
    jobs_.push_back({key, "job" + std::to_string(++last_job_)});
    database_.AddReference(jobs_.back().second, key);
  }
  void Release(BlobStore& /*store*/, const BlobKey& key) {
    for (auto job = jobs_.begin(); job != jobs_.end(); ++job) {
      if (job->first != key) continue;
      database_.RemoveReferences(job->second);
      jobs_.erase(job);
      return;
    }
  }

 private:
  std::unique_ptr<BlobStore> Make(PostgresBlobStore::Options options) {
    options.folder = folder_;
    return std::make_unique<PostgresBlobStore>(database_.pool(), options);
  }

  const std::string folder_;
  BlobDatabase database_;
  std::vector<std::pair<BlobKey, std::string>> jobs_;
  int last_job_ = 0;
};

/// With content in files.
class FolderHarness : private TemporaryFolder, public PostgresHarness {
 public:
  FolderHarness() : PostgresHarness(Path("")) {}
};

INSTANTIATE_TYPED_TEST_SUITE_P(ManyProcesses, BlobStoreConformance,
                               PostgresHarness);
INSTANTIATE_TYPED_TEST_SUITE_P(ManyProcessesWithAFolder, BlobStoreConformance,
                               FolderHarness);

}  // namespace
}  // namespace isomatch
