// Gateways and workers within the test's process, on a real PostgreSQL: where
// meshes, results and interrupted uploads are, and what a process needs for
// that.

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/time/clock.h"
#include "core/base/sha256.h"
#include "tests/server/cluster_fixture.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

TEST_F(ClusterTest, MeshesAndResultsMayBeInAFolder) {
  const TemporaryFolder folder;
  ServerConfig gateway = Config("gateway");
  ServerConfig worker = Config("worker");
  gateway.blob_dir = folder.Path("");
  worker.blob_dir = folder.Path("");
  const auto other = Start(gateway);
  const auto runs = Start(worker);
  CallAt(*other);
  const std::string name = CreateJob();
  WaitFor(name, v1::Job::STATE_SUCCEEDED);
  pqxx::connection database((*TheServer())->url());
  pqxx::nontransaction rows(database);
  EXPECT_EQ(
      rows.exec("SELECT count(*) FROM isomatch.blob_chunks")[0][0].as<int>(),
      0);
  EXPECT_GT(rows.exec("SELECT count(file) FROM isomatch.blobs")[0][0].as<int>(),
            0);
}

TEST_F(ClusterTest, WhoeverLacksTheFolderThatHasFilesDoesNotStart) {
  const TemporaryFolder folder;
  ServerConfig config = Config("all");
  config.blob_dir = folder.Path("");
  {
    const auto all = Start(config);
    CallAt(*all);
    WaitFor(CreateJob(), v1::Job::STATE_SUCCEEDED);
    all->Shutdown(absl::ZeroDuration());
  }
  EXPECT_THAT(
      Server::Create(Config("worker"), GatedEngine(), nullptr, OpenAnyStores),
      StatusIs(absl::StatusCode::kFailedPrecondition,
               testing::HasSubstr("--blob-dir is not set")));
}

TEST_F(ClusterTest, AFullDiskCostsAJobNeitherItsResultNorAnAttempt) {
  gate_open_ = false;
  const auto worker = Start(Config("worker"));
  const std::string name = CreateJob();
  WaitForMatches(1);
  Do("CREATE FUNCTION isomatch.full() RETURNS trigger LANGUAGE plpgsql AS "
     "$$ BEGIN RAISE 'no space' USING ERRCODE = '53100'; END $$;"
     "CREATE TRIGGER full_disk BEFORE DELETE ON isomatch.live_jobs "
     "FOR EACH ROW EXECUTE FUNCTION isomatch.full()");
  gate_open_ = true;
  absl::SleepFor(absl::Seconds(3));  // longer than a lease
  EXPECT_EQ(GetJob(name).state(), v1::Job::STATE_RUNNING);
  Do("DROP TRIGGER full_disk ON isomatch.live_jobs");
  EXPECT_EQ(WaitFor(name, v1::Job::STATE_SUCCEEDED).attempt(), 1);
  EXPECT_EQ(matches_, 1);
}

/// Another role than that of `migrate`, with the rights of server/README.md.
TEST_F(ClusterTest, ARoleThatMayUseTheTablesIsEnough) {
  Do("DROP ROLE IF EXISTS r");
  Do("CREATE ROLE r LOGIN;"
     "GRANT USAGE ON SCHEMA isomatch TO r;"
     "GRANT SELECT, INSERT, UPDATE, DELETE ON ALL TABLES IN SCHEMA isomatch "
     "TO r; GRANT USAGE ON ALL SEQUENCES IN SCHEMA isomatch TO r");
  ServerConfig config = Config("all");
  config.store = "postgresql://r@/isomatch?host=" + (*TheServer())->folder();
  {
    const auto all = Start(config);
    CallAt(*all);
    const std::string name = CreateJob();
    WaitFor(name, v1::Job::STATE_SUCCEEDED);
    EXPECT_TRUE(Delete(name).ok());
    gate_open_ = false;
    EXPECT_EQ(Cancel(CreateJob()).state(), v1::Job::STATE_CANCELLED);
    gate_open_ = true;
    all->Shutdown(absl::ZeroDuration());
  }
  Do("DROP OWNED BY r; DROP ROLE r");
}

