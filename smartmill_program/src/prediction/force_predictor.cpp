#include "smartmill_program/prediction/force_predictor.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

constexpr double ANGLE_STEP = 1.5;       // [deg] of the spindle: a smooth peak within 0.01 %
constexpr double SAME_ANGLE = 2e-4;      // [rad] resolution of a contact
constexpr double SAME_LENGTH = 1e-7;     // [m] a tenth of the last digit of a program
constexpr double SAME_SLOPE = 1e-4;      // [1]
constexpr double INSIDE = 1e-9;          // [rad] of an arc, despite rounding
constexpr double REFERENCE_FEED = 1e-4;  // [m] any: the force is affine in the feed per tooth

double largestPitchShare(const ToolGeometry& tool) {
  if (tool.pitch.empty()) return 1.0;
  return *std::max_element(tool.pitch.begin(), tool.pitch.end()) * tool.teeth / units::TWO_PI;
}

/// Largest sin(phi) sin(kappa) in a contact.
double largestChipShare(const Contact& contact) {
  double share = 0.0;
  for (const EngagedArc& arc : contact.arcs) {
    const bool crosses = arc.entry <= 0.5 * units::PI && arc.exit >= 0.5 * units::PI;
    const double sine = crosses ? 1.0 : std::max(std::sin(arc.entry), std::sin(arc.exit));
    share = std::max(share, sine * arc.chip_share);
  }
  return share;
}

}  // namespace

double largestChip(const ToolGeometry& tool, const Contact& contact, double feed_per_tooth) {
  return feed_per_tooth * largestPitchShare(tool) * largestChipShare(contact);
}

bool sameContact(const Contact& a, const Contact& b) {
  if (a.arcs.size() != b.arcs.size() || std::abs(a.slope - b.slope) > SAME_SLOPE) return false;
  for (std::size_t i = 0; i < a.arcs.size(); ++i) {
    const EngagedArc &of_a = a.arcs[i], &of_b = b.arcs[i];
    if (std::abs(of_a.entry - of_b.entry) > SAME_ANGLE || std::abs(of_a.exit - of_b.exit) > SAME_ANGLE ||
        std::abs(of_a.bottom - of_b.bottom) > SAME_LENGTH || std::abs(of_a.top - of_b.top) > SAME_LENGTH)
      return false;
  }
  return true;
}

bool ForcePredictor::isLast(const Contact& contact, double feed_per_tooth) const {
  return std::abs(feed_per_tooth - feed_per_tooth_) <= ALIKE_FEED * feed_per_tooth &&
         sameContact(contact, contact_);
}

std::vector<CuttingForce> ForcePredictor::series(const Contact& contact, double feed_per_tooth, double range,
                                                 std::size_t count) const {
  const std::vector<MechanisticForce> cuts = cutsOf(contact, feed_per_tooth);
  std::vector<CuttingForce> forces(count);
  for (std::size_t k = 0; k < count; ++k)
    for (const MechanisticForce& cut : cuts)
      forces[k].add(cut.at(range * static_cast<double>(k) / static_cast<double>(count)));
  return forces;
}

std::vector<MechanisticForce> ForcePredictor::cutsOf(const Contact& contact, double feed_per_tooth) const {
  std::vector<MechanisticForce> cuts;
  for (const EngagedArc& arc : contact.arcs)
    cuts.emplace_back(
        tool_, coefficients_,
        Engagement{arc.entry, arc.exit, arc.top, feed_per_tooth, {}, -contact.slope * feed_per_tooth},
        arc.bottom);
  return cuts;
}

// With even pitch the force repeats with every tooth. It is smooth in between, and has its kinks and jumps
// where the ends of an edge enter and leave an arc.
std::vector<double> ForcePredictor::angles(const Contact& contact) const {
  const double range = tool_.pitch.empty() ? units::TWO_PI / tool_.teeth : units::TWO_PI;
  const int count = static_cast<int>(std::ceil(units::degFromRad(range) / ANGLE_STEP));
  std::vector<double> angles;
  for (int k = 0; k < count; ++k) angles.push_back(range * (k + 0.5) / count);
  for (const EngagedArc& arc : contact.arcs) {
    const double low = tool_.lag() * arc.bottom, high = tool_.lag() * arc.top;
    for (int tooth = 0; tooth < (tool_.pitch.empty() ? 1 : tool_.teeth); ++tooth)
      for (const double tip :
           {arc.entry + low + INSIDE, arc.exit + low - INSIDE, arc.entry + high, arc.exit + high})
        angles.push_back(std::fmod(tip - tool_.toothAngle(tooth) + units::TWO_PI, range));
  }
  return angles;
}

const ForcePrediction& ForcePredictor::predict(const Contact& contact, double feed_per_tooth) {
  if (isLast(contact, feed_per_tooth)) return prediction_;
  contact_ = contact;
  feed_per_tooth_ = feed_per_tooth;
  prediction_ = {};
  const std::vector<MechanisticForce> cuts = cutsOf(contact, feed_per_tooth);
  for (const MechanisticForce& cut : cuts) prediction_.mean.add(cut.mean());
  for (const double angle : angles(contact)) {
    CuttingForce sum;
    for (const MechanisticForce& cut : cuts) sum.add(cut.at(angle));
    prediction_.peak_force = std::max(prediction_.peak_force, std::hypot(sum.fx, sum.fy));
    prediction_.peak_torque = std::max(prediction_.peak_torque, sum.torque);
  }
  return prediction_;
}

std::vector<ForceOverFeed> ForcePredictor::overFeed(const Contact& contact, ForceOverFeed* mean) const {
  const std::vector<MechanisticForce> once = cutsOf(contact, REFERENCE_FEED),
                                      twice = cutsOf(contact, 2.0 * REFERENCE_FEED);
  const auto add = [](const CuttingForce& one, const CuttingForce& two, ForceOverFeed& sum) {
    sum.edges.add(one, 2.0);
    sum.edges.add(two, -1.0);
    sum.chip.add(two, 1.0 / REFERENCE_FEED);
    sum.chip.add(one, -1.0 / REFERENCE_FEED);
  };
  std::vector<ForceOverFeed> forces;
  for (const double angle : angles(contact)) {
    forces.emplace_back();
    for (std::size_t i = 0; i < once.size(); ++i) add(once[i].at(angle), twice[i].at(angle), forces.back());
  }
  *mean = {};
  for (std::size_t i = 0; i < once.size(); ++i) add(once[i].mean(), twice[i].mean(), *mean);
  return forces;
}

}  // namespace smartmill::program
