// Streams that break off and go on with after_sequence.

#include <chrono>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/server/test_server.h"
#include "tests/soak/figures.h"
#include "tests/soak/known_jobs.h"
#include "tests/soak/soak_server.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

/// Watches one job over streams that it cuts after a few messages each, and
/// counts what goes wrong: a message that is older than asked for or than
/// GetJob said before, states or progress that go back, an end without a
/// terminal snapshot.
class CuttingWatcher {
 public:
  CuttingWatcher(const std::shared_ptr<grpc::Channel>& channel,
                 std::string name, std::uint64_t seed)
      : stub_(v1::CorrespondenceService::NewStub(channel)),
        name_(std::move(name)),
        random_(seed) {
    // On a busy machine a first connection fails now and then, and is made
    // anew; that is not what is tested.
    EXPECT_TRUE(channel->WaitForConnected(std::chrono::system_clock::now() +
                                          std::chrono::seconds(30)));
  }

  /// Until the job is terminal, over up to five streams that are cut and one
  /// that is not.
  void Watch() {
    for (int i = Random(6); i > 0 && !is_over_; --i) WatchOnce(Random(4));
    if (!is_over_) WatchOnce(std::numeric_limits<int>::max());
    EXPECT_TRUE(is_over_);
  }

  int missed() const { return missed_; }
  int cuts() const { return cuts_; }

 private:
  int Random(int bound) {
    return std::uniform_int_distribution<int>(0, bound - 1)(random_);
  }

  void WatchOnce(int messages) {
    const auto known = GetJob(*stub_, name_);
    ASSERT_TRUE(known.ok()) << known.status();
    CallContext context;
    v1::WatchJobRequest request;
    request.set_name(name_);
    request.set_after_sequence(last_.sequence());
    const auto reader = stub_->WatchJob(&context, request);
    v1::WatchJobResponse response;
    int read = 0;
    while (read < messages && reader->Read(&response)) {
      Compare(response.job(), read == 0 ? known->sequence() : 0);
      ++read;
    }
    if (!is_over_) {
      const bool is_cut = read == messages;
      EXPECT_TRUE(is_cut) << "no news came, after " << last_.sequence();
      ++(is_cut ? cuts_ : missed_);
      context.TryCancel();
    }
    while (reader->Read(&response)) {  // what was under way
      Compare(response.job(), 0);
    }
    const grpc::Status status = reader->Finish();
    EXPECT_TRUE(status.ok() || !is_over_) << status.error_message();
  }

  void Compare(const v1::Job& job, std::uint64_t known_sequence) {
    const bool is_news = job.sequence() > last_.sequence();
    const bool went_on =
        job.state() >= last_.state() &&
        job.progress().total_fraction() >= last_.progress().total_fraction();
    if (!is_news || !went_on || job.sequence() < known_sequence) {
      ++missed_;
      ADD_FAILURE() << "after " << last_.ShortDebugString() << " came "
                    << job.ShortDebugString() << ", GetJob had said "
                    << known_sequence;
    }
    last_ = job;
    is_over_ = IsEnd(job.state());
  }

  const std::unique_ptr<Stub> stub_;
  const std::string name_;
  std::mt19937_64 random_;
  v1::Job last_;
  bool is_over_ = false;
  int cuts_ = 0;
  int missed_ = 0;
};

TEST(WatchCutsTest, NothingIsMissed) {
  // No heartbeat: what is not told when it happens is never told.
  SoakServer server({"--watch-heartbeat", "1h"});
  std::uint64_t next_seed = PrintedSeed();
  v1::CreateJobRequest request;
  *request.mutable_mesh_x() = ToDraco(BumpySphere(/*levels=*/1));
  *request.mutable_mesh_y() = request.mesh_x();
  const int wanted = Rounds("ISOMATCH_CUTS", 200, 1000);
  int cuts = 0;
  int missed = 0;
  while (cuts < wanted && !HasFailure()) {
    const auto job = CreateJob(server.stub(), request);
    ASSERT_TRUE(job.ok()) << job.status();
    std::vector<std::unique_ptr<CuttingWatcher>> watchers;
    std::vector<std::thread> threads;
    for (int i = 0; i < 4; ++i) {
      watchers.push_back(std::make_unique<CuttingWatcher>(
          server.Connect(), job->name(), next_seed++));
      // Not by way of `watchers`, which still grows.
      threads.emplace_back(
          [watcher = watchers.back().get()] { watcher->Watch(); });
    }
    for (std::thread& thread : threads) thread.join();
    for (const auto& watcher : watchers) {
      cuts += watcher->cuts();
      missed += watcher->missed();
    }
  }
  PrintFigure("watch: streams cut", cuts, "");
  ExpectAtMost("watch: snapshots missed", missed, 0, "");
}

}  // namespace
}  // namespace isomatch
