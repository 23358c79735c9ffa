#include <malloc.h>

#include <cstdint>
#include <cstring>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <boost/crc.hpp>

#include "core/pipeline/correspondence.h"
#include "core/pipeline/match_options.h"
#include "core/pipeline/matcher.h"
#include "core/pipeline/prepared_shape.h"
#include "core/pipeline/shape_contents.h"
#include "tests/support/dirty_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/quick_options.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::HasSubstr;

/// Everything of a result that a user sees.
void ExpectSame(const Correspondence& a, const Correspondence& b) {
  EXPECT_EQ(a.y_from_x, b.y_from_x);
  EXPECT_EQ(a.confidence, b.confidence);
  EXPECT_EQ(a.objective, b.objective);
  EXPECT_EQ(a.scores.rank_value, b.scores.rank_value);
  EXPECT_EQ(a.quality.geodesic_distortion, b.quality.geodesic_distortion);
  EXPECT_EQ(a.warnings_x, b.warnings_x);
  ASSERT_EQ(a.precise.size(), b.precise.size());
  for (std::size_t v = 0; v < a.precise.size(); ++v) {
    EXPECT_EQ(a.precise[v].vertices, b.precise[v].vertices);
    EXPECT_EQ(a.precise[v].weights, b.precise[v].weights);
  }
}

/// With meshes that are decimated (700) and ones that are not (0).
class PreparedShapeTest : public testing::TestWithParam<int> {
 protected:
  PreparedShapeTest() { options_.solved_vertices = GetParam(); }

  PreparedShape Prepared(const TriangleMesh& mesh) const {
    auto shape = Prepare(mesh, options_);
    EXPECT_THAT(shape, IsOk());
    return *std::move(shape);
  }

  TriangleMesh TwoComponents() const {
    return Joined(Untouched(FiveArms(3)), Untouched(Moved(BumpySphere(3), 1)),
                  x_.num_vertices())
        .mesh;
  }

  MatchOptions options_ = QuickOptions();
  const TriangleMesh x_ = FiveArms(3);
  const TriangleMesh y_ = Moved(FiveArms(4), 2);
};

INSTANTIATE_TEST_SUITE_P(Solved, PreparedShapeTest, testing::Values(700, 0));

TEST_P(PreparedShapeTest, GivesTheSameResultAsTheMeshes) {
  const auto direct = Match(x_, y_, {}, options_);
  ASSERT_THAT(direct, IsOk());
  const auto prepared = MatchPrepared(Prepared(x_), Prepared(y_), {}, options_);
  ASSERT_THAT(prepared, IsOk());
  ExpectSame(*direct, *prepared);
}

TEST_P(PreparedShapeTest, BothAtOnceAreAsOneByOne) {
  const auto pair = PrepareBoth(x_, y_, options_);
  ASSERT_THAT(pair, IsOk());
  EXPECT_EQ(SerializePreparedShape(pair->x),
            SerializePreparedShape(Prepared(x_)));
  EXPECT_EQ(SerializePreparedShape(pair->y),
            SerializePreparedShape(Prepared(y_)));
  EXPECT_THAT(PrepareBoth(x_, TriangleMesh(), options_),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       testing::StartsWith("mesh_y")));
}

TEST_P(PreparedShapeTest, ItsSizeIsAnUpperBoundAndNotAWildOne) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers change what a process allocates";
#endif
  const auto in_use = [] {
    const struct mallinfo2 heap = mallinfo2();
    return static_cast<std::int64_t>(heap.uordblks + heap.hblkhd);
  };
  (void)Prepared(y_);  // what stays allocated after the first time
  const std::int64_t before = in_use();
  const PreparedShape shape = Prepared(y_);
  const std::int64_t measured = in_use() - before;
  RecordProperty("measured_bytes", std::to_string(measured));
  EXPECT_GE(PreparedShapeBytes(shape), measured);
  EXPECT_LE(PreparedShapeBytes(shape), 2 * measured);
}

TEST_P(PreparedShapeTest, FacesThatCleaningRemovesCountToo) {
  TriangleMesh repeated = UnitSphere(1);
  const Faces once = repeated.faces;
  constexpr int kTimes = 1000;
  repeated.faces = once.replicate(kTimes, 1);
  EXPECT_GE(
      PreparedShapeBytes(Prepared(repeated)),
      kTimes * once.size() * static_cast<std::int64_t>(sizeof(VertexIndex)));
}