TEST_F(ClusterTest, ADamagedRecordFailsItsJobOnly) {
  const std::string damaged = CreateJob();
  const std::string whole = CreateJob();
  Do("UPDATE isomatch.jobs SET record = 'damaged' WHERE id = '" +
     damaged.substr(damaged.find('/') + 1) + "'");
  const auto worker = Start(Config("worker"));
  EXPECT_EQ(WaitFor(damaged, v1::Job::STATE_FAILED).error().reason(),
            "CONTENT_LOST");
  WaitFor(whole, v1::Job::STATE_SUCCEEDED);
  Do("UPDATE isomatch.jobs SET record = 'damaged'");
  EXPECT_EQ(GetJob(whole).error().reason(), "CONTENT_LOST");
  EXPECT_TRUE(Delete(whole).ok());
  EXPECT_TRUE(Delete(damaged).ok());
}

TEST_F(ClusterTest, AFolderOfAnotherDatabaseIsRefused) {
  const TemporaryFolder folder;
  folder.Write("isomatch-blobs", "another");
  ServerConfig config = Config("gateway");
  config.blob_dir = folder.Path("");
  EXPECT_THAT(Server::Create(config, GatedEngine(), nullptr, OpenAnyStores),
              StatusIs(absl::StatusCode::kUnavailable,
                       testing::HasSubstr("not the folder of this database")));
}

TEST_F(ClusterTest, AFolderThatCannotBeUsedIsRefusedByItsFlag) {
  const TemporaryFolder folder;
  ServerConfig config = Config("gateway");
  for (const std::string& path :
       {folder.Path("nope"), folder.Write("file", "no folder")}) {
    config.blob_dir = path;
    EXPECT_THAT(OpenAnyStores(config).status(),
                StatusIs(absl::StatusCode::kUnavailable,
                         "--blob-dir = " + path +
                             ": no such folder, expected one that exists"));
  }
  config.blob_dir = "/proc/self";  // where nobody makes files
  EXPECT_THAT(OpenAnyStores(config).status(),
              StatusIs(absl::StatusCode::kUnavailable,
                       testing::HasSubstr("--blob-dir = /proc/self: cannot")));
}

TEST_F(ClusterTest, MigrateSaysWhatItDidAndWhere) {
  const std::string place = " isomatch at " + (*TheServer())->folder();
  const ServerConfig config = Config("all");
  const auto migrate = [&] {
    const auto said = MigrateStore(config);
    EXPECT_THAT(said, IsOk());
    return said.value_or("");
  };
  EXPECT_THAT(migrate(), testing::StartsWith("nothing to do: the tables of" +
                                             place + " have version "));
  Do("DROP SCHEMA isomatch CASCADE");
  EXPECT_THAT(migrate(),
              testing::StartsWith("made the tables of" + place + ", version "));
}

TEST_F(ClusterTest, APasswordFileWithoutAPasswordIsRefused) {
  const TemporaryFolder folder;
  ServerConfig config = Config("gateway");
  for (const std::string& text : {std::string(), std::string("\nsecond")}) {
    config.store_password_file = folder.Write("password", text);
    EXPECT_THAT(
        OpenAnyStores(config).status(),
        StatusIs(absl::StatusCode::kUnavailable,
                 testing::HasSubstr("--store-password-file = " +
                                    folder.Path("password") + " is empty")));
  }
  config.store_password_file = folder.Path("none");
  EXPECT_THAT(OpenAnyStores(config).status(),
              StatusIs(absl::StatusCode::kUnavailable,
                       testing::HasSubstr("--store-password-file = " +
                                          folder.Path("none") + ": cannot")));
}

class ClusterUploadTest : public ClusterTest {
 protected:
  /// Begins an upload at `offset`, sends `bytes`, and cancels or ends it.
  grpc::Status Upload(std::uint64_t offset, const std::string& bytes,
                      bool cancels) {
    grpc::ClientContext context;
    v1::UploadMeshResponse response;
    const auto writer = stub_->UploadMesh(&context, &response);
    v1::UploadMeshRequest request;
    *request.mutable_header() = digest_;
    request.set_offset(offset);
    writer->Write(request);
    request.set_chunk(bytes);
    writer->Write(request);
    if (cancels) {
      absl::SleepFor(absl::Milliseconds(300));  // the bytes arrive
      context.TryCancel();
    } else {
      writer->WritesDone();
    }
    return writer->Finish();
  }

