#include "server/convert/list_jobs.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "server/jobs/errors.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::Pair;

v1::ListJobsRequest WalkingAndQueued() {
  v1::ListJobsRequest request;
  (*request.mutable_labels())["pose"] = "walk";
  request.add_states(v1::Job::STATE_QUEUED);
  return request;
}

std::string FieldOf(const v1::ListJobsRequest& request) {
  const auto filter = ParseListJobs(request);
  return filter.ok() ? "none" : DetailsOf(filter.status()).field;
}

TEST(ListJobsTest, TheFilterIsRead) {
  v1::ListJobsRequest request = WalkingAndQueued();
  request.set_page_size(7);
  const auto filter = ParseListJobs(request);
  ASSERT_THAT(filter, IsOk());
  EXPECT_EQ(filter->limit, 7);
  EXPECT_EQ(filter->before_number, 0);
  EXPECT_THAT(filter->states, ElementsAre(JobState::kQueued));
  EXPECT_THAT(filter->labels, ElementsAre(Pair("pose", "walk")));
  EXPECT_EQ(ParseListJobs({})->limit, 100);
}

TEST(ListJobsTest, WhatIsOutOfRangeIsNamed) {
  v1::ListJobsRequest request;
  request.set_page_size(1001);
  EXPECT_EQ(FieldOf(request), "page_size");
  request = WalkingAndQueued();
  request.add_states(static_cast<v1::Job::State>(6));
  EXPECT_EQ(FieldOf(request), "states[1]");
  request = WalkingAndQueued();
  (*request.mutable_labels())[""] = "x";
  EXPECT_EQ(FieldOf(request), "labels");
  request = {};
  for (char key = 'a'; key < 'a' + 17; ++key) {
    (*request.mutable_labels())[std::string(1, key)] = "x";
  }
  EXPECT_EQ(FieldOf(request), "labels");
}

TEST(ListJobsTest, ATokenGoesOnWithTheSameFilterAndAnyPageSize) {
  v1::ListJobsRequest request = WalkingAndQueued();
  for (const std::uint64_t number : {std::uint64_t{1}, ~std::uint64_t{0} / 2}) {
    request.set_page_token(
        MakePageToken(*ParseListJobs(WalkingAndQueued()), number));
    request.set_page_size(3);
    EXPECT_EQ(ParseListJobs(request)->before_number, number);
  }
  request.add_states(v1::Job::STATE_QUEUED);  // once more is the same
  EXPECT_EQ(FieldOf(request), "none");
}

TEST(ListJobsTest, ATokenOfAnotherFilterIsRefused) {
  const std::string token =
      MakePageToken(*ParseListJobs(WalkingAndQueued()), 5);
  v1::ListJobsRequest request;
  request.set_page_token(token);
  EXPECT_EQ(FieldOf(request), "page_token");
  request = WalkingAndQueued();
  request.set_page_token(token);
  (*request.mutable_labels())["pose"] = "run";
  EXPECT_EQ(FieldOf(request), "page_token");
  request = WalkingAndQueued();
  request.set_page_token(token);
  request.add_states(v1::Job::STATE_FAILED);
  EXPECT_EQ(FieldOf(request), "page_token");
}

TEST(ListJobsTest, FiltersThatWouldReadAlikeHaveTokensOfTheirOwn) {
  JobFilter a;
  a.labels = {{"x", "y:z"}};
  JobFilter b;
  b.labels = {{"x:y", "z"}};
  EXPECT_NE(MakePageToken(a, 1), MakePageToken(b, 1));
}

TEST(ListJobsTest, GarbageIsNoToken) {
  const std::string token = MakePageToken({}, 5);
  std::string upper = token;
  upper.back() = upper.back() == 'f' ? '0' : 'f';
  for (const std::string& text :
       {std::string("5"), std::string("x"), token.substr(1), token + "0", upper,
        std::string(32, '0'), std::string(32, '\xff'), "+0x" + token.substr(3),
        MakePageToken({}, 0), MakePageToken({}, std::uint64_t{1} << 63)}) {
    v1::ListJobsRequest request;
    request.set_page_token(text);
    EXPECT_EQ(FieldOf(request), "page_token") << text;
  }
}

TEST(ListJobsTest, APageEndsBeforeAClientRefusesIt) {
  std::vector<JobSnapshot> jobs(1000);
  for (size_t i = 0; i < jobs.size(); ++i) {
    JobRecord& record = jobs[i].record;
    record.id = absl::StrCat(i);
    record.number = 2000 - i;
    record.create_time = absl::UnixEpoch();
    for (char key = 'a'; key < 'q'; ++key) {
      record.labels[std::string(63, key)] = std::string(255, key);
    }
  }
  const JobFilter filter;
  size_t seen = 0;
  int pages = 0;
  while (seen < jobs.size()) {
    v1::ListJobsResponse page;
    FillPage({jobs.begin() + static_cast<std::ptrdiff_t>(seen), jobs.end()},
             filter, 1000, page);
    ASSERT_GT(page.jobs_size(), 0);
    EXPECT_LE(page.ByteSizeLong(), size_t{4} << 20);
    seen += static_cast<size_t>(page.jobs_size());
    ++pages;
    EXPECT_EQ(page.next_page_token(),
              seen == jobs.size()
                  ? ""
                  : MakePageToken(filter, jobs[seen - 1].record.number));
  }
  EXPECT_EQ(pages, 2);
}

}  // namespace
}  // namespace isomatch
