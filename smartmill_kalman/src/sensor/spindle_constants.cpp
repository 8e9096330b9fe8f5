#include "smartmill_kalman/sensor/spindle_constants.h"

#include <cmath>
#include <string>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {

using Complex = std::complex<double>;

SpindleConstants::SpindleConstants(const SpindleSensorCalibration& calibration, double length)
    : dynamic_yx_(calibration.dynamic_yx),
      dynamic_yz_(calibration.dynamic_yz),
      dynamic_xz_(calibration.dynamic_xz) {
  calibration.validate();
  try {
    calibration.checkLength(length);
  } catch (const Error& error) {
    throw Error(std::string("spindle_sensor_length: ") + error.what());
  }
  constant_ = {calibration.x.at(length), calibration.y.at(length), calibration.z.at(length)};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!(constant_[axis] > 0.0)) {
      throw Error(std::string("spindle sensor: constant ") + AXIS_NAMES[axis] + " is " +
                  std::to_string(constant_[axis]) + " at a length of " + std::to_string(length / units::MM) +
                  " mm, expected above 0");
    }
  }
  const auto share = [length](const std::optional<LengthDependence>& line) {
    return line ? 1.0 / line->at(length) : 0.0;
  };
  yx_ = share(calibration.yx);
  yz_ = share(calibration.yz);
  xz_ = share(calibration.xz);
}

std::array<Complex, 3> SpindleConstants::forceOf(const std::array<Complex, 3>& means, double f) const {
  const Complex y = means[1] * constant_[1];
  const Complex x = (means[0] - y * yx_ * dynamic_yx_.response(f)) * constant_[0];
  const Complex z =
      (means[2] - y * yz_ * dynamic_yz_.response(f) - x * xz_ * dynamic_xz_.response(f)) * constant_[2];
  return {x, y, z};
}

std::array<double, 3> SpindleConstants::varianceOf(const std::array<double, 6>& variance) const {
  const auto pair = [&](std::size_t axis) { return 0.25 * (variance[2 * axis] + variance[2 * axis + 1]); };
  const std::array<double, 3> own{constant_[0] * constant_[0] * pair(0),
                                  constant_[1] * constant_[1] * pair(1),
                                  constant_[2] * constant_[2] * pair(2)};
  // Including the cross-talk from the axes before.
  return {own[0] + std::pow(constant_[0] * yx_, 2) * own[1], own[1],
          own[2] + std::pow(constant_[2] * yz_, 2) * own[1] + std::pow(constant_[2] * xz_, 2) * own[0]};
}

void SpindleCrossTalk::prepare(double rate, bool gap) {
  if (!filters_.empty() && rate_ == rate && !gap) return;
  filters_.clear();
  for (const ModalModel* model : {&constants_.dynamic_yx_, &constants_.dynamic_yz_, &constants_.dynamic_xz_})
    filters_.emplace_back(*model, rate, Hold::first_order);
  rate_ = rate;
}

std::array<double, 3> SpindleCrossTalk::step(const std::array<double, 6>& sensors) {
  const SpindleConstants& c = constants_;
  const std::array<double, 3> means = pairMeans(sensors);
  const double y = means[1] * c.constant_[1];
  const double x = (means[0] - c.yx_ * filters_[0].step(y)) * c.constant_[0];
  const double z = (means[2] - c.yz_ * filters_[1].step(y) - c.xz_ * filters_[2].step(x)) * c.constant_[2];
  last_ = {x, y, z};
  return last_;
}

void SpindleCrossTalk::skip() {
  filters_[0].step(last_[1]);
  filters_[1].step(last_[1]);
  filters_[2].step(last_[0]);
}

}  // namespace smartmill::kalman
