#include "core/base/parallel.h"

#include <atomic>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace isomatch {
namespace {

TEST(ParallelForTest, CallsEachIndexOnce) {
  std::vector<int> calls(1000, 0);
  EXPECT_THAT(ParallelFor(1000, {}, [&](std::int64_t i) { ++calls[i]; }),
              IsOk());
  EXPECT_THAT(calls, testing::Each(1));
}

TEST(ParallelForTest, ReturnsCancelledAndSkipsTheRest) {
  std::stop_source stop;
  std::atomic<int> calls = 0;
  const absl::Status status =
      ParallelFor(100000, stop.get_token(), [&](std::int64_t) {
        if (++calls == 10) stop.request_stop();
      });
  EXPECT_THAT(status, StatusIs(absl::StatusCode::kCancelled, testing::_));
  EXPECT_LT(calls, 1000);
}

TEST(RunBothTest, ReturnsTheFirstErrorInArgumentOrder) {
  EXPECT_THAT(RunBoth([] { return absl::OkStatus(); },
                      [] { return absl::InternalError("second"); }),
              StatusIs(absl::StatusCode::kInternal, "second"));
  EXPECT_THAT(RunBoth([] { return absl::NotFoundError("first"); },
                      [] { return absl::InternalError("second"); }),
              StatusIs(absl::StatusCode::kNotFound, "first"));
}

TEST(ParallelForVerticesTest, VisitsEveryVertexOnceWhateverTheirNumber) {
  for (const VertexIndex count : {0, 1, 255, 256, 257, 1000}) {
    std::vector<std::atomic<int>> visits(count);
    ASSERT_THAT(
        ParallelForVertices(count, {}, [&](VertexIndex v) { ++visits[v]; }),
        IsOk());
    for (const auto& visit : visits) EXPECT_EQ(visit, 1);
  }
}

}  // namespace
}  // namespace isomatch
