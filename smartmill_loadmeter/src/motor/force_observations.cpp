#include "force_observations.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

double DriveUnknowns::predicted(const ForceObservation& row, const Eigen::VectorXd& expected,
                                const Eigen::VectorXd& unknowns) const {
  const double value = expected[row.quantity];
  if (row.drive < 0) return value;
  const auto axis = static_cast<std::size_t>(row.drive);
  const double gain = gain_std[axis] * unknowns[at[axis]];
  if (!row.isLine()) return value * std::exp(gain);
  const double lag = row.lagResponse.slope * lag_std[axis] * unknowns[at[axis] + 1];
  return value * std::pow(row.lagResponse.gain, 2) * std::exp(2.0 * (gain + lag));
}

void ForceObservations::add(const std::string& source, int quantity, const std::optional<Estimate>& e,
                            double share, double size, double zero) {
  if (!e) return;
  if (!(e->std_dev >= 0.0) || !std::isfinite(e->value)) {
    throw Error("force of a cut: measurement of " + source +
                ": expected a finite value and a standard deviation");
  }
  const double all = std::hypot(std::hypot(e->std_dev, share * size), zero);
  if (!(all > 0.0))
    throw Error("force of a cut: measurement of " + source + ": expected a standard deviation > 0");
  rows.push_back({quantity, e->value, all, -1, {}});
  if (sources.empty() || sources.back() != source) sources.push_back(source);
}

void ForceObservations::addLines(int axis, const std::vector<SpectralLine>& lines, const Estimate& bandwidth,
                                 const ForceEstimateParameters& p) {
  const auto i = static_cast<std::size_t>(axis);
  drives.at[i] = CutMechanics::COEFFICIENTS + drives.count;
  drives.count += 2;
  drives.gain_std[i] = std::max(1e-4, p.motor_error);
  drives.lag_std[i] = std::max(1e-4, bandwidth.std_dev / bandwidth.value);
  rows.back().drive = axis;
  for (const SpectralLine& line : lines) {
    if (line.tooth < 1 || line.tooth > TOOTH_HARMONICS) continue;
    const double all = std::hypot(line.power_std, 2.0 * p.model_error * std::max(0.0, line.power));
    if (!(all > 0.0) || !std::isfinite(line.power)) continue;
    rows.push_back({CutMechanics::lineOf(axis, line.tooth), line.power, all, axis,
                    lagResponse(line.frequency, bandwidth.value)});
  }
}

namespace {

double sizeOf(const std::array<std::optional<Estimate>, 3>& force) {
  double size = 0.0;
  for (const auto& f : force) size = std::max(size, f ? std::abs(f->value) : 0.0);
  return size;
}

}  // namespace

ForceObservations observationsOf(const CutMeasurements& r, const ForceEstimateParameters& p) {
  ForceObservations rows;
  const double model = p.model_error, motor = std::hypot(model, p.motor_error),
               sensor = std::hypot(model, p.sensor_error);
  const auto own = [](const std::optional<Estimate>& e) { return e ? std::abs(e->value) : 0.0; };
  rows.add("load_meter", CutMechanics::TORQUE, r.load_torque, model, own(r.load_torque));
  rows.add("motor_spindle", CutMechanics::TORQUE, r.motor_torque, motor, own(r.motor_torque));
  for (int a = 0; a < 3; ++a) {
    const auto i = static_cast<std::size_t>(a);
    const bool varies = r.motor_force[i] && r.bandwidth[i] && !r.motor_lines[i].empty();
    rows.add(std::string("motor_") + "xyz"[i], a, r.motor_force[i], varies ? model : motor,
             own(r.motor_force[i]));
    if (varies) rows.addLines(a, r.motor_lines[i], *r.bandwidth[i], p);
  }
  // Cross-talk adds shares of the largest component to the others.
  for (int a = 0; a < 3; ++a) {
    const auto i = static_cast<std::size_t>(a);
    rows.add("sensor", a, r.sensor_force[i], sensor, sizeOf(r.sensor_force), p.sensor_zero);
    rows.add("sensor", CutMechanics::RMS + a, r.sensor_rms[i], sensor, sizeOf(r.sensor_rms));
  }
  if (rows.rows.empty()) throw Error("force of a cut: no measurement");
  return rows;
}

}  // namespace smartmill::loadmeter
