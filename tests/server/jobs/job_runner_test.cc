#include "server/jobs/job_runner.h"

#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "server/jobs/errors.h"
#include "tests/support/matchers.h"
#include "tests/support/unprepared_engine.h"

namespace isomatch {
namespace {

using testing::_;
using testing::ElementsAre;
using testing::HasSubstr;

/// A runner around `match`, with a clock that the test sets.
class JobRunnerTest : public testing::Test {
 protected:
  JobRunner Runner(decltype(MatchEngine::match) match) {
    MatchEngine engine = UnpreparedEngine();
    engine.match = std::move(match);
    engine.estimate = [](MeshSize x, MeshSize y, std::int64_t, const auto&) {
      return x.vertices + y.vertices;
    };
    const auto describe = [](auto&&, MeshSize x, MeshSize y,
                             const Correspondence& found) {
      return absl::StrCat(x.vertices, " vertices to ", y.vertices, ", ",
                          found.y_from_x.size(), " images");
    };
    return JobRunner(
        engine, describe, [this] { return now_; }, no_cache_);
  }

  absl::StatusOr<RunOutcome> Run(decltype(MatchEngine::match) match) {
    return Runner(std::move(match))
        .Run([] { return JobSpec(); },
             [this](const auto& progress) {
               reports_.push_back(progress.stage_fraction);
             },
             {});
  }

