#include "client/sample/animal_body.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>

namespace isomatch {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

// Radius of the fillets between chains.
constexpr double kBlend = 0.02;
// Width of the zone in which two chains share a point's motion.
constexpr double kSkinBlend = 0.03;
// Width over which neighboring segments of a chain share a point.
constexpr double kSegmentBlend = 0.01;
// exp of less than this is nothing beside 1.
constexpr double kNegligible = -30;

enum ChainId : int {
  kTrunk,
  kHead,
  kLeftEar,
  kRightEar,
  kTail,
  kFrontLeft,
  kFrontRight,
  kHindLeft,
  kHindRight,
};

// A point of the center line from which a chain's nodes are interpolated.
struct Knot {
  double x, y, z, radius;
};

Eigen::Vector4d AsVector(const Knot& knot) {
  return {knot.x, knot.y, knot.z, knot.radius};
}

// Catmull-Rom through the knots.
AnimalChain MakeChain(int parent, const std::vector<Knot>& knots) {
  constexpr int kNodesPerSpan = 4;
  AnimalChain chain;
  chain.parent = parent;
  const auto knot = [&](int i) {
    return AsVector(knots[static_cast<std::size_t>(
        std::clamp(i, 0, static_cast<int>(knots.size()) - 1))]);
  };
  const int spans = static_cast<int>(knots.size()) - 1;
  for (int node = 0; node <= spans * kNodesPerSpan; ++node) {
    const int i = std::min(node / kNodesPerSpan, spans - 1);
    const double t = static_cast<double>(node) / kNodesPerSpan - i;
    const Eigen::Vector4d in = (knot(i + 1) - knot(i - 1)) / 2;
    const Eigen::Vector4d out = (knot(i + 2) - knot(i)) / 2;
    const Eigen::Vector4d chord = knot(i + 1) - knot(i);
    const Eigen::Vector4d at =
        knot(i) +
        t * (in + t * (3 * chord - 2 * in - out + t * (in + out - 2 * chord)));
    chain.nodes.emplace_back(at.head<3>());
    chain.radii.push_back(at[3]);
  }
  return chain;
}

// In the order of ChainId: parents first.
std::vector<AnimalChain> MakeChains() {
  return {
      MakeChain(-1, {{-.47, 0, .02, .14},
                     {-.15, 0, .05, .16},
                     {.15, .01, .03, .17},
                     {.40, 0, .06, .14}}),
      MakeChain(kTrunk, {{.38, 0, .08, .12},
                         {.56, 0, .28, .085},
                         {.68, 0, .45, .09},
                         {.84, 0, .43, .07},
                         {1.0, 0, .37, .045}}),
      MakeChain(kHead, {{.68, .04, .47, .04},
                        {.64, .14, .60, .035},
                        {.58, .24, .74, .045},
                        {.54, .30, .84, .022}}),
      MakeChain(kHead, {{.68, -.04, .47, .04},
                        {.67, -.11, .57, .03},
                        {.66, -.15, .64, .024}}),
      MakeChain(kTrunk, {{-.45, 0, .06, .06},
                         {-.68, 0, .16, .045},
                         {-.92, .02, .14, .04},
                         {-1.15, .06, .06, .045},
                         {-1.30, .08, .02, .03}}),
      MakeChain(kTrunk, {{.33, .10, .00, .10},
                         {.35, .15, -.22, .068},
                         {.33, .155, -.42, .052},
                         {.34, .155, -.60, .055},
                         {.43, .16, -.63, .05}}),
      MakeChain(kTrunk, {{.33, -.10, .00, .09},
                         {.35, -.15, -.22, .055},
                         {.33, -.155, -.45, .042},
                         {.33, -.155, -.70, .045},
                         {.40, -.16, -.73, .04}}),
      MakeChain(kTrunk, {{-.38, .10, .02, .12},
                         {-.38, .15, -.20, .08},
                         {-.44, .155, -.42, .05},
                         {-.42, .155, -.66, .05},
                         {-.32, .16, -.70, .042}}),
      MakeChain(kTrunk, {{-.38, -.10, .02, .11},
                         {-.38, -.15, -.20, .07},
                         {-.43, -.155, -.38, .055},
                         {-.42, -.155, -.54, .06},
                         {-.34, -.16, -.57, .055}}),
  };
}

// Where a point stands beside one segment of a chain.
struct Beside {
  double distance;  // to the tube, negative inside
  double t;         // 0 to 1 along the segment
};

Beside BesideSegment(const AnimalChain& chain, std::size_t i,
                     const Vector3d& point) {
  const Vector3d along = chain.nodes[i + 1] - chain.nodes[i];
  const Vector3d from = point - chain.nodes[i];
  const double t = std::clamp(from.dot(along) / along.squaredNorm(), 0.0, 1.0);
  const double radius =
      chain.radii[i] + t * (chain.radii[i + 1] - chain.radii[i]);
  return {(from - t * along).norm() - radius, t};
}

// The nearest segment of a chain.
struct NearestSegment {
  std::size_t index;
  Beside beside;
};

NearestSegment Nearest(const AnimalChain& chain, const Vector3d& point) {
  NearestSegment nearest{0, {std::numeric_limits<double>::infinity(), 0}};
  for (std::size_t i = 0; i + 1 < chain.nodes.size(); ++i) {
    const Beside beside = BesideSegment(chain, i, point);
    if (beside.distance < nearest.beside.distance) nearest = {i, beside};
  }
  return nearest;
}

Vector3d CenterAt(const AnimalChain& chain, const NearestSegment& nearest) {
  const Vector3d& start = chain.nodes[nearest.index];
  return start + nearest.beside.t * (chain.nodes[nearest.index + 1] - start);
}

// Position along a chain in segments, smooth in `point`: the mean over the
// segments that are about as near as the nearest.
double SmoothPosition(const AnimalChain& chain, const Vector3d& point) {
  const double nearest = Nearest(chain, point).beside.distance;
  double weights = 0;
  double sum = 0;
  for (std::size_t i = 0; i + 1 < chain.nodes.size(); ++i) {
    const Beside beside = BesideSegment(chain, i, point);
    const double exponent = (nearest - beside.distance) / kSegmentBlend;
    if (exponent < kNegligible) continue;
    const double weight = std::exp(exponent);
    weights += weight;
    sum += weight * (static_cast<double>(i) + beside.t);
  }
  return sum / weights;
}

// A bend spread evenly over part of a chain: `degrees` about `axis` (in the
// frame at rest) between the fractions `from` and `to` of its segments.
struct Bend {
  ChainId chain;
  Vector3d axis;
  double degrees;
  double from;
  double to;
};

// Turning about y moves what hangs down backwards, what points forwards down.
std::vector<Bend> BendsOf(char pose) {
  const Vector3d x = Vector3d::UnitX();
  const Vector3d y = Vector3d::UnitY();
  const Vector3d z = Vector3d::UnitZ();
  switch (pose) {
    case 'B':  // walking, head low, tail to the right
      return {
          {kTrunk, z, 8, .1, .9},        {kHead, y, 45, .1, .75},
          {kTail, z, 60, .2, .9},        {kLeftEar, x, 25, .3, .9},
          {kFrontLeft, y, -38, .2, .65}, {kFrontLeft, y, 20, .5, .85},
          {kFrontRight, y, 32, .2, .65}, {kFrontRight, y, 20, .5, .85},
          {kHindLeft, y, 34, .25, .65},  {kHindLeft, y, 15, .5, .85},
          {kHindRight, y, -36, .25, .7}, {kRightEar, y, -20, .3, .9},
      };
    case 'C':  // looking back over its left shoulder, one paw lifted, tail up
      return {
          {kTrunk, z, -8, .1, .9},       {kHead, z, 50, .1, .7},
          {kHead, y, -15, .1, .6},       {kTail, y, 75, .15, .9},
          {kFrontLeft, y, -50, .2, .6},  {kFrontLeft, y, 60, .4, .85},
          {kHindLeft, y, -25, .25, .65}, {kHindRight, y, 28, .25, .7},
          {kFrontRight, x, -10, .2, .6}, {kLeftEar, y, -35, .3, .9},
      };
    default:  // A: as it stands
      return {};
  }
}

// The rotation that all bends of a chain add up to at `fraction` of it.
Quaterniond RotationAt(ChainId chain, double fraction, char pose) {
  constexpr double kRadians = std::numbers::pi / 180;
  Quaterniond rotation = Quaterniond::Identity();
  for (const Bend& bend : BendsOf(pose)) {
    if (bend.chain != chain) continue;
    const double part =
        std::clamp((fraction - bend.from) / (bend.to - bend.from), 0.0, 1.0);
    rotation =
        rotation * Eigen::AngleAxisd(part * bend.degrees * kRadians, bend.axis);
  }
  return rotation;
}

}  // namespace

