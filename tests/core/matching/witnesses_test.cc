#include "core/matching/witnesses.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "core/base/random_stream.h"

namespace isomatch {
namespace {

constexpr int kPoints = 100;
constexpr float kWeight = 0.35f;

class WitnessesTest : public testing::Test {
 protected:
  WitnessesTest() {
    for (int i = 0; i < kPoints; ++i) place_costs_.push_back(Unit());
    for (auto& row : distances_) {
      for (int i = 0; i < kPoints; ++i) row.push_back(Unit());
    }
  }

  float Unit() { return static_cast<float>(random_.Unit()); }

  std::vector<Witness> Witnesses(int count) {
    std::vector<Witness> witnesses;
    for (int i = 0; i < count; ++i) {
      witnesses.push_back({i, distances_[i].data(), Unit(), 1 / (0.1f + Unit()),
                           1.0f / static_cast<float>(count)});
    }
    return witnesses;
  }

  /// `count` points, in an order of their own.
  static std::vector<int> Places(int count) {
    std::vector<int> places;
    for (int i = 0; i < count; ++i) places.push_back(i * 37 % kPoints);
    return places;
  }

  /// One place after the other.
  double CostOf(int y, const std::vector<Witness>& witnesses) const {
    double cost = double{kWeight} * place_costs_[y];
    for (const Witness& witness : witnesses) {
      const double off =
          std::abs(double{witness.distances_y[y]} - witness.distance);
      cost += witness.weight *
              std::min(1.0, off * double{witness.inverse_tolerance});
    }
    return cost;
  }

  PlaceFound Cheapest(const std::vector<int>& places,
                      const std::vector<Witness>& witnesses, float most) const {
    return CheapestPlace(places, place_costs_.data(), kWeight, witnesses, most);
  }

  RandomStream random_{5, 0};
  std::vector<float> place_costs_;
  std::vector<float> distances_[20];
};

TEST_F(WitnessesTest, TheCheapestIsThatOfOnePlaceAfterTheOther) {
  int found = 0;
  for (int round = 0; round < 500; ++round) {
    const auto witnesses = Witnesses(1 + round % 20);
    const auto places = Places(round % 30);
    const float most = 0.2f + 0.6f * Unit();
    const PlaceFound cheapest = Cheapest(places, witnesses, most);
    double least = most;
    for (const int y : places) least = std::min(least, CostOf(y, witnesses));
    EXPECT_NEAR(cheapest.cost, least, 1e-5);
    if (cheapest.y < 0) {
      EXPECT_EQ(cheapest.cost, most);
      continue;
    }
    ++found;
    EXPECT_NEAR(CostOf(cheapest.y, witnesses), least, 1e-5);
  }
  EXPECT_GT(found, 100);
  EXPECT_LT(found, 480);
}

TEST_F(WitnessesTest, OfEqualPlacesTheFirstIsFound) {
  const auto witnesses = Witnesses(3);
  std::fill(place_costs_.begin(), place_costs_.end(), 0.0f);
  for (auto& row : distances_) std::fill(row.begin(), row.end(), 0.5f);
  EXPECT_EQ(Cheapest(Places(30), witnesses, 9).y, 0);
  EXPECT_EQ(Cheapest({9, 7, 8}, witnesses, 9).y, 9);
}

}  // namespace
}  // namespace isomatch