TEST_P(PreparedShapeTest, OptionsThatPrepareAlikeHaveTheSameText) {
  MatchOptions other = options_;
  other.random_seed += 1;
  other.threads = 2;
  EXPECT_EQ(PreparationText(options_), PreparationText(other));
  other.solved_vertices += 1;
  EXPECT_NE(PreparationText(options_), PreparationText(other));
}

TEST_P(PreparedShapeTest, SurvivesSerialization) {
  const PreparedShape x = Prepared(x_);
  const PreparedShape y = Prepared(y_);
  const std::string bytes = SerializePreparedShape(y);
  const auto read = ParsePreparedShape(bytes);
  ASSERT_THAT(read, IsOk());
  EXPECT_EQ(SerializePreparedShape(*read), bytes);
  const auto before = MatchPrepared(x, y, {}, options_);
  const auto after = MatchPrepared(x, *read, {}, options_);
  ASSERT_THAT(before, IsOk());
  ASSERT_THAT(after, IsOk());
  ExpectSame(*before, *after);
}

TEST_P(PreparedShapeTest, ServesLandmarksOnEitherSideOfASymmetry) {
  // The mirrored map needs the mirror image of what was prepared.
  const TriangleMesh body = MirrorSymmetricBody(4);
  const PreparedShape shape = Prepared(body);
  std::vector<Landmark> landmarks;
  for (VertexIndex v = 0; v < body.num_vertices(); v += 200) {
    Eigen::RowVector3d place = body.positions.row(v);
    place[2] *= -1;
    Eigen::Index image;
    (body.positions.rowwise() - place).rowwise().norm().minCoeff(&image);
    landmarks.push_back({v, static_cast<VertexIndex>(image)});
  }
  MatchOptions options = options_;
  options.landmarks_exact = true;
  const auto direct = Match(body, body, landmarks, options);
  const auto prepared = MatchPrepared(shape, shape, landmarks, options);
  ASSERT_THAT(direct, IsOk());
  ASSERT_THAT(prepared, IsOk());
  ASSERT_LT(direct->scores.orientation_score, 0);
  ExpectSame(*direct, *prepared);
  // And leaves it as it was.
  ExpectSame(*Match(body, body, {}, options_),
             *MatchPrepared(shape, shape, {}, options_));
}

TEST_P(PreparedShapeTest, MeshesOfSeveralComponentsMatchAsWell) {
  const TriangleMesh two = TwoComponents();
  const auto direct = Match(two, two, {}, options_);
  const PreparedShape shape = Prepared(two);
  const auto prepared = MatchPrepared(shape, shape, {}, options_);
  ASSERT_THAT(direct, IsOk());
  ASSERT_THAT(prepared, IsOk());
  ExpectSame(*direct, *prepared);
  // Nothing was computed for the two together, and what is read again from
  // bytes serves as well.
  EXPECT_FALSE(shape.contents().whole);
  const auto read = ParsePreparedShape(SerializePreparedShape(shape));
  ASSERT_THAT(read, IsOk());
  const auto again = MatchPrepared(shape, *read, {}, options_);
  ASSERT_THAT(again, IsOk());
  ExpectSame(*direct, *again);
}

TEST_P(PreparedShapeTest, OneComponentMeetsTwoAsItsMeshDoes) {
  const TriangleMesh two = TwoComponents();
  for (const bool two_first : {false, true}) {
    const TriangleMesh& x = two_first ? two : x_;
    const TriangleMesh& y = two_first ? x_ : two;
    const auto direct = Match(x, y, {}, options_);
    const auto prepared = MatchPrepared(Prepared(x), Prepared(y), {}, options_);
    ASSERT_THAT(direct, IsOk());
    ASSERT_THAT(prepared, IsOk());
    ExpectSame(*direct, *prepared);
  }
}

TEST_P(PreparedShapeTest, WhatWasSplitIsPreparedAsAWholeWhenThatIsMatched) {
  const TriangleMesh two = TwoComponents();
  const PreparedShape split = Prepared(two);
  options_.match_components = false;
  const PreparedShape whole = Prepared(two);
  ASSERT_TRUE(split.contents().split);
  ASSERT_TRUE(whole.contents().whole);
  const auto expected = MatchPrepared(whole, whole, {}, options_);
  ASSERT_THAT(expected, IsOk());
  for (const auto& [x, y] : {std::pair(split, split), std::pair(split, whole),
                             std::pair(whole, split)}) {
    const auto found = MatchPrepared(x, y, {}, options_);
    ASSERT_THAT(found, IsOk());
    ExpectSame(*expected, *found);
  }
}