AnimalBody::AnimalBody() : chains_(MakeChains()) {}

AnimalBody::Field AnimalBody::At(const Vector3d& point) const {
  // value = -blend log sum exp(-distance / blend), stabilised by the nearest.
  constexpr std::size_t kChains = kHindRight + 1;
  std::array<NearestSegment, kChains> nearest;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t c = 0; c < kChains; ++c) {
    nearest[c] = Nearest(chains_[c], point);
    least = std::min(least, nearest[c].beside.distance);
  }
  double weights = 0;
  Vector3d gradient = Vector3d::Zero();
  for (std::size_t c = 0; c < kChains; ++c) {
    const double exponent = (least - nearest[c].beside.distance) / kBlend;
    if (exponent < kNegligible) continue;
    const double weight = std::exp(exponent);
    weights += weight;
    gradient +=
        weight * (point - CenterAt(chains_[c], nearest[c])).normalized();
  }
  return {least - kBlend * std::log(weights), gradient / weights};
}

Vector3d AnimalBody::Project(Vector3d point, int steps) const {
  for (int step = 0; step < steps; ++step) {
    const Field field = At(point);
    // Where fillets meet the gradient can vanish; a bounded step is enough.
    constexpr double kLeastSquaredGradient = 0.1;
    point -= field.value * field.gradient /
             std::max(field.gradient.squaredNorm(), kLeastSquaredGradient);
  }
  return point;
}

