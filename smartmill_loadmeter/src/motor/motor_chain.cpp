#include "smartmill_loadmeter/motor/motor_chain.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

const std::string TRIGGER = "trigger";
const std::array<const char*, 4> CHANNELS{"x", "y", "z", "spindle"};
const char* const AT_REST = "the axis is at rest";
const char* const NOT_MEASURED = "its motor current is not measured";

}  // namespace

bool MotorParameters::any() const {
  return phase_per_revolution > 0.0 ||
         std::any_of(phase_per_metre.begin(), phase_per_metre.end(), [](double p) { return p > 0.0; });
}

void MotorParameters::validate() const {
  MotorParameters copy = *this;
  ParameterTable table;
  table.part("motor_", copy);
  table.check();
}

void MotorRecord::clear() {
  *this = MotorRecord();
}

bool isServoRecord(const SampleBlock& block) {
  return std::find(block.channels.begin(), block.channels.end(), TRIGGER) != block.channels.end();
}

void MotorRecord::add(const SampleBlock& block) {
  const bool servo = isServoRecord(block);
  if (servo && (block.size() == 0 || !(block.at(0, block.channel(TRIGGER)) > 0.5))) return;
  std::size_t longest = 0;
  for (const auto& s : samples_) longest = std::max(longest, s.size());
  if (rate_ > 0.0 && (block.first_index != next_ || block.sample_rate != rate_)) {
    // Kept if it is long enough for slow phases.
    if (static_cast<double>(longest) > 1.0 * rate_) return;
    clear();
    longest = 0;
  }
  if (longest + block.size() > LONGEST) return;
  if (rate_ == 0.0) {
    rate_ = block.sample_rate;
    start_ = block.stamp;
    signed_ = servo;
  }
  next_ = block.first_index + block.size();
  for (std::size_t c = 0; c < CHANNELS.size(); ++c) {
    const auto found = std::find(block.channels.begin(), block.channels.end(),
                                 (servo ? "current_" : "") + std::string(CHANNELS[c]));
    if (found == block.channels.end()) continue;
    const std::size_t at = static_cast<std::size_t>(found - block.channels.begin());
    for (std::size_t i = 0; i < block.size(); ++i) samples_[c].push_back(block.at(i, at));
  }
}

void MotorRecord::dropAfter(double stamp) {
  if (rate_ == 0.0) return;
  const double count = std::max(0.0, std::floor((stamp - start_) * rate_) + 1.0);
  for (auto& s : samples_) {
    if (static_cast<double>(s.size()) > count) s.resize(static_cast<std::size_t>(count));
  }
}

MotorRecord MotorRecord::last(double duration) const {
  MotorRecord part;
  part.rate_ = rate_;
  part.start_ = start_;
  part.next_ = next_;
  part.signed_ = signed_;
  const auto count = static_cast<std::size_t>(duration * rate_);
  for (std::size_t c = 0; c < samples_.size(); ++c) {
    const std::vector<double>& all = samples_[c];
    part.samples_[c].assign(all.end() - static_cast<std::ptrdiff_t>(std::min(count, all.size())), all.end());
  }
  return part;
}

namespace {

/// Mean of a signed current; standard deviation from segments longer than its variation.
Estimate meanOf(const std::vector<double>& samples) {
  constexpr std::size_t PIECES = 8;
  const std::size_t length = samples.size() / PIECES;
  if (length < 2) throw Error("record of " + std::to_string(samples.size()) + " samples is too short");
  std::vector<double> pieces;
  for (std::size_t k = 0; k < PIECES; ++k) {
    const auto from = samples.begin() + static_cast<std::ptrdiff_t>(k * length);
    pieces.push_back(mean(std::vector<double>(from, from + static_cast<std::ptrdiff_t>(length))));
  }
  const double middle = mean(pieces);
  double squares = 0.0;
  for (const double piece : pieces) squares += (piece - middle) * (piece - middle);
  return {middle, std::sqrt(squares / static_cast<double>(PIECES * (PIECES - 1)))};
}

}  // namespace