TEST_P(PreparedShapeTest, OnlyTheLastCopyMayBeChanged) {
  PreparedShape shape = Prepared(x_);
  EXPECT_EQ(shape.own_contents(), &shape.contents());
  {
    PreparedShape copy = shape;
    EXPECT_EQ(shape.own_contents(), nullptr);
    EXPECT_EQ(copy.own_contents(), nullptr);
  }
  EXPECT_EQ(shape.own_contents(), &shape.contents());
}

TEST_P(PreparedShapeTest, RefusesOtherOptionsThanItWasPreparedFor) {
  const PreparedShape x = Prepared(x_);
  const auto with = [&](auto change) {
    MatchOptions options = options_;
    change(options);
    return MatchPrepared(x, x, {}, options).status();
  };
  const auto names = [](const char* option) {
    return StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr(option));
  };
  EXPECT_THAT(with([](MatchOptions& o) { o.solved_vertices = 999; }),
              names("mesh_x: prepared with solved_vertices"));
  EXPECT_THAT(with([](MatchOptions& o) { o.pool_size = 99; }),
              names("pool_size"));
  EXPECT_THAT(with([](MatchOptions& o) { o.alignment_basis = 61; }),
              names("spectral basis size"));
  EXPECT_THAT(with([](MatchOptions& o) { o.curvature_radius = 0.1; }),
              names("curvature_radius"));
  EXPECT_THAT(with([](MatchOptions& o) { o.descriptor_radius = 0.2; }),
              names("descriptor_radius"));
  // Others do not matter.
  EXPECT_THAT(with([](MatchOptions& o) { o.random_seed = 7; }), IsOk());
}

TEST_P(PreparedShapeTest, RefusesBytesThatAreCutOrChanged) {
  std::string bytes = SerializePreparedShape(Prepared(x_));
  const auto is_data_loss =
      StatusIs(absl::StatusCode::kDataLoss, HasSubstr("prepared shape"));
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{5}, std::size_t{25}, bytes.size() / 2,
        bytes.size() - 1}) {
    EXPECT_THAT(ParsePreparedShape(bytes.substr(0, size)).status(),
                is_data_loss);
  }
  EXPECT_THAT(ParsePreparedShape(bytes + "x").status(), is_data_loss);
  bytes[bytes.size() / 3] ^= 1;
  EXPECT_THAT(ParsePreparedShape(bytes).status(), is_data_loss);
}

TEST_P(PreparedShapeTest, RefusesPartsThatDoNotFit) {
  // Whoever writes the checksum anew gets no further.
  const std::string bytes = SerializePreparedShape(Prepared(x_));
  const std::size_t begin = bytes.find(' ', bytes.find(' ') + 1) + 1 + 4;
  int refused = 0;
  for (std::size_t at = begin; at + 8 < bytes.size(); at += bytes.size() / 97) {
    std::string hostile = bytes;
    for (std::size_t i = 0; i < 8; ++i) hostile[at + i] = '\xff';
    boost::crc_32_type crc;
    crc.process_bytes(hostile.data() + begin, hostile.size() - begin);
    const std::uint32_t checksum = crc.checksum();
    std::memcpy(hostile.data() + begin - 4, &checksum, 4);
    const auto read = ParsePreparedShape(hostile);
    if (read.ok()) {
      // A finite number for another: wrong, but no harm.
      EXPECT_THAT(MatchPrepared(*read, *read, {}, options_), IsOk());
    } else {
      EXPECT_EQ(read.status().code(), absl::StatusCode::kDataLoss);
      ++refused;
    }
  }
  EXPECT_GT(refused, 80);
}

TEST_P(PreparedShapeTest, NamesWhatIsWrongWithAMesh) {
  TriangleMesh broken = x_;
  broken.faces(0, 0) = 99999;
  EXPECT_THAT(Prepare(broken, options_).status(),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("mesh")));
  EXPECT_THAT(
      MatchPrepared(Prepared(x_), Prepared(y_), {{{0, 0}, {0, 1}}}, options_)
          .status(),
      StatusIs(absl::StatusCode::kInvalidArgument,
               HasSubstr("landmarks[1].x")));
}

TEST_P(PreparedShapeTest, StopsWhenAsked) {
  std::stop_source source;
  source.request_stop();
  EXPECT_THAT(Prepare(x_, options_, {.stop = source.get_token()}).status(),
              StatusIs(absl::StatusCode::kCancelled, testing::_));
}

}  // namespace
}  // namespace isomatch