Eigen::AlignedBox3d AnimalBody::Bounds() const {
  Eigen::AlignedBox3d box;
  for (const AnimalChain& chain : chains_) {
    for (std::size_t i = 0; i < chain.nodes.size(); ++i) {
      const Vector3d room = Vector3d::Constant(chain.radii[i] + 4 * kBlend);
      box.extend(chain.nodes[i] - room);
      box.extend(chain.nodes[i] + room);
    }
  }
  return box;
}

AnimalPose::AnimalPose(const AnimalBody& body, char pose) : body_(body) {
  for (std::size_t c = 0; c < body.chains().size(); ++c) PoseChain(c, pose);
}

void AnimalPose::PoseChain(std::size_t c, char pose) {
  const AnimalChain& chain = body_.chains()[c];
  Frame root{chain.nodes[0], Quaterniond::Identity()};
  if (chain.parent >= 0) {
    // The first node moves with the parent, which it lies inside of.
    const auto parent = static_cast<std::size_t>(chain.parent);
    const NearestSegment seat = Nearest(body_.chains()[parent], chain.nodes[0]);
    root.origin = MoveWithChain(parent, chain.nodes[0]);
    root.rotation = frames_[parent][seat.index].rotation.slerp(
        seat.beside.t, frames_[parent][seat.index + 1].rotation);
  }
  std::vector<Frame> frames = {root};
  const auto segments = static_cast<double>(chain.nodes.size() - 1);
  for (std::size_t i = 0; i + 1 < chain.nodes.size(); ++i) {
    const auto rotation = [&](double node) {
      return root.rotation *
             RotationAt(static_cast<ChainId>(c), node / segments, pose);
    };
    const auto node = static_cast<double>(i);
    const Vector3d step =
        rotation(node + .5) * (chain.nodes[i + 1] - chain.nodes[i]);
    frames.push_back({frames[i].origin + step, rotation(node + 1)});
  }
  frames_.push_back(std::move(frames));
}

Vector3d AnimalPose::MoveWithChain(std::size_t c, const Vector3d& rest) const {
  const AnimalChain& chain = body_.chains()[c];
  const double position = SmoothPosition(chain, rest);
  const std::size_t i =
      std::min(static_cast<std::size_t>(position), chain.nodes.size() - 2);
  const double t = position - static_cast<double>(i);
  const Frame& start = frames_[c][i];
  const Frame& end = frames_[c][i + 1];
  const Vector3d center =
      chain.nodes[i] + t * (chain.nodes[i + 1] - chain.nodes[i]);
  return start.origin + t * (end.origin - start.origin) +
         start.rotation.slerp(t, end.rotation) * (rest - center);
}

Vector3d AnimalPose::operator()(const Vector3d& rest) const {
  const std::vector<AnimalChain>& chains = body_.chains();
  std::vector<double> distance(chains.size());
  for (std::size_t c = 0; c < chains.size(); ++c) {
    distance[c] = Nearest(chains[c], rest).beside.distance;
  }
  const double least = *std::min_element(distance.begin(), distance.end());
  double weights = 0;
  Vector3d sum = Vector3d::Zero();
  for (std::size_t c = 0; c < chains.size(); ++c) {
    const double exponent = (least - distance[c]) / kSkinBlend;
    if (exponent < kNegligible) continue;
    const double weight = std::exp(exponent);
    weights += weight;
    sum += weight * MoveWithChain(c, rest);
  }
  return sum / weights;
}

}  // namespace isomatch
