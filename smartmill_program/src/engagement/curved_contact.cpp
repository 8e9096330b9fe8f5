#include <algorithm>
#include <array>
#include <cmath>

#include "smartmill_core/units.h"
#include "surroundings.h"

namespace smartmill::program {
namespace {

using units::PI;
using units::radFromDeg;
using units::TWO_PI;
using units::UM;

constexpr int SLICES = 12;              // of the engaged height
constexpr int NODES = 16;               // at which the highest contact is searched
constexpr int COARSE = 60, FINE = 120;  // intervals of half a revolution: 3 and 1.5 deg
constexpr int BISECTIONS = 8;           // of an angle: to 0.006 deg
constexpr int HEIGHT_BISECTIONS = 10;
/// [m] Material above the surface by less is the rounding of a curved surface between columns.
constexpr double LEAST_ABOVE = 0.15 * UM;
const double SAME_ANGLE = radFromDeg(0.25);

/// Contact of the circle of a tool at one height.
class Ring {
 public:
  Ring(const Surroundings& around, const ToolProfile& profile, double height)
      : around_(around), height_(height), radius_(profile.radiusAt(height)), slope_(profile.slope(radius_)) {}

  double radius() const { return radius_; }  // [m]
  double slope() const { return slope_; }    // [1]

  /// Whether the surface advances into material. Behind it the tool has cut before.
  bool cuts(double phi) const {
    return around_.share() * std::sin(phi) * slope_ > around_.rise() &&
           around_.above(phi, radius_, height_) > LEAST_ABOVE;
  }

  /// [rad] Angle from which on the surface advances; the same before pi. A rising tool does not at its sides.
  double first() const {
    if (!(around_.rise() > 0.0)) return 0.0;
    return std::asin(std::min(1.0, around_.rise() / (around_.share() * slope_)));
  }

  /// [rad] Where a contact begins or ends between two angles.
  double change(double low, double high, bool cuts_low) const {
    for (int i = 0; i < BISECTIONS; ++i) {
      const double middle = 0.5 * (low + high);
      (cuts(middle) == cuts_low ? low : high) = middle;
    }
    return 0.5 * (low + high);
  }

 private:
  const Surroundings& around_;
  double height_, radius_, slope_;
};

/// Weights of slices in an integral over the engaged height with the values at heights (1 - cos(t)) / 2, t =
/// pi (k + 1/2) / n (first rule of Fejer): the width across the feed begins and ends like a square root.
std::array<double, SLICES> sliceWeights() {
  std::array<double, SLICES> weights{};
  for (int k = 0; k < SLICES; ++k) {
    double sum = 1.0;
    for (int j = 1; j <= SLICES / 2; ++j)
      sum -= 2.0 * std::cos(TWO_PI * j * (k + 0.5) / SLICES) / (4.0 * j * j - 1.0);
    weights[static_cast<std::size_t>(k)] = sum / SLICES;
  }
  return weights;
}

/// A descending tool cuts behind its axis too.
int halves(const Surroundings& around) {
  return around.rise() < 0.0 ? 2 : 1;
}

bool anyContact(const Surroundings& around, const ToolProfile& profile, double height) {
  const Ring ring(around, profile, height);
  for (int k = 0; k < COARSE * halves(around); ++k)
    if (ring.cuts(PI * (k + 0.5) / COARSE)) return true;
  return false;
}

/// [m] Highest contact below `end`; 0: none.
double highestContact(const Surroundings& around, const ToolProfile& profile, double end) {
  const auto node = [&](int k) { return end * (k + 0.5) * (k + 0.5) / (NODES * NODES); };
  int k = NODES - 1;
  while (k >= 0 && !anyContact(around, profile, node(k))) --k;
  if (k < 0) return 0.0;
  double low = node(k), high = k + 1 < NODES ? node(k + 1) : end;
  for (int i = 0; i < HEIGHT_BISECTIONS; ++i) {
    const double middle = 0.5 * (low + high);
    (anyContact(around, profile, middle) ? low : high) = middle;
  }
  return std::min(end, 0.5 * (low + high) + LEAST_ABOVE);
}

/// Calls visit(entry, exit) for the arcs of a ring, in ascending order.
template <class Visit>
void forEachArc(const Ring& ring, int halves, Visit&& visit) {
  const int count = FINE * halves;
  const double begin = ring.first(), end = PI * halves - begin;
  const auto angle = [&](int k) { return begin + (end - begin) * (k + 0.5) / count; };
  bool inside = ring.cuts(angle(0));
  double entry = begin;
  for (int k = 1; k < count; ++k) {
    if (ring.cuts(angle(k)) == inside) continue;
    const double place = ring.change(angle(k - 1), angle(k), inside);
    if (inside) visit(entry, place);
    inside = !inside;
    entry = place;
  }
  if (inside) visit(entry, end);
}

bool sameAngles(const std::vector<EngagedArc>& a, const std::vector<EngagedArc>& b) {
  return a.size() == b.size() &&
         std::equal(a.begin(), a.end(), b.begin(),
                    [](const EngagedArc& one, const EngagedArc& other) { return sameAngles(one, other); });
}

}  // namespace

bool sameAngles(const EngagedArc& a, const EngagedArc& b) {
  return std::abs(a.entry - b.entry) < SAME_ANGLE && std::abs(a.exit - b.exit) < SAME_ANGLE;
}

void addCurvedContact(const Surroundings& around, const ToolProfile& profile, Contact& contact) {
  const double end = std::min(profile.top(), around.stock().block().high[2] - around.tip());
  const double highest = end > 0.0 ? highestContact(around, profile, end) : 0.0;
  std::vector<EngagedArc> joined;  // the lowest of the slices that are joined
  static const std::array<double, SLICES> WEIGHTS = sliceWeights();
  const auto height = [&](double k) { return 0.5 * highest * (1.0 - std::cos(PI * k / SLICES)); };
  for (int k = 0; k < SLICES && highest > 0.0; ++k) {
    const double low = height(k), high = height(k + 1),
                 weight = highest * WEIGHTS[static_cast<std::size_t>(k)];
    const Ring ring(around, profile, height(k + 0.5));
    const double slope = profile.slope(profile.radiusAt(high));
    const double chip_share = std::isinf(slope) ? 1.0 : slope / std::hypot(1.0, slope);
    std::vector<EngagedArc> arcs;
    forEachArc(ring, halves(around), [&](double entry, double exit) {
      const double front = std::min(exit, PI);
      contact.side_area += weight * around.share() * ring.radius() * (std::cos(entry) - std::cos(exit));
      contact.end_area -= weight * around.rise() * ring.radius() * (exit - entry) / ring.slope();
      if (front > entry) arcs.push_back({entry, front, low, high, ring.radius(), chip_share});
    });
    if (!arcs.empty() && sameAngles(arcs, joined)) {
      for (std::size_t i = contact.arcs.size() - arcs.size(); i < contact.arcs.size(); ++i) {
        contact.arcs[i].top = high;
        contact.arcs[i].radius = ring.radius();
        contact.arcs[i].chip_share = chip_share;
      }
    } else {
      contact.arcs.insert(contact.arcs.end(), arcs.begin(), arcs.end());
      joined = arcs;
    }
  }
}

}  // namespace smartmill::program
