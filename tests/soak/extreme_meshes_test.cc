// Whether any mesh at all can hang the method, or take more than its estimate.

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <ctime>
#include <iostream>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/random_stream.h"
#include "core/pipeline/matcher.h"
#include "tests/soak/figures.h"
#include "tests/support/extreme_meshes.h"
#include "tests/support/matchers.h"
#include "tests/support/memory_growth.h"

namespace isomatch {
namespace {

/// Processor seconds of this process.
double ProcessorSeconds() {
  timespec now = {};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

/// Ends the process, with the name of what hangs, unless it is destroyed within
/// a minute of processor time.
class Watchdog {
 public:
  explicit Watchdog(const std::string& name)
      : thread_([name, begin = ProcessorSeconds()](std::stop_token stop) {
          constexpr double kSeconds = 60;
          while (!stop.stop_requested()) {
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
            if (ProcessorSeconds() - begin < kSeconds) continue;
            std::cerr << "hangs: " << name << std::endl;
            std::abort();
          }
        }) {}

 private:
  std::jthread thread_;
};

struct ExtremePair {
  ExtremePair(std::uint64_t seed, std::uint64_t number)
      : x(RandomExtremeMesh(seed + 2 * number)),
        y(RandomExtremeMesh(seed + 2 * number + 1)),
        name(absl::StrCat("ISOMATCH_SEED=", seed, " pair ", number, " (",
                          x.description, " to ", y.description, ")")) {}
  ExtremeMesh x;
  ExtremeMesh y;
  std::string name;
};

/// One thread, so that processor time is time.
MatchOptions OneThread() {
  MatchOptions options;
  options.threads = 1;
  options.random_seed = 1;
  return options;
}

TEST(ExtremeMeshesTest, EachIsRefusedOrMatchedInTimeAndWithinItsEstimate) {
  const int pairs = Rounds("ISOMATCH_EXTREME_PAIRS", 60, 10000);
  const std::uint64_t seed = PrintedSeed();
  const MatchOptions options = OneThread();
  double slowest = 0;
  double most = 0;
  int matched = 0;
  for (int i = 0; i < pairs; ++i) {
    const ExtremePair pair(seed, i);
    SCOPED_TRACE(pair.name);
    const Watchdog watchdog(pair.name);
    const MemoryGrowth growth;
    const double begin = ProcessorSeconds();
    const auto found = Match(pair.x.mesh, pair.y.mesh, {}, options);
    slowest = std::max(slowest, ProcessorSeconds() - begin);
    const double estimate = static_cast<double>(EstimateMemoryBytes(
        SizeOf(pair.x.mesh), SizeOf(pair.y.mesh), 0, options));
    most = std::max(most, static_cast<double>(growth.Bytes()) / estimate);
    matched += found.ok();
    if (found.ok()) {
      EXPECT_EQ(found->y_from_x.size(),
                static_cast<std::size_t>(pair.x.mesh.num_vertices()));
    } else {
      // Refused, or a numerical step that says that it failed.
      EXPECT_TRUE(absl::IsInvalidArgument(found.status()) ||
                  absl::IsInternal(found.status()))
          << found.status();
    }
  }
  PrintFigure("extreme meshes: pairs", pairs, "");
  PrintFigure("extreme meshes: pairs that were matched, not refused", matched,
              "");
  ExpectAtMost("extreme meshes: slowest pair, processor time", slowest, 5, "s");
  ExpectAtMost("extreme meshes: memory over estimate, most", most, 1, "");
}

TEST(ExtremeMeshesTest, ACancelIsHeard) {
  const int pairs = Rounds("ISOMATCH_EXTREME_CANCELS", 30, 1000);
  const std::uint64_t seed = PrintedSeed();
  RandomStream random(seed, /*index=*/1);
  const MatchOptions options = OneThread();
  Latencies latencies;
  for (int i = 0; i < pairs; ++i) {
    const ExtremePair pair(seed, i);
    SCOPED_TRACE(pair.name);
    const Watchdog watchdog(pair.name);
    std::stop_source stop;
    std::atomic<bool> has_ended = false;
    std::optional<absl::Time> stopped;
    std::jthread canceller([&, delay = 300 * random.Unit()] {
      std::this_thread::sleep_for(
          std::chrono::duration<double, std::milli>(delay));
      if (has_ended) return;
      stopped = absl::Now();
      stop.request_stop();
    });
    const auto found =
        Match(pair.x.mesh, pair.y.mesh, {}, options, {}, stop.get_token());
    const absl::Time end = absl::Now();
    has_ended = true;
    canceller.join();
    if (absl::IsCancelled(found.status())) latencies.Add(end - *stopped);
  }
  PrintFigure("extreme meshes: cancelled while they ran", latencies.count(),
              "");
  if (latencies.count() == 0) return;
  ExpectAtMost("extreme meshes: from cancel to return, slowest",
               latencies.Milliseconds(1), 500, "ms");
}

/// The shapes on which time grew with the square of their size.
TEST(ExtremeMeshesTest, FacesAroundOneVertexTakeNoTimesTheirSquare) {
  const MatchOptions options = OneThread();
  for (const auto& [name, mesh] :
       {std::pair("fan", Fan(10000)), std::pair("book", Book(10000))}) {
    const Watchdog watchdog(name);
    const double begin = ProcessorSeconds();
    EXPECT_THAT(Match(mesh, mesh, {}, options), IsOk());
    ExpectAtMost(absl::StrCat("a ", name, " of 10,000 faces on itself"),
                 ProcessorSeconds() - begin, 8, "s");
  }
}

}  // namespace
}  // namespace isomatch