MotorMeasurement measureMotors(const MotorRecord& record, const MotorParameters& parameters,
                               const std::array<double, 3>& velocity, double spindle_speed, bool is_short,
                               int teeth) {
  MotorMeasurement measurement;
  measurement.velocity = velocity;
  measurement.spindle_speed = spindle_speed;
  measurement.is_signed = record.isSigned();
  for (std::size_t c = 0; c < CHANNELS.size(); ++c) {
    const bool spindle = c == 3;
    const double per = spindle ? parameters.phase_per_revolution : parameters.phase_per_metre[c];
    if (!spindle && std::abs(velocity[c]) < parameters.smallest_velocity) {
      measurement.reason[c] = AT_REST;
      continue;
    }
    const std::vector<double>& samples = record.channel(c);
    if (!(per > 0.0 || record.isSigned()) || samples.empty()) {
      measurement.reason[c] = NOT_MEASURED;
      continue;
    }
    if (!std::all_of(samples.begin(), samples.end(), [](double v) { return std::isfinite(v); })) {
      measurement.reason[c] = "its current has a sample that is not a finite number";
      continue;
    }
    if (record.isSigned()) {
      const Estimate mean_current = meanOf(samples);
      measurement.range[c] = std::copysign(1.0, velocity[c]) * mean_current.value;
      if (is_short) measurement.short_std[c] = mean_current.std_dev;
      continue;
    }
    const double frequency = per * (spindle ? spindle_speed / units::TWO_PI : std::abs(velocity[c]));
    if (!(frequency < 0.4 * record.rate())) {
      measurement.reason[c] = "its phase frequency exceeds the sample rate";
      continue;
    }
    try {
      const PhaseFitResult fit =
          fitPhase(samples, record.rate(), frequency, spindle ? parameters.largest_slip : 0.0);
      (spindle ? measurement.spindle_range : measurement.range[c]) = fit.range.value;
      if (is_short) measurement.short_std[c] = fit.range.std_dev;
      if (!spindle && teeth > 0)
        measurement.lines[c] =
            fitSpectralLines(samples, record.rate(), fit.frequency, cutLines(spindle_speed, teeth));
    } catch (const Error& error) {
      measurement.reason[c] = error.what();
    }
  }
  return measurement;
}

std::string MotorForce::text() const {
  const std::array<const char*, 4> names{"Fx", "Fy", "Fz", "torque"};
  std::string out;
  for (std::size_t c = 0; c < 4; ++c) {
    if (c == 3 && !torque && reason[3] == NOT_MEASURED) continue;
    const std::optional<Estimate>& e = c == 3 ? torque : force[c];
    std::string line;
    if (e) {
      line = formatted(c == 3 ? "%s %.2f +- %.2f Nm" : "%s %.1f +- %.1f N", names[c], e->value, e->std_dev);
    } else {
      line = formatted("%s not observable: %s", names[c], reason[c].c_str());
    }
    out += (out.empty() ? "" : "; ") + line;
  }
  return out;
}

