#include "core/pipeline/torn_maps.h"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::_;
using testing::ElementsAre;

/// A map of which only the scores are told.
Correspondence MapOf(double stretch, double normals, double rank_value) {
  Correspondence map;
  map.scores.stretch = stretch;
  map.scores.normal_mismatch = normals;
  map.scores.rank_value = rank_value;
  map.scores.orientation_score = 1;
  return map;
}

/// Gives the maps in turn, and remembers the random seeds it was asked with.
class TornMapsTest : public testing::Test {
 protected:
  absl::StatusOr<Correspondence> Match(
      std::vector<absl::StatusOr<Correspondence>> maps) {
    return MatchUntilNotTorn(
        {.random_seed = 7}, {stop_.get_token(), hurry_.get_token()},
        [&](const MatchOptions& options, const StopTokens&) {
          seeds_.push_back(options.random_seed);
          if (seeds_.size() == hurry_at_) hurry_.request_stop();
          if (seeds_.size() == stop_at_) stop_.request_stop();
          return maps.at(seeds_.size() - 1);
        });
  }

  const Correspondence torn_ = MapOf(0.11, 0.04, 3e-4);
  const Correspondence worse_ = MapOf(0.13, 0.04, 8e-4);
  const Correspondence right_ = MapOf(0.01, 0.01, 2e-6);
  std::vector<std::uint64_t> seeds_;
  std::size_t hurry_at_ = 0;
  std::size_t stop_at_ = 0;
  std::stop_source stop_;
  std::stop_source hurry_;
};

TEST_F(TornMapsTest, AMapThatIsNotTornIsMatchedOnce) {
  EXPECT_EQ(Match({right_})->scores.rank_value, 2e-6);
  EXPECT_THAT(seeds_, ElementsAre(7));
  // Either sign alone is that of other poses and other meshes.
  EXPECT_FALSE(IsTorn(MapOf(0.2, 0.02, 1).scores));
  EXPECT_FALSE(IsTorn(MapOf(0.05, 0.05, 1).scores));
}

TEST_F(TornMapsTest, OtherSeedsAreTriedUntilAMapIsNotTorn) {
  EXPECT_EQ(Match({torn_, right_})->scores.rank_value, 2e-6);
  EXPECT_THAT(seeds_, ElementsAre(7, 8));
}

TEST_F(TornMapsTest, TheBestIsKeptWhereAllAreTorn) {
  EXPECT_EQ(Match({worse_, torn_, worse_})->scores.rank_value, 3e-4);
  EXPECT_THAT(seeds_, ElementsAre(7, 8, 9));
}

TEST_F(TornMapsTest, AHurryEndsItWithWhatThereIs) {
  hurry_at_ = 1;
  EXPECT_EQ(Match({torn_})->scores.rank_value, 3e-4);
  seeds_.clear();
  hurry_ = std::stop_source();
  hurry_at_ = 2;
  EXPECT_EQ(Match({torn_, absl::CancelledError("hurry")})->scores.rank_value,
            3e-4);
  EXPECT_THAT(seeds_, ElementsAre(7, 8));
}

TEST_F(TornMapsTest, AStopEndsIt) {
  stop_at_ = 2;
  EXPECT_THAT(Match({torn_, absl::CancelledError("stop")}),
              StatusIs(absl::StatusCode::kCancelled, _));
}

TEST_F(TornMapsTest, AMirroredMapIsNotLookedForAgain) {
  Correspondence mirrored = torn_;
  mirrored.scores.orientation_score = -1;
  EXPECT_THAT(Match({mirrored}), IsOk());
  EXPECT_THAT(seeds_, ElementsAre(7));
}

}  // namespace
}  // namespace isomatch
