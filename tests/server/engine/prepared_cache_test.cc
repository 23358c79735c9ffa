#include "server/engine/prepared_cache.h"

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/pipeline/matcher.h"
#include "server/engine/match_with_cache.h"
#include "server/storage/memory_blob_store.h"
#include "tests/support/matchers.h"
#include "tests/support/quick_options.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

PreparedShape Prepared(const TriangleMesh& mesh) {
  auto shape = Prepare(mesh, QuickOptions());
  EXPECT_THAT(shape, IsOk());
  return *std::move(shape);
}

BlobKey Key(const std::string& name) { return {"tenant", name}; }

class PreparedCacheTest : public testing::Test {
 protected:
  static constexpr std::int64_t kMiB = 1 << 20;
  const PreparedShape shape_ = Prepared(UnitSphere(2));
  const std::int64_t bytes_ = PreparedShapeBytes(shape_);
  MemoryBlobStore disk_{64 * kMiB};
};

TEST_F(PreparedCacheTest, FindsWhatItKeptForThatTenantAndName) {
  PreparedCache cache(kMiB * 8, nullptr);
  EXPECT_FALSE(cache.Find(Key("a"), {}));
  cache.Keep(Key("a"), shape_);
  EXPECT_TRUE(cache.Find(Key("a"), {}));
  EXPECT_FALSE(cache.Find(Key("b"), {}));
  EXPECT_FALSE(cache.Find({"other", "a"}, {}));
  EXPECT_EQ(cache.size_bytes(), bytes_);
  EXPECT_EQ(cache.counts().in_memory, 1);
  EXPECT_EQ(cache.counts().missing, 3);
}

TEST_F(PreparedCacheTest, TheLeastRecentlyUsedGoesFirstAndTheRoomHolds) {
  PreparedCache cache(2 * bytes_, nullptr);
  cache.Keep(Key("a"), shape_);
  cache.Keep(Key("b"), shape_);
  EXPECT_TRUE(cache.Find(Key("a"), {}));  // now b is the older one
  cache.Keep(Key("c"), shape_);
  EXPECT_LE(cache.size_bytes(), 2 * bytes_);
  EXPECT_TRUE(cache.Find(Key("a"), {}));
  EXPECT_FALSE(cache.Find(Key("b"), {}));
  PreparedCache tiny(bytes_ - 1, nullptr);
  tiny.Keep(Key("a"), shape_);
  EXPECT_FALSE(tiny.Find(Key("a"), {}));
  EXPECT_EQ(tiny.size_bytes(), 0);
}

TEST_F(PreparedCacheTest, WhatIsUsedAgainOutlivesTheProcess) {
  {
    PreparedCache cache(8 * kMiB, &disk_);
    cache.Keep(Key("once"), shape_);
    cache.Keep(Key("twice"), shape_);
    EXPECT_TRUE(cache.Find(Key("twice"), {}));
  }
  EXPECT_FALSE(disk_.Has(Key("once")));
  PreparedCache next(8 * kMiB, &disk_);
  EXPECT_FALSE(next.Find(Key("once"), {}));
  const auto found = next.Find(Key("twice"), {});
  ASSERT_TRUE(found);
  EXPECT_EQ(SerializePreparedShape(*found), SerializePreparedShape(shape_));
  EXPECT_EQ(next.counts().on_disk, 1);
  EXPECT_TRUE(next.Find(Key("twice"), {}));  // in memory now
  EXPECT_EQ(next.counts().in_memory, 1);
}

TEST_F(PreparedCacheTest, DamagedBytesAreAsGoodAsNone) {
  std::string bytes = SerializePreparedShape(shape_);
  bytes[bytes.size() / 2] ^= 1;
  ASSERT_THAT(disk_.Put(Key("a"), bytes, Keep::kWhileRoom), IsOk());
  PreparedCache cache(8 * kMiB, &disk_);
  EXPECT_FALSE(cache.Find(Key("a"), {}));
  EXPECT_EQ(cache.counts().missing, 1);
  EXPECT_FALSE(disk_.Has(Key("a")));  // and make room for good ones
}

