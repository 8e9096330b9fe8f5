#include "smartmill_program/engagement/contact.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using units::PI;
using units::UM;

constexpr int SAMPLES = 180;            // intervals of a degree; an arc narrower than one may be missed
constexpr int BISECTIONS = 7;           // to 0.008 deg
constexpr double LEAST_DEPTH = 1 * UM;  // last digit of a program
/// [m] An arc that is narrower across the feed is rounding: two passes along one wall differ by twice the
/// last digit.
constexpr double LEAST_WIDTH = 2 * UM;
/// Depths within one arc differ by less than the larger of these.
constexpr double SAME_DEPTH = 20 * UM;
constexpr double SAME_DEPTH_SHARE = 0.05;

bool alike(double a, double b) {
  return std::abs(a - b) <= std::max(SAME_DEPTH, SAME_DEPTH_SHARE * std::max(a, b));
}

/// Depth of the material around the tool over the immersion angle.
class Surroundings {
 public:
  Surroundings(const Stock& stock, const std::array<double, 3>& tip, double radius, double feed_angle,
               bool left_hand)
      : stock_(stock), tip_(tip), x_{radius * std::cos(feed_angle), radius * std::sin(feed_angle)} {
    const double side = left_hand ? -1.0 : 1.0;
    y_ = {-side * x_[1], side * x_[0]};
  }

  /// [m] 0: no material
  double depth(double phi) const {
    const double s = std::sin(phi), c = std::cos(phi);
    const double above = stock_.height(tip_[0] + s * x_[0] + c * y_[0], tip_[1] + s * x_[1] + c * y_[1]) -
                         std::max(tip_[2], stock_.block().low[2]);
    return above > LEAST_DEPTH ? above : 0.0;
  }

  /// [rad] Where the depth changes from that at `low` to that at `high`.
  double change(double low, double high, double depth_low, double depth_high) const {
    for (int i = 0; i < BISECTIONS; ++i) {
      const double middle = 0.5 * (low + high), d = depth(middle);
      (std::abs(d - depth_low) < std::abs(d - depth_high) ? low : high) = middle;
    }
    return 0.5 * (low + high);
  }

 private:
  const Stock& stock_;
  std::array<double, 3> tip_;
  std::array<double, 2> x_, y_{};  // [m] radius times the axes of the feed frame
};

}  // namespace

double Contact::axialDepth() const {
  double depth = 0.0;
  for (const ContactArc& arc : arcs) depth = std::max(depth, arc.depth);
  return depth;
}

double Contact::radialDepth(double radius) const {
  double width = 0.0;
  for (const ContactArc& arc : arcs) width += radius * (std::cos(arc.entry) - std::cos(arc.exit));
  return width;
}

double Contact::area(double radius) const {
  double area = 0.0;
  for (const ContactArc& arc : arcs) area += radius * (std::cos(arc.entry) - std::cos(arc.exit)) * arc.depth;
  return area;
}

Contact contactOf(const Stock& stock, const std::array<double, 3>& tip, double radius, double feed_angle,
                  bool left_hand) {
  Contact contact;
  const Surroundings around(stock, tip, radius, feed_angle, left_hand);
  // In the middle of each degree: at 0 and pi exactly, the tool touches the wall that it leaves.
  const auto angle = [](int k) { return PI * (k + 0.5) / SAMPLES; };
  ContactArc arc{0.0, 0.0, 0.0};
  double first = around.depth(angle(0)), before = first,
         sum = first;  // of the arc: first depth and sum, and the last depth
  int count = 1;
  const auto close = [&](double exit) {
    arc.exit = exit;
    arc.depth = sum / count;
    if (first > 0.0 && radius * (std::cos(arc.entry) - std::cos(exit)) > LEAST_WIDTH)
      contact.arcs.push_back(arc);
    arc.entry = exit;
  };
  for (int k = 1; k < SAMPLES; ++k) {
    const double depth = around.depth(angle(k));
    const bool jumps = !alike(depth, before) || (depth > 0.0) != (before > 0.0);
    if (jumps || !alike(depth, first)) {
      close(jumps ? around.change(angle(k - 1), angle(k), before, depth) : 0.5 * (angle(k - 1) + angle(k)));
      first = depth;
      sum = 0.0;
      count = 0;
    }
    before = depth;
    sum += depth;
    ++count;
  }
  close(PI);
  return contact;
}

}  // namespace smartmill::program
