#include "server/jobs/storage_gate.h"

#include <functional>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/manual_executor.h"

namespace isomatch {
namespace {

using testing::ElementsAre;

class StorageGateTest : public testing::Test {
 protected:
  StorageGate::Environment MakeParts(Executor* timers) {
    return {.timers = timers,
            .on_disk = [](const std::function<void()>& work) { work(); },
            .probe =
                [this] {
                  ++probes_;
                  return disk_;
                },
            .on_change =
                [this](const absl::Status& status) {
                  told_.push_back(std::string(status.message()));
                }};
  }

  absl::Status disk_;
  int probes_ = 0;
  std::vector<std::string> told_;
};

TEST_F(StorageGateTest, TriesLessAndLessOften) {
  ManualExecutor timers;
  StorageGate gate(MakeParts(&timers));
  EXPECT_TRUE(gate.Check());
  disk_ = absl::ResourceExhaustedError("full");
  EXPECT_FALSE(gate.Check());
  EXPECT_FALSE(gate.Check());
  EXPECT_FALSE(gate.is_open());
  EXPECT_EQ(probes_, 2);
  for (int i = 0; i < 63; ++i) timers.Advance(absl::Seconds(1));
  // After 1, 3, 7, 15, 31, 61 s.
  EXPECT_EQ(probes_, 8);
  EXPECT_THAT(told_, ElementsAre("full"));
  disk_ = absl::OkStatus();
  timers.Advance(StorageGate::kLongestPause);
  EXPECT_TRUE(gate.is_open());
  EXPECT_THAT(told_, ElementsAre("full", ""));
  timers.Advance(absl::Hours(1));
  EXPECT_EQ(probes_, 9);
}

TEST_F(StorageGateTest, PausesAreNoLongerThanIsSaid) {
  ManualExecutor timers;
  StorageGate::Environment parts = MakeParts(&timers);
  parts.longest_pause = absl::Seconds(2);
  StorageGate gate(std::move(parts));
  disk_ = absl::UnavailableError("away");
  EXPECT_FALSE(gate.Check());
  for (int i = 0; i < 63; ++i) timers.Advance(absl::Seconds(1));
  // After 1, 3, 5, ... 63 s.
  EXPECT_EQ(probes_, 1 + 32);
}

/// Has no memory for timers when the test says so.
class PoorTimers : public ManualExecutor {
 public:
  Timer PostAfter(absl::Duration delay, std::function<void()> task) override {
    if (is_poor) throw std::bad_alloc();
    return ManualExecutor::PostAfter(delay, std::move(task));
  }

  bool is_poor = true;
};

TEST_F(StorageGateTest, WhereverMemoryEndsItIsTriedAgain) {
  PoorTimers timers;
  StorageGate gate(MakeParts(&timers));
  disk_ = absl::ResourceExhaustedError("full");
  EXPECT_THROW((void)gate.Check(), std::bad_alloc);
  EXPECT_TRUE(gate.is_open());
  timers.is_poor = false;
  EXPECT_FALSE(gate.Check());
  StorageGate::Environment losing = MakeParts(&timers);
  losing.on_disk = [this, lost = 0](auto&& work) mutable {
    if (++lost > 1) work();
  };
  StorageGate gate_that_loses(losing);
  EXPECT_FALSE(gate_that_loses.Check());
  disk_ = absl::OkStatus();
  timers.Advance(StorageGate::kFirstProbe);
  EXPECT_FALSE(gate_that_loses.is_open());
  timers.Advance(2 * StorageGate::kFirstProbe);
  EXPECT_TRUE(gate_that_loses.is_open());
}

}  // namespace
}  // namespace isomatch
