#include "tests/soak/told_jobs.h"

#include <algorithm>
#include <cstddef>

#include <gtest/gtest.h>

namespace isomatch {
namespace {

bool IsGone(const absl::Status& status) {
  return absl::IsUnavailable(status) || absl::IsCancelled(status);
}

}  // namespace

int ToldJobs::CountOpen() const {
  int open = 0;
  for (const Sent& sent : sent_) {
    if (sent.end == v1::Job::STATE_UNSPECIFIED && !sent.delete_asked) ++open;
  }
  return open;
}

int ToldJobs::there() const {
  int there = 0;
  for (const Sent& sent : sent_) there += sent.is_deleted ? 0 : 1;
  return there;
}

void ToldJobs::CompareFailed(const v1::Job& job) {
  if (job.error().reason() == "CRASHED_REPEATEDLY" &&
      job.attempt() >= least_attempts_)
    return;
  ++wrong_;
  ADD_FAILURE() << where_ << ": " << job.ShortDebugString();
}

void ToldJobs::Compare(const v1::Job& job, Sent& sent) {
  const bool was_terminal = sent.end != v1::Job::STATE_UNSPECIFIED;
  if (was_terminal && job.state() != sent.end) {
    ++wrong_;
    ADD_FAILURE() << where_ << ": was " << sent.end << ", now "
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
    ADD_FAILURE() << where_ << ": " << problem << " " << job.ShortDebugString();
  }
  sent.end = job.state();
}

bool ToldJobs::Send(Stub& stub, Sent& sent) {
  const auto job = CreateJob(stub, sent.request);
  if (!job.ok()) {
    EXPECT_TRUE(IsGone(job.status())) << job.status();
    return !IsGone(job.status());
  }
  sent.name = job->name();
  Compare(*job, sent);
  return true;
}

bool ToldJobs::Look(Stub& stub, Sent& sent) {
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
    ADD_FAILURE() << where_ << ": " << sent.name << " is lost";
  }
  sent.is_deleted = true;
  return true;
}

bool ToldJobs::Cancel(Stub& stub, Sent& sent) {
  sent.cancel_asked = true;
  const auto job = CancelJob(stub, sent.name);
  if (job.ok()) {
    Compare(*job, sent);
    return true;
  }
  return !IsGone(job.status()) && Look(stub, sent);
}

bool ToldJobs::Delete(Stub& stub, Sent& sent) {
  sent.delete_asked = true;
  const absl::Status status = DeleteJob(stub, sent.name);
  if (IsGone(status)) return false;
  EXPECT_TRUE(status.ok() || absl::IsNotFound(status)) << status;
  sent.is_deleted = true;
  return true;
}

bool ToldJobs::Step(Stub& stub, const std::string& where) {
  where_ = where;
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

void ToldJobs::CheckAtTheEnd(Stub& stub) {
  where_ = "at the end";
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
    CompareResult(stub, sent);
  }
  CompareList(stub, there);
}

void ToldJobs::CompareResult(Stub& stub, const Sent& sent) {
  if (sent.end == v1::Job::STATE_FAILED) ++given_up_;
  if (sent.end != v1::Job::STATE_SUCCEEDED) return;
  const std::string problem =
      known_.ProblemOfDownload(sent.kind, stub, sent.name);
  if (problem.empty()) return;
  ++wrong_;
  ADD_FAILURE() << problem;
}

void ToldJobs::CompareList(Stub& stub, std::size_t there) {
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

std::string ToldJobs::OpenJob() {
  for (auto sent = sent_.rbegin(); sent != sent_.rend(); ++sent) {
    if (sent->end == v1::Job::STATE_UNSPECIFIED && !sent->delete_asked &&
        !sent->name.empty()) {
      return sent->name;
    }
  }
  return "";
}

}  // namespace isomatch
