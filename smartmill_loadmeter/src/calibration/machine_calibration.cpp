#include "smartmill_loadmeter/calibration/machine_calibration.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

namespace {

double rounding(double resolution) {
  return resolution / std::sqrt(12.0);
}

}  // namespace

IdleVoltage fitIdleVoltage(const std::vector<AirCut>& air_cuts, double zero_below, double resolution) {
  double s2 = 0.0, s3 = 0.0, s4 = 0.0, y1 = 0.0, y2 = 0.0;
  std::size_t used = 0;
  for (const AirCut& cut : air_cuts) {
    const double w = cut.speed;
    if (w < zero_below) continue;
    ++used;
    s2 += w * w, s3 += w * w * w, s4 += w * w * w * w;
    y1 += w * cut.voltage, y2 += w * w * cut.voltage;
  }
  const double determinant = s4 * s2 - s3 * s3;
  if (used < 2 || !(determinant > 1e-9 * s4 * s2)) {
    throw Error("idle voltage: expected air cuts at two or more speeds, " + std::to_string(used) + " usable");
  }
  IdleVoltage idle;
  idle.kb.value = (s2 * y2 - s3 * y1) / determinant;
  idle.ktcf.value = (s4 * y1 - s3 * y2) / determinant;
  double squares = 0.0;
  for (const AirCut& cut : air_cuts) {
    if (cut.speed >= zero_below) squares += std::pow(cut.voltage - idle.at(cut.speed), 2);
  }
  double variance = rounding(resolution) * rounding(resolution);
  if (used > 2) variance = std::max(variance, squares / static_cast<double>(used - 2));
  idle.kb.std_dev = std::sqrt(variance * s2 / determinant);
  idle.ktcf.std_dev = std::sqrt(variance * s4 / determinant);
  idle.covariance = -variance * s3 / determinant;
  return idle;
}

}  // namespace smartmill::loadmeter
