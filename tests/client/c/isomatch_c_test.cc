#include "client/c/isomatch.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/io/draco_mesh.h"
#include "core/pipeline/matcher.h"
#include "core/pipeline/memory_estimate.h"
#include "tests/support/matchers.h"
#include "tests/support/shapes.h"

namespace isomatch {
namespace {

using testing::ElementsAreArray;
using testing::HasSubstr;
using testing::StartsWith;
using testing::StrEq;

/// Gives back what the library returned.
struct Free {
  void operator()(isomatch_result* result) const {
    isomatch_result_free(result);
  }
  void operator()(isomatch_shape* shape) const { isomatch_shape_free(shape); }
  void operator()(isomatch_error* error) const { isomatch_error_free(error); }
  void operator()(isomatch_options* options) const {
    isomatch_options_free(options);
  }
  void operator()(isomatch_cancel* cancel) const {
    isomatch_cancel_free(cancel);
  }
};
template <typename Object>
using Own = std::unique_ptr<Object, Free>;

isomatch_mesh Borrow(const TriangleMesh& mesh) {
  return {mesh.positions.data(), mesh.num_vertices(), mesh.faces.data(),
          mesh.num_faces()};
}

/// Through Draco, as a server gets it.
TriangleMesh AsSent(const TriangleMesh& mesh) {
  const auto encoded = EncodeDraco(mesh);
  EXPECT_THAT(encoded, IsOk());
  return *DecodeDraco(encoded->bytes, encoded->vertex_order,
                      mesh.num_vertices());
}

class IsomatchCTest : public testing::Test {
 protected:
  IsomatchCTest() : x_(BumpySphere(3)), y_(Rotated(x_)) {
    borrowed_x_ = Borrow(x_);
    borrowed_y_ = Borrow(y_);
    pair_.mesh_x = &borrowed_x_;
    pair_.mesh_y = &borrowed_y_;
  }

  static TriangleMesh Rotated(TriangleMesh mesh) {
    mesh.positions.col(0).swap(mesh.positions.col(1));
    mesh.positions.col(0) *= -1;
    return mesh;
  }

  isomatch_status Match(const isomatch_control* control = nullptr) {
    isomatch_result* result = nullptr;
    isomatch_error* error = nullptr;
    const isomatch_status status =
        isomatch_match(&pair_, options_.get(), control, &result, &error);
    result_.reset(result);
    error_.reset(error);
    EXPECT_EQ(result == nullptr, status != ISOMATCH_OK);
    EXPECT_EQ(error == nullptr, status == ISOMATCH_OK);
    EXPECT_EQ(isomatch_error_status(error), status);
    return status;
  }

  Own<isomatch_shape> Prepare(const isomatch_mesh& mesh) {
    isomatch_shape* shape = nullptr;
    EXPECT_EQ(isomatch_prepare(&mesh, options_.get(), nullptr, &shape, nullptr),
              ISOMATCH_OK);
    return Own<isomatch_shape>(shape);
  }

  isomatch_status Set(const char* name, std::int64_t value) {
    isomatch_error* error = nullptr;
    const isomatch_status status =
        isomatch_options_set_integer(options_.get(), name, value, &error);
    error_.reset(error);
    return status;
  }

  std::vector<std::int32_t> Map() const {
    const std::int32_t* const map = isomatch_result_map(result_.get());
    return {map, map + isomatch_result_num_vertices(result_.get())};
  }

  void ExpectInvalid(const std::string& field, const std::string& text) {
    EXPECT_EQ(Match(), ISOMATCH_INVALID_ARGUMENT);
    EXPECT_THAT(isomatch_error_field(error_.get()), StrEq(field));
    EXPECT_THAT(isomatch_error_message(error_.get()), HasSubstr(text));
  }