/// Matches through a cache and counts what is prepared.
class MatchWithCacheTest : public testing::Test {
 protected:
  MatchWithCacheTest() {
    spec_.mesh_x = FiveArms(3);
    spec_.mesh_y = Moved(FiveArms(3), 2);
    spec_.options = QuickOptions();
    spec_.prepared_x = Key("x");
    spec_.prepared_y = Key("y");
    engine_.prepare_both = [this](ShapeSource x, ShapeSource y,
                                  auto&&... arguments) {
      prepared_ += std::holds_alternative<SharedMesh>(x);
      prepared_ += std::holds_alternative<SharedMesh>(y);
      return PrepareBoth(std::move(x), std::move(y), arguments...);
    };
  }

  VertexMap Match() {
    fractions_.clear();
    JobSpec spec = spec_;
    const auto found =
        MatchWithCache(engine_, spec, cache_, {[this](const Progress& p) {
                         fractions_.push_back(p.total_fraction);
                       }});
    EXPECT_THAT(found, IsOk());
    EXPECT_TRUE(std::is_sorted(fractions_.begin(), fractions_.end()));
    EXPECT_EQ(fractions_.back(), 1);
    return found.ok() ? found->y_from_x : VertexMap();
  }

  absl::Status Failure(const std::stop_token& stop = {}) {
    JobSpec spec = spec_;
    return MatchWithCache(engine_, spec, cache_, {.stop = stop}).status();
  }

  MatchEngine engine_ = CoreMatchEngine();
  JobSpec spec_;
  PreparedCache cache_{std::int64_t{64} << 20, nullptr};
  int prepared_ = 0;
  std::vector<double> fractions_;
};

TEST_F(MatchWithCacheTest, EachMeshIsPreparedOnceAndTheMapIsTheSame) {
  const auto direct =
      isomatch::Match(spec_.mesh_x, spec_.mesh_y, {}, spec_.options);
  ASSERT_THAT(direct, IsOk());
  EXPECT_EQ(Match(), direct->y_from_x);
  EXPECT_EQ(prepared_, 2);
  EXPECT_EQ(Match(), direct->y_from_x);
  EXPECT_EQ(prepared_, 2);
  spec_.prepared_y = Key("another");  // of the same bytes, as it happens
  EXPECT_EQ(Match(), direct->y_from_x);
  EXPECT_EQ(prepared_, 3);
  std::swap(spec_.prepared_x, spec_.prepared_y);
  std::swap(spec_.mesh_x, spec_.mesh_y);
  Match();
  EXPECT_EQ(prepared_, 3);
}

TEST_F(MatchWithCacheTest, MeshesWithoutANameAreNotKept) {
  spec_.prepared_x.reset();
  Match();
  Match();
  EXPECT_EQ(prepared_, 3);
  EXPECT_EQ(cache_.counts().missing, 1);
}

TEST_F(MatchWithCacheTest, AnErrorOfTheMeshThatWasNotThereNamesIt) {
  Match();
  spec_.prepared_y = Key("flat");
  spec_.mesh_y.positions.setZero();
  EXPECT_THAT(Failure(), StatusIs(absl::StatusCode::kInvalidArgument,
                                  testing::StartsWith("mesh_y: surface area")));
}

TEST_F(MatchWithCacheTest, ErrorsOfPreparationEndTheMatch) {
  spec_.mesh_y.positions.setZero();
  EXPECT_THAT(Failure(), StatusIs(absl::StatusCode::kInvalidArgument,
                                  testing::HasSubstr("mesh_y")));
  EXPECT_EQ(cache_.size_bytes(), 0);
  std::stop_source stop;
  stop.request_stop();
  spec_.mesh_y = spec_.mesh_x;
  EXPECT_THAT(Failure(stop.get_token()),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

TEST_F(MatchWithCacheTest, WithoutRoomNothingIsKeptAndTheMapIsTheSame) {
  const VertexMap kept = Match();
  PreparedCache none(0, nullptr);
  JobSpec spec = spec_;
  const auto found = MatchWithCache(engine_, spec, none, {});
  ASSERT_THAT(found, IsOk());
  EXPECT_EQ(found->y_from_x, kept);
  EXPECT_EQ(prepared_, 4);
  EXPECT_EQ(none.counts().missing, 0);
}

}  // namespace
}  // namespace isomatch