  /// Returns how many bytes are there; -1 when the mesh is.
  std::int64_t Received() {
    grpc::ClientContext context;
    v1::FindMissingMeshesRequest request;
    *request.add_digests() = digest_;
    v1::FindMissingMeshesResponse response;
    EXPECT_TRUE(stub_->FindMissingMeshes(&context, request, &response).ok());
    if (response.missing_size() == 0) return -1;
    return static_cast<std::int64_t>(response.received_bytes(0));
  }

  bool WaitForReceived(std::int64_t bytes) {
    for (int i = 0; i < 250 && Received() != bytes; ++i) {
      absl::SleepFor(absl::Milliseconds(20));
    }
    return Received() == bytes;
  }

  const std::string bytes_ = SphereJob().mesh_x().draco();
  const v1::Digest digest_ = [this] {
    v1::Digest digest;
    digest.set_sha256(Sha256Hex(bytes_));
    digest.set_size_bytes(bytes_.size());
    return digest;
  }();
};

TEST_F(ClusterUploadTest, AnUploadThatBrokeOffGoesOnAtAnyGateway) {
  const auto other = Start(Config("gateway"));
  const auto third = Start(Config("gateway"));
  const std::size_t half = bytes_.size() / 2;
  EXPECT_FALSE(Upload(0, bytes_.substr(0, half), /*cancels=*/true).ok());
  server_->Shutdown(absl::ZeroDuration());  // it is gone for good
  CallAt(*other);
  ASSERT_TRUE(WaitForReceived(static_cast<std::int64_t>(half)));
  EXPECT_FALSE(Upload(half, bytes_.substr(half, 5), /*cancels=*/true).ok());
  CallAt(*third);
  ASSERT_TRUE(WaitForReceived(static_cast<std::int64_t>(half) + 5));
  EXPECT_TRUE(Upload(half + 5, bytes_.substr(half + 5), false).ok());
  EXPECT_EQ(Received(), -1);
}

TEST_F(ClusterUploadTest, WhatDidNotGoOnGoesWithTheChores) {
  EXPECT_FALSE(Upload(0, bytes_.substr(0, 9), /*cancels=*/true).ok());
  ASSERT_TRUE(WaitForReceived(9));
  pqxx::connection database((*TheServer())->url());
  pqxx::nontransaction rows(database);
  rows.exec("UPDATE isomatch.partial_uploads SET kept_at = '-infinity'");
  rows.exec("DELETE FROM isomatch.chores");
  EXPECT_EQ(Received(), 0);
  const auto other = Start(Config("gateway"));  // its first chores are all
  const auto count = [&] {
    return rows.exec("SELECT count(*) FROM isomatch.partial_uploads")[0][0]
        .as<int>();
  };
  for (int i = 0; i < 500 && count() > 0; ++i) {
    absl::SleepFor(absl::Milliseconds(20));
  }
  EXPECT_EQ(count(), 0);
}

TEST_F(ClusterTest, WhatADeletedJobLeavesGoesWithTheChores) {
  const auto worker = Start(Config("worker"));
  const std::string name = CreateJob();
  WaitFor(name, v1::Job::STATE_SUCCEEDED);
  ASSERT_TRUE(Delete(name).ok());
  pqxx::connection database((*TheServer())->url());
  pqxx::nontransaction rows(database);
  const auto count = [&] {
    return rows.exec("SELECT count(*) FROM isomatch.blobs")[0][0].as<int>();
  };
  EXPECT_GT(count(), 0) << "removed before others can be done with it";
  rows.exec(
      "UPDATE isomatch.blobs SET used_at = used_at - interval '11 min', "
      "remove_at = remove_at - interval '11 min'");
  rows.exec("DELETE FROM isomatch.chores");
  const auto other = Start(Config("gateway"));  // its first chores are all
  for (int i = 0; i < 500 && count() > 0; ++i) {
    absl::SleepFor(absl::Milliseconds(20));
  }
  EXPECT_EQ(count(), 0);
}

}  // namespace
}  // namespace isomatch