  const TriangleMesh x_;
  const TriangleMesh y_;
  isomatch_mesh borrowed_x_ = {};
  isomatch_mesh borrowed_y_ = {};
  isomatch_pair pair_ = {};
  Own<isomatch_options> options_{isomatch_options_new()};
  Own<isomatch_result> result_;
  Own<isomatch_error> error_;
};

TEST_F(IsomatchCTest, TellsAllThatTheCoreFinds) {
  ASSERT_EQ(Set("keep_functional_map", 1), ISOMATCH_OK);
  ASSERT_EQ(Match(), ISOMATCH_OK);
  MatchOptions options;
  options.keep_functional_map = true;
  const auto found = isomatch::Match(AsSent(x_), AsSent(y_), {}, options);
  ASSERT_THAT(found, IsOk());
  const isomatch_result* const result = result_.get();
  EXPECT_EQ(Map(), found->y_from_x);
  const std::size_t n = found->y_from_x.size();
  const float* const confidence = isomatch_result_confidence(result);
  EXPECT_THAT(std::vector(confidence, confidence + n),
              ElementsAreArray(found->confidence));
  const std::int64_t m = isomatch_result_num_vertices_y(result);
  ASSERT_EQ(m, y_.num_vertices());
  const std::uint8_t* const mask = isomatch_result_mask_y(result);
  EXPECT_THAT(std::vector(mask, mask + m), ElementsAreArray(found->matched_y));
  for (std::size_t v = 0; v < n; ++v) {
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(isomatch_result_precise_vertices(result)[3 * v + i],
                found->precise[v].vertices[i]);
      EXPECT_EQ(isomatch_result_precise_weights(result)[3 * v + i],
                found->precise[v].weights[i]);
    }
  }
  EXPECT_EQ(isomatch_result_num_alternatives(result),
            static_cast<std::int64_t>(found->alternatives.size()));
  for (std::size_t i = 0; i < found->alternatives.size(); ++i) {
    const std::int32_t* const map =
        isomatch_result_alternative(result, static_cast<std::int64_t>(i));
    EXPECT_THAT(std::vector(map, map + n),
                ElementsAreArray(found->alternatives[i].y_from_x));
  }
  const Eigen::MatrixXd& matrix = found->functional_map;
  const auto k = isomatch_result_functional_map_size(result);
  ASSERT_EQ(k, matrix.rows());
  EXPECT_EQ(isomatch_result_functional_map(result)[k + 2], matrix(1, 2));
  EXPECT_EQ(isomatch_result_eigenvalues_x(result)[k - 1],
            found->eigenvalues_x(k - 1));
  EXPECT_EQ(isomatch_result_eigenvalues_y(result)[1], found->eigenvalues_y(1));
  EXPECT_THAT(isomatch_result_verdict(result),
              StrEq(VerdictName(found->verdict.level)));
  EXPECT_EQ(isomatch_result_verdict_reason(result), found->verdict.reason);
  EXPECT_EQ(isomatch_result_verdict_advice(result), found->verdict.advice);
  EXPECT_EQ(isomatch_result_figure(result, "mean_confidence"),
            found->quality.mean_confidence);
  EXPECT_EQ(isomatch_result_figure(result, "area_x"), found->area_x);
  EXPECT_EQ(isomatch_result_num_warnings(result),
            static_cast<std::int64_t>(found->warnings_x.size() +
                                      found->warnings_y.size() +
                                      found->warnings.size()));
}

TEST_F(IsomatchCTest, TheOrderOfFacesDoesNotMatter) {
  ASSERT_EQ(Match(), ISOMATCH_OK);
  const std::vector<std::int32_t> before = Map();
  TriangleMesh other = x_;
  other.faces.colwise().reverseInPlace();
  for (Eigen::Index f = 0; f < other.faces.rows(); f += 2) {
    other.faces.row(f) << x_.faces(x_.faces.rows() - 1 - f, 1),
        x_.faces(x_.faces.rows() - 1 - f, 2),
        x_.faces(x_.faces.rows() - 1 - f, 0);
  }
  const isomatch_mesh borrowed = Borrow(other);
  pair_.mesh_x = &borrowed;
  ASSERT_EQ(Match(), ISOMATCH_OK);
  EXPECT_EQ(Map(), before);
}

TEST_F(IsomatchCTest, WhatIsNotThereIsSaid) {
  ASSERT_EQ(Match(), ISOMATCH_OK);
  const isomatch_result* const result = result_.get();
  EXPECT_TRUE(std::isnan(isomatch_result_figure(result, "beauty")));
  EXPECT_EQ(isomatch_result_alternative(result, 1000), nullptr);
  EXPECT_EQ(isomatch_result_alternative(result, -1), nullptr);
  EXPECT_EQ(isomatch_result_warning(result, 1000), nullptr);
  EXPECT_EQ(isomatch_result_landmark_kept(result, 0), -1);
  EXPECT_EQ(isomatch_result_functional_map_size(result), 0);
}

TEST_F(IsomatchCTest, ShapesGiveWhatTheirMeshesGive) {
  ASSERT_EQ(Match(), ISOMATCH_OK);
  const std::vector<std::int32_t> of_meshes = Map();
  const Own<isomatch_shape> x = Prepare(borrowed_x_);
  const Own<isomatch_shape> y = Prepare(borrowed_y_);
  pair_.mesh_x = nullptr;
  pair_.shape_x = x.get();
  for (int round = 0; round < 2; ++round) {  // of one and of both
    ASSERT_EQ(Match(), ISOMATCH_OK) << isomatch_error_message(error_.get());
    EXPECT_EQ(Map(), of_meshes);
    pair_.mesh_y = nullptr;
    pair_.shape_y = y.get();
  }
}

TEST_F(IsomatchCTest, LandmarksAreKeptOrNot) {
  const isomatch_landmark landmarks[] = {{3, 3}, {40, 40}, {77, 77}};
  pair_.landmarks = landmarks;
  pair_.num_landmarks = 3;
  ASSERT_EQ(Match(), ISOMATCH_OK);
  for (const auto& [x, y] : landmarks) EXPECT_EQ(Map()[x], y);
  EXPECT_EQ(isomatch_result_landmark_kept(result_.get(), 2), 1);
}

TEST_F(IsomatchCTest, WrongArgumentsAreNamed) {
  TriangleMesh torn = y_;
  torn.faces(7, 1) = torn.num_vertices();
  const isomatch_mesh borrowed = Borrow(torn);
  pair_.mesh_y = &borrowed;
  ExpectInvalid("mesh_y", "face 7 names vertex 642, expected 0 to 641");
  pair_.mesh_y = nullptr;
  ExpectInvalid("mesh_y", "NULL, expected a mesh");
  isomatch_mesh empty = {nullptr, 4, nullptr, 0};
  pair_.mesh_y = &empty;
  ExpectInvalid("mesh_y", "NULL, expected 4 vertices");
  empty = {x_.positions.data(), -1, x_.faces.data(), 1};
  ExpectInvalid("mesh_y", "-1 vertices, expected 0 to 2147483647");
  empty = {nullptr, 0, nullptr, 0};
  ExpectInvalid("mesh_y", "expected at least one face");
  pair_.mesh_y = &borrowed_y_;
  const isomatch_landmark landmark = {3, 10'000};
  pair_.landmarks = &landmark;
  pair_.num_landmarks = 1;
  ExpectInvalid("landmarks[0].y", "10000");
  pair_.landmarks = nullptr;
  ExpectInvalid("landmarks", "NULL, expected 1");
  pair_.num_landmarks = -1;
  ExpectInvalid("num_landmarks", "-1, expected 0 or more");
  pair_.num_landmarks = 0;
  const Own<isomatch_shape> x = Prepare(borrowed_x_);
  pair_.shape_x = x.get();
  ExpectInvalid("shape_x", "expected NULL beside mesh_x");
  pair_.mesh_x = nullptr;
  ASSERT_EQ(Set("solved_vertices", 500), ISOMATCH_OK);
  ExpectInvalid("mesh_x", "solved_vertices");
}

TEST_F(IsomatchCTest, NobodyNeedsAnError) {
  pair_.mesh_x = nullptr;
  isomatch_result* result = nullptr;
  EXPECT_EQ(isomatch_match(&pair_, nullptr, nullptr, &result, nullptr),
            ISOMATCH_INVALID_ARGUMENT);
  EXPECT_EQ(result, nullptr);
}

TEST_F(IsomatchCTest, OptionsAreChecked) {
  EXPECT_EQ(Set("solved_vertices", 20), ISOMATCH_INVALID_ARGUMENT);
  EXPECT_THAT(isomatch_error_field(error_.get()),
              StrEq("options.solved_vertices"));
  EXPECT_EQ(Set("random_seed", -1), ISOMATCH_INVALID_ARGUMENT);
  EXPECT_THAT(isomatch_error_message(error_.get()),
              StartsWith("options.random_seed: -1, expected 0 to "));
  EXPECT_EQ(Set("landmarks_exact", 2), ISOMATCH_INVALID_ARGUMENT);
  EXPECT_EQ(Set("speed", 2), ISOMATCH_INVALID_ARGUMENT);
  EXPECT_THAT(isomatch_error_message(error_.get()),
              HasSubstr("expected random_seed, threads"));
  EXPECT_EQ(
      isomatch_options_set_text(options_.get(), "profile", "fast", nullptr),
      ISOMATCH_INVALID_ARGUMENT);
  for (const char* name : {"threads", "relation", "scale"}) {
    EXPECT_EQ(isomatch_options_set_text(options_.get(), name, "2", nullptr),
              ISOMATCH_INVALID_ARGUMENT);
  }
  isomatch_error* error = nullptr;
  EXPECT_EQ(
      isomatch_options_set_text(options_.get(), "relation", "part", &error),
      ISOMATCH_INVALID_ARGUMENT);
  error_.reset(error);
  EXPECT_THAT(isomatch_error_message(error),
              StrEq("options.relation: 'part', expected whole, part-of-y, "
                    "part-of-x, overlap or auto"));
  EXPECT_EQ(Match(), ISOMATCH_OK);  // none of it holds
}

TEST_F(IsomatchCTest, AProfileKeepsWhatIsNotItsOwn) {
  ASSERT_EQ(Set("random_seed", 7), ISOMATCH_OK);
  ASSERT_EQ(
      isomatch_options_set_text(options_.get(), "profile", "paper", nullptr),
      ISOMATCH_OK);
  ASSERT_EQ(Match(), ISOMATCH_OK);
  MatchOptions options = MatchOptions::ForProfile(Profile::kPaper);
  options.random_seed = 7;
  EXPECT_EQ(Map(),
            isomatch::Match(AsSent(x_), AsSent(y_), {}, options)->y_from_x);
}

TEST_F(IsomatchCTest, RelationAndScaleAreObeyedInAnyOrder) {
  const auto set = [&](const char* name, const char* value) {
    return isomatch_options_set_text(options_.get(), name, value, nullptr);
  };
  ASSERT_EQ(set("scale", "same"), ISOMATCH_OK);
  ExpectInvalid("options.scale", "same, expected auto");
  ASSERT_EQ(set("relation", "part-of-y"), ISOMATCH_OK);
  ASSERT_EQ(set("profile", "default"), ISOMATCH_OK);
  ASSERT_EQ(Match(), ISOMATCH_OK);
  MatchOptions options;
  options.relation = Relation::kPartOfY;
  options.scale = LengthScale::kSame;
  EXPECT_EQ(Map(),
            isomatch::Match(AsSent(x_), AsSent(y_), {}, options)->y_from_x);
  EXPECT_EQ(isomatch_result_figure(result_.get(), "scale"), 1);
  EXPECT_THAT(isomatch_result_report(result_.get()),
              HasSubstr("\"relation\": \"part-of-y\""));
}

TEST_F(IsomatchCTest, ADeadlineTakesTheMapThatIsThere) {
  ASSERT_EQ(Match(), ISOMATCH_OK);
  EXPECT_EQ(isomatch_result_figure(result_.get(), "ended_early"), 0);
  ASSERT_EQ(Set("deadline_milliseconds", 1), ISOMATCH_OK);
  ASSERT_EQ(Match(), ISOMATCH_OK);
  EXPECT_EQ(isomatch_result_figure(result_.get(), "ended_early"), 1);
  EXPECT_THAT(isomatch_result_report(result_.get()),
              HasSubstr("\"ended_early\": true"));
  std::stop_source hurry;
  hurry.request_stop();
  EXPECT_EQ(Map(), isomatch::Match(AsSent(x_), AsSent(y_), {}, MatchOptions(),
                                   {{}, {}, hurry.get_token()})
                       ->y_from_x);
  ASSERT_EQ(Set("deadline_milliseconds", 3'600'000), ISOMATCH_OK);
  ASSERT_EQ(Match(), ISOMATCH_OK);
  EXPECT_EQ(isomatch_result_figure(result_.get(), "ended_early"), 0);
  ASSERT_EQ(
      isomatch_options_set_text(options_.get(), "profile", "paper", nullptr),
      ISOMATCH_OK);
  ExpectInvalid("options.deadline_milliseconds", "expected 0 with the profile");
}

TEST_F(IsomatchCTest, ItIsToldWhenThereIsAMap) {
  const std::unique_ptr<isomatch_cancel, decltype(&isomatch_cancel_free)> watch(
      isomatch_cancel_new(), isomatch_cancel_free);
  struct Seen {
    const isomatch_cancel* watch;
    std::vector<int> has_map;
  } seen = {watch.get(), {}};
  const isomatch_control control = {
      [](void* user, const char*, double, double) {
        auto* const told = static_cast<Seen*>(user);
        told->has_map.push_back(isomatch_cancel_has_map(told->watch));
        return 0;
      },
      &seen, watch.get()};
  isomatch_result* found = nullptr;
  ASSERT_EQ(isomatch_match(&pair_, nullptr, &control, &found, nullptr),
            ISOMATCH_OK);
  isomatch_result_free(found);
  EXPECT_EQ(seen.has_map.front(), 0);
  EXPECT_EQ(seen.has_map.back(), 1);
  EXPECT_TRUE(std::is_sorted(seen.has_map.begin(), seen.has_map.end()));
}

TEST_F(IsomatchCTest, MemoryIsBounded) {
  ASSERT_EQ(Set("memory_limit_bytes", 1000), ISOMATCH_OK);
  ExpectInvalid("options.memory_limit_bytes", "1000");
  std::int64_t bytes = 0;
  const isomatch_sizes sizes = {642, 1280, 642, 1280};
  ASSERT_EQ(isomatch_estimate_bytes(&sizes, nullptr, &bytes, nullptr),
            ISOMATCH_OK);
  EXPECT_EQ(bytes,
            EstimateMemoryBytes({642, 1280}, {642, 1280}, 0, MatchOptions()));
  const isomatch_sizes wrong = {642, 1280, -5, 1280};
  isomatch_error* error = nullptr;
  EXPECT_EQ(isomatch_estimate_bytes(&wrong, nullptr, &bytes, &error),
            ISOMATCH_INVALID_ARGUMENT);
  error_.reset(error);
  EXPECT_THAT(isomatch_error_field(error), StrEq("vertices_y"));
}

struct Followed {
  std::vector<double> totals;
  std::vector<std::string> stages;
  double end_at = 2;
};

int Follow(void* user, const char* stage, double /*stage_fraction*/,
           double total_fraction) {
  auto& followed = *static_cast<Followed*>(user);
  followed.totals.push_back(total_fraction);
  followed.stages.emplace_back(stage);
  return total_fraction >= followed.end_at ? 1 : 0;
}

TEST_F(IsomatchCTest, ProgressNeverFalls) {
  const Own<isomatch_shape> x = Prepare(borrowed_x_);
  for (const bool is_prepared : {false, true}) {
    if (is_prepared) {
      pair_.mesh_x = nullptr;
      pair_.shape_x = x.get();
    }
    Followed followed;
    const isomatch_control control = {Follow, &followed, nullptr};
    ASSERT_EQ(Match(&control), ISOMATCH_OK);
    EXPECT_TRUE(std::is_sorted(followed.totals.begin(), followed.totals.end()));
    EXPECT_EQ(followed.totals.back(), 1);
    EXPECT_EQ(followed.stages.front(), "prepare");
  }
}

TEST_F(IsomatchCTest, TheProgressFunctionMayEndIt) {
  Followed followed;
  followed.end_at = 0.3;
  const isomatch_control control = {Follow, &followed, nullptr};
  EXPECT_EQ(Match(&control), ISOMATCH_CANCELLED);
  EXPECT_LT(followed.totals.back(), 1);
}

TEST_F(IsomatchCTest, AnotherThreadMayEndIt) {
  const Own<isomatch_cancel> cancel(isomatch_cancel_new());
  std::atomic<bool> has_begun = false;
  const auto progress = [](void* user, const char*, double, double) {
    *static_cast<std::atomic<bool>*>(user) = true;
    return 0;
  };
  const isomatch_control control = {progress, &has_begun, cancel.get()};
  const std::jthread canceller([&] {
    while (!has_begun) std::this_thread::yield();
    isomatch_cancel_request(cancel.get());
  });
  EXPECT_EQ(Match(&control), ISOMATCH_CANCELLED);
  EXPECT_EQ(Match(&control), ISOMATCH_CANCELLED) << "it stays requested";
}

TEST_F(IsomatchCTest, SeveralThreadsMatchAtOnce) {
  ASSERT_EQ(Match(), ISOMATCH_OK);
  const std::vector<std::int32_t> alone = Map();
  const Own<isomatch_shape> y = Prepare(borrowed_y_);
  pair_.mesh_y = nullptr;
  pair_.shape_y = y.get();
  std::vector<std::jthread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&] {
      isomatch_result* found = nullptr;
      ASSERT_EQ(
          isomatch_match(&pair_, options_.get(), nullptr, &found, nullptr),
          ISOMATCH_OK);
      const Own<isomatch_result> own(found);
      const std::int32_t* const map = isomatch_result_map(found);
      EXPECT_THAT(std::vector(map, map + alone.size()),
                  ElementsAreArray(alone));
    });
  }
}

TEST_F(IsomatchCTest, NullIsGivenBackWithoutHarm) {
  isomatch_result_free(nullptr);
  isomatch_shape_free(nullptr);
  isomatch_error_free(nullptr);
  isomatch_options_free(nullptr);
  isomatch_cancel_free(nullptr);
  EXPECT_THAT(isomatch_version(), HasSubstr("."));
}

}  // namespace
}  // namespace isomatch