namespace {

/// Output of an ANFIS; empty outside its calibration, with the reason. @param names inputs, for the reason
std::optional<Estimate> byAnfis(const std::optional<Anfis>& anfis, const CalibrationSamples& samples,
                                const std::vector<double>& input, const std::vector<std::string>& names,
                                std::string* reason) {
  if (!anfis) {
    *reason = formatted("ANFIS requires %zu cuts of the calibration, found %zu", samples.required(),
                        samples.inputs.size());
    return std::nullopt;
  }
  for (std::size_t i = 0; i < input.size(); ++i) {
    if (input[i] >= anfis->low(i) && input[i] <= anfis->high(i)) continue;
    *reason = formatted("%s %.4g outside the calibration of its ANFIS, %.4g to %.4g", names[i].c_str(),
                        input[i], anfis->low(i), anfis->high(i));
    return std::nullopt;
  }
  return Estimate{(*anfis)(input), anfis->stdAt(input)};
}

/// Adds the torque of the spindle motor, or the reason why it is unknown.
void addTorque(const MotorMeasurement& cut, const std::vector<MotorMeasurement>& air,
               const MotorCalibration& calibration, MotorMethod method, MotorForce* result) {
  const MotorMeasurement* nearest = nullptr;
  double least = 0.1;
  for (const MotorMeasurement& one : air) {
    if (!one.spindle_range) continue;
    const double distance = std::abs(one.spindle_speed / cut.spindle_speed - 1.0);
    if (distance <= least + 1e-3) nearest = &one, least = std::min(least, distance);
  }
  if (!calibration.spindle) {
    result->reason[3] = "the spindle motor is not calibrated";
  } else if (!nearest) {
    result->reason[3] = "no air cut near this spindle speed";
  } else {
    try {
      const double rpm = units::rpmFromRadPerSec(cut.spindle_speed),
                   rise = *cut.spindle_range - *nearest->spindle_range;
      const double torque = calibration.spindle->torque(rpm, rise);
      const double noise = calibration.spindle->torque(rpm, rise + cut.short_std[3]) - torque;
      result->torque = Estimate{torque, calibration.spindle->scatter()};
      if (method == MotorMethod::anfis) {
        result->torque = byAnfis(calibration.spindle_anfis, calibration.spindle_samples, {rise, rpm},
                                 {"rise of the current [A]", "spindle speed [rpm]"}, &result->reason[3]);
      }
      if (result->torque) result->torque->std_dev = std::hypot(result->torque->std_dev, noise);
    } catch (const Error& error) {
      result->reason[3] = error.what();
    }
  }
}

}  // namespace

MotorForce forceFromMotors(const MotorMeasurement& cut, const std::vector<MotorMeasurement>& air,
                           const MotorCalibration& calibration, const MotorParameters& parameters) {
  MotorForce result;
  result.reason = cut.reason;
  for (std::size_t a = 0; a < 3; ++a) {
    if (!cut.range[a]) continue;
    if (!calibration.drive[a]) {
      result.reason[a] = "the drive is not calibrated";
      continue;
    }
    const MotorMeasurement* nearest = nullptr;
    double least = std::log(2.0);
    for (const MotorMeasurement& one : air) {
      if (!one.range[a] || one.velocity[a] * cut.velocity[a] <= 0.0) continue;
      const double distance = std::abs(std::log(one.velocity[a] / cut.velocity[a]));
      // Of equal ones the latest, because friction changes with temperature.
      if (distance <= least + 1e-3) nearest = &one, least = std::min(least, distance);
    }
    if (!nearest) {
      result.reason[a] = "no air cut of this axis in this direction near this feed";
      continue;
    }
    if (std::abs(cut.velocity[a]) < parameters.smallest_velocity) continue;
    const DriveCalibration& drive = *calibration.drive[a];
    // Force on the tool for a current of either sign.
    const auto forceOf = [&](double current, std::string* reason) {
      const double air_current = *nearest->range[a];
      std::optional<Estimate> force = parameters.motorMethod() == MotorMethod::anfis
                                          ? byAnfis(drive.anfis, drive.samples, {current - air_current},
                                                    {"rise of the current [A]"}, reason)
                                          : drive.opposing(current, air_current);
      if (!force) return force;
      force->std_dev = std::hypot(force->std_dev, drive.newton_per_ampere.value * cut.short_std[a]);
      if (cut.velocity[a] > 0.0) force->value = -force->value;
      return force;
    };
    result.force[a] = forceOf(*cut.range[a], &result.reason[a]);
    std::string of_other;
    if (!cut.is_signed && result.force[a]) result.other[a] = forceOf(-*cut.range[a], &of_other);
    const double squared = std::pow(calibration.drive[a]->newton_per_ampere.value, 2);
    result.lines[a] = cut.lines[a];
    for (SpectralLine& line : result.lines[a]) line.power *= squared, line.power_std *= squared;
  }
  if (cut.spindle_range) addTorque(cut, air, calibration, parameters.motorMethod(), &result);
  return result;
}

}  // namespace smartmill::loadmeter
