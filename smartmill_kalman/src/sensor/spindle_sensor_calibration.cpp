#include "smartmill_kalman/sensor/spindle_sensor_calibration.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

ModalModel ideal() {
  ModalModel model;
  model.direct = 1.0;
  return model;
}

}  // namespace

SpindleSensorCalibration::SpindleSensorCalibration()
    : dynamic_yx(ideal()), dynamic_yz(ideal()), dynamic_xz(ideal()) {
}

SpindleSensorCalibration SpindleSensorCalibration::table3() {
  SpindleSensorCalibration table;
  const auto line = [](double slope_per_mm, double offset) {
    LengthDependence l;
    l.slope = slope_per_mm / units::MM;
    l.offset = offset;
    return l;
  };
  table.x = line(-0.059, 26.203);
  table.y = line(-0.063, 26.718);
  table.z = line(0.0, 62.46);
  table.yx = line(-0.121, 44.545);
  table.yz = line(-0.398, 186.16);
  table.xz = line(1.840, -597.73);
  table.preload = {6050.0, 6040.0, 6050.0, 6045.0, 6035.0, 6034.0};
  table.range_limit = 36e3;
  return table;
}

void SpindleSensorCalibration::validate() const {
  const auto check = [](const std::string& key, const LengthDependence& line) {
    require((key + ".slope").c_str(), line.slope, Range{});
    require((key + ".offset").c_str(), line.offset, Range{});
  };
  check("x", x);
  check("y", y);
  check("z", z);
  if (yx) check("yx", *yx);
  if (yz) check("yz", *yz);
  if (xz) check("xz", *xz);
  for (const double p : preload) require("preload_n", p, Range::positive());
  require("least_compression_n", least_compression, Range::notNegative());
  if (!(range_limit > 0.0)) throw Error("range_limit_n: expected above 0 N");  // may be infinite
  require("low_pass_hz", low_pass, Range::notNegative());
  require("drift_std_n_per_s", drift_std, Range::positive());
}

void SpindleSensorCalibration::checkLength(double length) const {
  if (length >= lengths[0] && length <= lengths[1]) return;
  throw Error(formatted("%.1f mm of tool and holder is outside the calibrated %.1f .. %.1f mm",
                        length / units::MM, lengths[0] / units::MM, lengths[1] / units::MM));
}

double LengthDependence::stdAt(double length) const {
  const double variance =
      slope_std * slope_std * length * length + 2.0 * covariance * length + offset_std * offset_std;
  const double value = at(length);
  return (variance < 0.0 ? 0.0 : std::sqrt(variance)) * (reciprocal ? value * value : 1.0);
}

std::array<double, 3> pairMeans(const std::array<double, 6>& s) {
  return {0.5 * (s[0] - s[1]), -0.5 * (s[2] - s[3]), 0.5 * (s[4] + s[5])};
}

std::array<double, 3> staticForce(const SpindleSensorCalibration& c, double length,
                                  const std::array<double, 3>& means) {
  const double y = means[1] * c.y.at(length);
  const double x = (means[0] - (c.yx ? y / c.yx->at(length) : 0.0)) * c.x.at(length);
  const double z =
      (means[2] - (c.yz ? y / c.yz->at(length) : 0.0) - (c.xz ? x / c.xz->at(length) : 0.0)) * c.z.at(length);
  return {x, y, z};
}

double lateralLimit(const SpindleSensorCalibration& c, double length, std::size_t axis) {
  const double constant = std::abs(axis == 0 ? c.x.at(length) : c.y.at(length));
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 2 * axis; k < 2 * axis + 2; ++k) {
    least = std::min({least, c.preload[k] - c.least_compression, c.range_limit - c.preload[k]});
  }
  return least * constant;
}

}  // namespace smartmill::kalman