  PreparedCache no_cache_{0, nullptr};
  absl::Time now_ = absl::UnixEpoch();
  std::vector<double> reports_;
};

TEST_F(JobRunnerTest, TheMapIsLittleEndianAndNoMatchIsAllOnes) {
  const auto outcome = Run([](auto&&...) {
    Correspondence found;
    found.y_from_x = {0x0102, kNoVertex};
    return found;
  });
  ASSERT_THAT(outcome, IsOk());
  ASSERT_EQ(outcome->parts.size(), 1);
  EXPECT_EQ(outcome->parts[0].part, ResultPart::kMap);
  EXPECT_EQ(outcome->parts[0].bytes,
            std::string("\x02\x01\0\0\xFF\xFF\xFF\xFF", 8));
  EXPECT_GT(outcome->result.peak_resident_bytes, 1 << 20);
}

TEST_F(JobRunnerTest, TheMapIsDescribedWithTheSizesOfTheMeshes) {
  JobSpec spec;
  spec.mesh_x.positions.resize(3, 3);
  spec.mesh_y.positions.resize(5, 3);
  const auto runner = Runner([](auto&&...) {
    Correspondence found;
    found.y_from_x = {0, kNoVertex, 1};
    return found;
  });
  const auto outcome = runner.Run([&] { return spec; }, [](auto&&) {}, {});
  ASSERT_THAT(outcome, IsOk());
  EXPECT_EQ(outcome->result.info, "3 vertices to 5, 3 images");
}

TEST_F(JobRunnerTest, MeasuresTheSecondsOfEachStage) {
  const auto outcome =
      Run([this](auto&&, auto&&, auto&&, auto&&, const MatchControl& control) {
        control.progress({Stage::kGeodesics, 0, 0});
        now_ += absl::Seconds(3);
        control.progress({Stage::kGeodesics, 1, 0.5});
        control.progress({Stage::kDense, 0, 0.5});
        now_ += absl::Seconds(2);
        control.progress({Stage::kDense, 1, 1});
        return Correspondence();
      });
  ASSERT_THAT(outcome, IsOk());
  const auto& times = outcome->result.stage_times;
  ASSERT_EQ(times.size(), 2);
  EXPECT_EQ(times[0].stage, static_cast<int>(Stage::kGeodesics));
  EXPECT_EQ(times[0].seconds, 3);
  EXPECT_EQ(times[1].seconds, 2);
  EXPECT_EQ(outcome->result.run_seconds, 5);
}

TEST_F(JobRunnerTest, PassesOnAReportEveryTenthOfASecondAndAllEnds) {
  (void)Run(
      [this](auto&&, auto&&, auto&&, auto&&, const MatchControl& control) {
        for (const double fraction : {0.0, 0.1, 0.2, 0.3}) {
          control.progress({Stage::kSeeds, fraction, 0});
          now_ += absl::Milliseconds(60);
        }
        control.progress({Stage::kSeeds, 1, 0});
        return Correspondence();
      });
  EXPECT_THAT(reports_, ElementsAre(0.0, 0.2, 1.0));
}

TEST_F(JobRunnerTest, AFailedAllocationIsAnErrorOfTheJob) {
  const auto outcome = Run([](auto&&...) -> absl::StatusOr<Correspondence> {
    throw std::bad_alloc();
  });
  EXPECT_THAT(outcome, StatusIs(absl::StatusCode::kResourceExhausted, _));
  EXPECT_EQ(DetailsOf(outcome.status()).reason, "OUT_OF_MEMORY");
}

TEST_F(JobRunnerTest, ARefusalNamesItsReasonAndField) {
  const auto refused = [this](const char* problem) {
    const auto outcome =
        Run([&](auto&&...) { return absl::InvalidArgumentError(problem); });
    EXPECT_TRUE(absl::IsInvalidArgument(outcome.status()));
    EXPECT_EQ(outcome.status().message(), problem);
    const ErrorDetails details = DetailsOf(outcome.status());
    return absl::StrCat(details.reason, " of ", details.field);
  };
  EXPECT_EQ(refused("mesh_x: no surface"), "MESH_MALFORMED of mesh_x");
  EXPECT_EQ(refused("mesh_y: no surface"), "MESH_MALFORMED of mesh_y");
  EXPECT_EQ(refused("landmarks[2].x: on no face"),
            "INVALID_FIELD of landmarks[2].x");
  EXPECT_EQ(refused("something else"), "INVALID_ARGUMENT of ");
}

TEST_F(JobRunnerTest, TheMethodIsHeldToTheEstimate) {
  std::vector<std::int64_t> limits;
  const JobRunner runner =
      Runner([&](auto&&, auto&&, auto&&, const MatchOptions& options,
                 auto&&...) -> absl::StatusOr<Correspondence> {
        limits.push_back(options.memory_limit_bytes);
        return absl::ResourceExhaustedError("cannot be decimated");
      });
  JobSpec spec;
  spec.mesh_x.positions.resize(10, 3);
  spec.mesh_y.positions.resize(10, 3);
  const std::int64_t estimate = runner.EstimateBytes(spec);
  for (const std::int64_t limit :
       {std::int64_t{0}, estimate - 1, estimate + 1}) {
    spec.options.memory_limit_bytes = limit;
    const auto outcome = runner.Run([&] { return spec; }, [](auto&&) {}, {});
    EXPECT_THAT(outcome, StatusIs(absl::StatusCode::kResourceExhausted,
                                  "cannot be decimated"));
    EXPECT_EQ(DetailsOf(outcome.status()).reason, "OUT_OF_MEMORY");
  }
  EXPECT_THAT(limits, ElementsAre(estimate, estimate - 1, estimate));
}

TEST_F(JobRunnerTest, AnyOtherExceptionIsInternal) {
  EXPECT_THAT(Run([](auto&&...) -> absl::StatusOr<Correspondence> {
                throw std::length_error("too long");
              }),
              StatusIs(absl::StatusCode::kInternal, HasSubstr("too long")));
}

TEST_F(JobRunnerTest, TheEstimateIncludesTheMeshes) {
  JobSpec spec;
  spec.mesh_x.positions.resize(10, 3);
  spec.mesh_y.faces.resize(5, 3);
  EXPECT_EQ(Runner(nullptr).EstimateBytes(spec), 10 * 3 * 8 + 5 * 3 * 4 + 10);
}

}  // namespace
}  // namespace isomatch
