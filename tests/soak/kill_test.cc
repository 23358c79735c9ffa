// The server is killed with SIGKILL, again and again, at points that chance
// chooses: while it starts, accepts, runs, stores and forgets jobs. What a
// client was told must hold ever after.

#include <csignal>
#include <iostream>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/soak/figures.h"
#include "tests/soak/known_jobs.h"
#include "tests/soak/soak_server.h"
#include "tests/support/temporary_folder.h"

namespace isomatch {
namespace {

/// What a client knows of a request it sent.
struct Sent {
  v1::CreateJobRequest request;
  int kind = 0;
  /// Empty while no answer came: then the same request is sent again.
  std::string name = {};
  /// Asked for, whether or not an answer came.
  bool cancel_asked = false;
  bool delete_asked = false;
  /// Terminal, as an answer said; UNSPECIFIED before.
  v1::Job::State end = v1::Job::STATE_UNSPECIFIED;
  bool is_deleted = false;
};

class KillTest : public testing::Test {
 protected:
  static constexpr int kKinds = 24;
  static constexpr int kMostOpen = 12;

  std::vector<std::string> Flags() const {
    return {"--data-dir",        folder_.Path("data"),
            "--workers",         "2",
            "--max-kept-jobs",   "1000000",
            "--max-queued-jobs", "1000",
            "--threads-per-job", "1"};
  }

  int Random(int bound) {
    return std::uniform_int_distribution<int>(0, bound - 1)(random_);
  }

  void KillWhileItStarts();
  void KillWhileItWorks();
  void CheckAtTheEnd();

  // One call each; false when the server is gone.
  bool Step(Stub& stub);
  bool Send(Stub& stub, Sent& sent);
  bool Look(Stub& stub, Sent& sent);
  bool Cancel(Stub& stub, Sent& sent);
  bool Delete(Stub& stub, Sent& sent);

  void Compare(const v1::Job& job, Sent& sent);
  void CompareFailed(const v1::Job& job);
  int CountOpen() const;

