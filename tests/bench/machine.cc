#include "tests/bench/machine.h"

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "core/base/parallel.h"

namespace isomatch::bench {
namespace {

constexpr std::int64_t kBlocks = 64;

double Seconds(const timeval& time) {
  return double(time.tv_sec) + 1e-6 * double(time.tv_usec);
}

}  // namespace

double WallSeconds() {
  return std::chrono::duration<double>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

double CpuSeconds() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  return Seconds(usage.ru_utime) + Seconds(usage.ru_stime);
}

double MedianOf(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

double BestSeconds(const std::function<void()>& body) {
  constexpr int kTries = 3;
  double best = INFINITY;
  for (int i = 0; i < kTries; ++i) {
    const double begin = WallSeconds();
    body();
    best = std::min(best, WallSeconds() - begin);
  }
  return best;
}

MachineLimits MeasureMachine() {
  MachineLimits limits;
  {
    const std::vector<float> array(std::size_t{64} << 20, 1);
    std::vector<double> sums(kBlocks);
    const std::int64_t block =
        static_cast<std::int64_t>(array.size()) / kBlocks;
    const double seconds = BestSeconds([&] {
      ParallelFor(kBlocks, {}, [&](std::int64_t b) {
        sums[b] =
            Eigen::Map<const Eigen::ArrayXf>(array.data() + b * block, block)
                .sum();
      }).IgnoreError();
    });
    limits.read_gb_per_s =
        1e-9 * sizeof(float) * double(array.size()) / seconds;
  }
  constexpr Eigen::Index kSize = 512;
  const Eigen::MatrixXf a = Eigen::MatrixXf::Random(kSize, kSize);
  std::vector<Eigen::MatrixXf> products(kBlocks);
  const double seconds = BestSeconds([&] {
    ParallelFor(kBlocks, {}, [&](std::int64_t b) {
      products[b].noalias() = a * a;
    }).IgnoreError();
  });
  limits.gflop_per_s =
      1e-9 * 2 * std::pow(double(kSize), 3) * kBlocks / seconds;
  return limits;
}

}  // namespace isomatch::bench
