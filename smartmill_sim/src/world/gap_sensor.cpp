#include "smartmill_sim/world/gap_sensor.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

constexpr double TOUCHING = 0.5e-6;  // [m] least gap for which a voltage is computed

}  // namespace

ToolSurface::ToolSurface(const StationTraits& traits, const ToolGeometry& tool, double depth)
    : tool_(tool),
      depth_(depth),
      rake_(traits.rake_flank),
      relief_(traits.relief_flank),
      land_(traits.land),
      insert_(traits.tooth == "insert"),
      tooth_distance_(traits.tooth_low),
      eccentricity_(traits.eccentricity),
      eccentricity_angle_(traits.eccentricity_angle) {
  tooth_distance_.resize(static_cast<std::size_t>(tool.teeth), 0.0);
}

/// Recess [m] of the surface at a tooth that is `off` [rad] ahead of the direction; off > 0: on its relief
/// flank.
double ToolSurface::recess(double off) const {
  const double past = off > 0.0 ? std::max(0.0, off - land_) : off;
  const double width = past > 0.0 ? relief_ : rake_;
  if (insert_ && past > 0.0) return std::min(depth_, depth_ * past / width);
  return -depth_ * std::expm1(-past * past / (width * width));
}

double ToolSurface::retreat(double angle, double height, double facing) const {
  double least = std::numeric_limits<double>::infinity();
  for (int tooth = 0; tooth < tool_.teeth; ++tooth) {
    const double off =
        std::remainder(angle + tool_.toothAngle(tooth) - tool_.lag() * height - facing, units::TWO_PI);
    least = std::min(least, tooth_distance_[static_cast<std::size_t>(tooth)] + recess(off));
  }
  return std::min(least, depth_);
}

double ToolSurface::eccentricityTowards(double angle, double facing) const {
  return eccentricity_ * std::cos(angle + eccentricity_angle_ - facing);
}

GapSensor::GapSensor(const StationTraits& traits, const smartmill::HammerStation& station, double facing)
    : facing_(facing),
      gain_(station.gain_volt * (1.0 + traits.gain_error)),
      gap_(station.gap_at_zero_volt),
      range_(station.range_volt),
      nonlinearity_(traits.bend) {
  const double radius = 0.5 * traits.electrode;
  if (radius <= 0.0) {
    spots_.push_back({0.0, 0.0, 1.0});
  } else {
    double sum = 0.0;
    // Uniform in the angle about the disc's centre: accurate at the ends of the chord.
    for (int i = 0; i < traits.electrode_across; ++i) {
      const double turn = units::PI * (i + 0.5) / traits.electrode_across, chord = radius * std::sin(turn);
      const double share = chord * chord;
      for (int k = 0; k < traits.electrode_along; ++k) {
        spots_.push_back(
            {-radius * std::cos(turn), chord * ((k + 0.5) / traits.electrode_along * 2.0 - 1.0), share});
        sum += share;
      }
    }
    for (Spot& s : spots_) s.share /= sum;
  }
  const double step = 0.5 * traits.housing / traits.housing_spots;
  for (int i = -traits.housing_spots; i <= traits.housing_spots && step > 0.0; ++i) {
    for (int k = -traits.housing_spots; k <= traits.housing_spots; ++k)
      if (i * i + k * k <= traits.housing_spots * traits.housing_spots)
        spots_.push_back({step * i, step * k, 0.0});
  }
  surface_distance_.assign(spots_.size(), 0.0);
}

void GapSensor::setTarget(const ToolSurface& surface, double angle, double above, double lateral) {
  const double radius = surface.radius(), towards = surface.eccentricityTowards(angle, facing_);
  for (std::size_t i = 0; i < spots_.size(); ++i) {
    const double across = (spots_[i].lateral + lateral) / radius;
    const bool below = spots_[i].share == 0.0 && above + spots_[i].height < 0.0;  // below the tool tip
    if (std::abs(across) >= 1.0 || below) {                                       // next to the tool
      surface_distance_[i] = radius;
      continue;
    }
    const double turn = std::asin(across);
    const double retreat = surface.retreat(angle, above + spots_[i].height, facing_ + turn);
    surface_distance_[i] = radius - (radius - retreat) * std::cos(turn) - towards;
  }
}

double GapSensor::voltage(double gap) const {
  double capacity = 0.0;  // [1/m] over that of a flat target at 1 m
  for (std::size_t i = 0; i < spots_.size(); ++i) {
    if (spots_[i].share > 0.0) capacity += spots_[i].share / std::max(gap + surface_distance_[i], TOUCHING);
  }
  const double straight = gain_ * (gap_ * capacity - 1.0);
  return clipped(straight + nonlinearity_ * straight * straight / range_);
}

double GapSensor::clearance(double gap) const {
  return gap + *std::min_element(surface_distance_.begin(), surface_distance_.end());
}

double GapSensor::clipped(double voltage) const {
  return std::clamp(voltage, -range_, range_);
}

void GapMean::setTarget(const ToolSurface& surface, double angle, double above, double lateral) {
  sensor_.setTarget(surface, angle, above, lateral);
  gap_ = -1.0;
}

double GapMean::add(double gap) {
  if (gap != gap_) {
    gap_ = gap;
    clearance_ = sensor_.clearance(gap);
    volt_ = clearance_ > 0.0 ? sensor_.voltage(gap) : contact_volt_;
  }
  sum_ += volt_;
  return clearance_;
}

}  // namespace smartmill::sim
