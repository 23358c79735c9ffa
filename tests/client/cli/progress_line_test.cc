#include "client/cli/progress_line.h"

#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace isomatch {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

const absl::Time kStart = absl::UnixEpoch();

ProgressNews News(double fraction, const std::string& label) {
  ProgressNews news;
  news.fraction = fraction;
  news.label = label;
  return news;
}

TEST(ProgressLineTest, ALineWhenTheLabelChangesAndEveryFewSeconds) {
  std::ostringstream out;
  {
    ProgressLine line(out, ProgressStyle::kLines);
    line.Show(News(0.0, "one"), kStart);
    line.Show(News(0.01, "one"), kStart + absl::Seconds(1));
    line.Show(News(0.02, "two"), kStart + absl::Seconds(2));
    line.Show(News(0.03, "two"), kStart + absl::Seconds(6));
    line.Show(News(0.04, "two"), kStart + absl::Seconds(7));
  }
  EXPECT_EQ(out.str(), "  0 %  one\n  2 %  two\n  4 %  two\n");
}

TEST(ProgressLineTest, TheDetailIsToldButIsNoReasonForALine) {
  std::ostringstream out;
  ProgressLine line(out, ProgressStyle::kLines);
  ProgressNews news = News(0, "3 of 9 pairs");
  news.detail = ", 2 running";
  line.Show(news, kStart);
  news.detail = ", 1 running";
  line.Show(news, kStart);
  EXPECT_EQ(out.str(), "  0 %  3 of 9 pairs, 2 running\n");
}

TEST(ProgressLineTest, TimeLeftComesFromTheSpeedSinceItRuns) {
  std::ostringstream out;
  ProgressLine line(out, ProgressStyle::kLines);
  ProgressNews waiting = News(0, "queued");
  waiting.is_running = false;
  line.Show(waiting, kStart);
  const absl::Time running = kStart + absl::Hours(1);
  line.Show(News(0.0, "first"), running);
  EXPECT_THAT(out.str(), Not(HasSubstr("left")));  // nothing is known yet
  line.Show(News(0.25, "second"), running + absl::Seconds(10));
  EXPECT_THAT(out.str(), EndsWith("second, about 30 s left\n"));
  line.Show(News(1, "third"), running + absl::Seconds(40));
  EXPECT_THAT(out.str(), EndsWith("100 %  third\n"));
}

TEST(ProgressLineTest, ABarIsDrawnOverItselfAndLeavesTheLineClean) {
  std::ostringstream out;
  {
    ProgressLine line(out, ProgressStyle::kBar);
    line.Show(News(0.5, "half"), kStart);
    EXPECT_EQ(out.str(),
              "\r\x1b[K[###############...............]  50 %  half");
  }
  EXPECT_THAT(out.str(), EndsWith("half\r\x1b[K"));
}

TEST(ProgressLineTest, QuietSaysNothing) {
  EXPECT_EQ(ProgressStyleFor(/*is_interactive=*/true, /*quiet=*/true),
            ProgressStyle::kNone);
  EXPECT_EQ(ProgressStyleFor(true, false), ProgressStyle::kBar);
  EXPECT_EQ(ProgressStyleFor(false, false), ProgressStyle::kLines);
  std::ostringstream out;
  {
    ProgressLine line(out, ProgressStyle::kNone);
    line.Show(News(0.5, "half"), kStart);
  }
  EXPECT_THAT(out.str(), IsEmpty());
}

TEST(FormatLeftTest, ChoosesTheUnit) {
  EXPECT_EQ(FormatLeft(absl::Seconds(45)), "45 s");
  EXPECT_EQ(FormatLeft(absl::Minutes(3)), "3 min");
  EXPECT_EQ(FormatLeft(absl::Hours(3)), "3 h");
}

}  // namespace
}  // namespace isomatch