  const TemporaryFolder folder_;
  const std::uint64_t seed_ = PrintedSeed();
  std::mt19937_64 random_{seed_};
  const KnownJobs known_{kKinds};
  std::vector<Sent> sent_;
  int cycle_ = 0;
  int lost_ = 0;
  int wrong_ = 0;
  int given_up_ = 0;
};

bool IsGone(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsCancelled(status);
}

int KillTest::CountOpen() const {
  int open = 0;
  for (const Sent& sent : sent_) {
    if (sent.end == v1::Job::STATE_UNSPECIFIED && !sent.delete_asked) ++open;
  }
  return open;
}

void KillTest::CompareFailed(const v1::Job& job) {
  if (job.error().reason() == "CRASHED_REPEATEDLY" && job.attempt() >= 10)
    return;
  ++wrong_;
  ADD_FAILURE() << "cycle " << cycle_ << ": " << job.ShortDebugString();
}

void KillTest::Compare(const v1::Job& job, Sent& sent) {
  const bool was_terminal = sent.end != v1::Job::STATE_UNSPECIFIED;
  if (was_terminal && job.state() != sent.end) {
    ++wrong_;
    ADD_FAILURE() << "cycle " << cycle_ << ": was " << sent.end << ", now "
                  << job.ShortDebugString();
  }
  if (!IsEnd(job.state())) return;
  if (!was_terminal && job.state() == v1::Job::STATE_FAILED) CompareFailed(job);
  const bool may_be_cancelled =
      job.state() != v1::Job::STATE_CANCELLED || sent.cancel_asked;
  const std::string problem = job.state() == v1::Job::STATE_SUCCEEDED
                                  ? known_.ProblemOf(sent.kind, job)
                                  : "";
  if (!may_be_cancelled || !problem.empty()) {
    ++wrong_;
    ADD_FAILURE() << "cycle " << cycle_ << ": " << problem << " "
                  << job.ShortDebugString();
  }
  sent.end = job.state();
}

bool KillTest::Send(Stub& stub, Sent& sent) {
  const auto job = CreateJob(stub, sent.request);
  if (!job.ok()) {
    EXPECT_TRUE(IsGone(job.status())) << job.status();
    return !IsGone(job.status());
  }
  sent.name = job->name();
  Compare(*job, sent);
  return true;
}

bool KillTest::Look(Stub& stub, Sent& sent) {
  const auto job = GetJob(stub, sent.name);
  if (job.ok()) {
    EXPECT_FALSE(sent.is_deleted) << sent.name << " is back";
    Compare(*job, sent);
    return true;
  }
  if (IsGone(job.status())) return false;
  EXPECT_TRUE(absl::IsNotFound(job.status())) << job.status();
  if (!sent.delete_asked) {
    ++lost_;
    ADD_FAILURE() << "cycle " << cycle_ << ": " << sent.name << " is lost";
  }
  sent.is_deleted = true;
  return true;
}

bool KillTest::Cancel(Stub& stub, Sent& sent) {
  sent.cancel_asked = true;
  const auto job = CancelJob(stub, sent.name);
  if (job.ok()) {
    Compare(*job, sent);
    return true;
  }
  return !IsGone(job.status()) && Look(stub, sent);
}

bool KillTest::Delete(Stub& stub, Sent& sent) {
  sent.delete_asked = true;
  const absl::Status status = DeleteJob(stub, sent.name);
  if (IsGone(status)) return false;
  EXPECT_TRUE(status.ok() || absl::IsNotFound(status)) << status;
  sent.is_deleted = true;
  return true;
}

bool KillTest::Step(Stub& stub) {
  if (!sent_.empty() && sent_.back().name.empty()) {
    return Send(stub, sent_.back());
  }
  if (sent_.empty() || (Random(3) == 0 && CountOpen() < kMostOpen)) {
    const int kind = Random(kKinds);
    sent_.push_back({known_.request(kind), kind});
    sent_.back().request.set_request_id(UniqueRequestId());
    return Send(stub, sent_.back());
  }
  // Rather a late one: those of long ago are looked at now and then.
  const int count = static_cast<int>(sent_.size());
  const int back =
      Random(4) == 0 ? Random(count) : Random(std::min(count, 2 * kMostOpen));
  Sent& sent = sent_[static_cast<size_t>(count - 1 - back)];
  const bool is_terminal = sent.end != v1::Job::STATE_UNSPECIFIED;
  if (!is_terminal && Random(8) == 0) return Cancel(stub, sent);
  if (is_terminal && !sent.is_deleted && Random(8) == 0) {
    return Delete(stub, sent);
  }
  return Look(stub, sent);
}

void KillTest::KillWhileItStarts() {
  std::vector<std::string> flags = Flags();
  flags.insert(flags.end(),
               {"--listen", "127.0.0.1:0", "--metrics-listen", "off"});
  ChildProcess server(ISOMATCH_SERVER_BINARY, flags);
  absl::SleepFor(absl::Milliseconds(Random(80)));
  server.Signal(SIGKILL);
  EXPECT_EQ(server.ExitStatus(), -1);
}

void KillTest::KillWhileItWorks() {
  SoakServer server(Flags());
  // Now and then long enough for each job to end: ten kills fail it.
  const int most = Random(4) == 0 ? 400 : 100;
  std::thread killer([&server, wait = absl::Milliseconds(Random(most))] {
    absl::SleepFor(wait);
    server.Signal(SIGKILL);
  });
  while (Step(server.stub())) {
  }
  killer.join();
  EXPECT_EQ(server.ExitStatus(), -1);
}

void KillTest::CheckAtTheEnd() {
  SoakServer server(Flags());
  Stub& stub = server.stub();
  std::size_t there = 0;
  for (Sent& sent : sent_) {
    if (sent.name.empty()) Send(stub, sent);
    if (sent.delete_asked) {
      // An answer that did not come says nothing: it is done now.
      if (!sent.is_deleted) Delete(stub, sent);
      ASSERT_TRUE(Look(stub, sent));
      continue;
    }
    ++there;
    (void)WaitForEnd(stub, sent.name);
    ASSERT_TRUE(Look(stub, sent));
    EXPECT_NE(sent.end, v1::Job::STATE_UNSPECIFIED) << sent.name;
    if (sent.end == v1::Job::STATE_FAILED) ++given_up_;
    if (sent.end != v1::Job::STATE_SUCCEEDED) continue;
    const std::string problem =
        known_.ProblemOfDownload(sent.kind, stub, sent.name);
    if (problem.empty()) continue;
    ++wrong_;
    ADD_FAILURE() << problem;
  }
  std::size_t listed = 0;
  v1::ListJobsRequest request;
  request.set_page_size(1000);
  v1::ListJobsResponse page;
  do {
    CallContext context;
    ASSERT_TRUE(stub.ListJobs(&context, request, &page).ok());
    listed += static_cast<std::size_t>(page.jobs_size());
    request.set_page_token(page.next_page_token());
  } while (!page.next_page_token().empty());
  EXPECT_EQ(listed, there) << "a request that was sent again made two jobs";
}

TEST_F(KillTest, WhatAClientWasToldHoldsAfterEachKill) {
  const int cycles = Rounds("ISOMATCH_KILLS", 200, 500);
  for (cycle_ = 0; cycle_ < cycles && !HasFailure(); ++cycle_) {
    Random(8) == 0 ? KillWhileItStarts() : KillWhileItWorks();
  }
  CheckAtTheEnd();
  PrintFigure("kill -9: cycles", cycle_, "");
  PrintFigure("kill -9: jobs", static_cast<double>(sent_.size()), "");
  ExpectAtMost("kill -9: accepted jobs lost", lost_, 0, "");
  ExpectAtMost("kill -9: results or states wrong", wrong_, 0, "");
  ExpectAtMost("kill -9: jobs ended by it (CRASHED_REPEATEDLY)", given_up_, 0,
               "");
}

}  // namespace
}  // namespace isomatch
