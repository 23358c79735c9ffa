#include "tests/soak/figures.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <random>

#include <gtest/gtest.h>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace isomatch {
namespace {

// What quick runs may take of a target, and which part of their rounds they do.
// AddressSanitizer keeps what was freed and makes everything slower.
#ifdef __SANITIZE_ADDRESS__
constexpr double kQuickSlack = 50;
constexpr int kQuickPart = 10;
#else
constexpr double kQuickSlack = 5;
constexpr int kQuickPart = 1;
#endif

std::string Environment(const char* variable) {
  const char* const value = std::getenv(variable);
  return value == nullptr ? "" : value;
}

void Print(const std::string& name, const std::string& measured,
           const std::string& target) {
  std::cout << "figure: " << name << ": " << measured;
  if (!target.empty()) std::cout << ", target " << target;
  std::cout << std::endl;
  const std::string file = Environment("ISOMATCH_FIGURES");
  if (file.empty()) return;
  std::ofstream(file, std::ios::app)
      << absl::StrCat(name, "|", measured, "|", target, "\n");
}

std::string WithUnit(double value, const std::string& unit) {
  return absl::StrFormat("%.6g %s", value, unit);
}

}  // namespace

bool IsSoak() { return Environment("ISOMATCH_SOAK") == "1"; }

int Rounds(const char* variable, int quick, int soak) {
  int rounds = 0;
  if (absl::SimpleAtoi(Environment(variable), &rounds)) return rounds;
  return IsSoak() ? soak : std::max(1, quick / kQuickPart);
}

std::uint64_t PrintedSeed() {
  std::uint64_t seed = 0;
  if (!absl::SimpleAtoi(Environment("ISOMATCH_SEED"), &seed)) {
    seed = std::random_device()();
  }
  std::cout << "ISOMATCH_SEED=" << seed << std::endl;
  return seed;
}

void ExpectAtMost(const std::string& name, double measured, double target,
                  const std::string& unit) {
  Print(name, WithUnit(measured, unit),
        absl::StrCat("<= ", WithUnit(target, unit)));
  EXPECT_LE(measured, IsSoak() ? target : kQuickSlack * target) << name;
}

void PrintFigure(const std::string& name, double measured,
                 const std::string& unit) {
  Print(name, WithUnit(measured, unit), "");
}

double Latencies::Milliseconds(double fraction) const {
  if (durations_.empty()) return 0;
  std::vector<absl::Duration> sorted = durations_;
  std::sort(sorted.begin(), sorted.end());
  const auto last = static_cast<double>(sorted.size() - 1);
  const auto at = static_cast<size_t>(std::lround(fraction * last));
  return absl::ToDoubleMilliseconds(sorted[at]);
}

}  // namespace isomatch
