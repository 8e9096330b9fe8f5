#include "smartmill_sim/twin/twin.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <set>
#include <string>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/twin/spindle_drive.h"

namespace smartmill::sim {
namespace {

const std::array<const char*, 3> FORCES{{"fx", "fy", "fz"}};

// Columns that this twin can give.
const std::set<std::string> KNOWN{"spindle_angle", "fx", "fy", "fz", "load_meter", "hammer"};

void refuseWhatIsNotThere(const MachineModel& model, const CampaignTest& test,
                          const SimulationOptions& options) {
  if (options.substeps < 1) throw Error("simulation: substeps below 1");
  if (!model.effects.empty()) {
    throw Error(model.file + ": effect " + model.effects.front().name + " is not simulated by this twin");
  }
  if (test.kind == TestKind::cut && (!model.tool_tip.x.modes.empty() || !model.tool_tip.y.modes.empty())) {
    throw Error(model.file + ": tool_tip modes are not simulated by this twin (rigid tool only)");
  }
}

// Catmull-Rom through the samples: smooth, exact at the samples.
double interpolated(const std::vector<double>& samples, std::size_t i, double share) {
  const auto at = [&](std::ptrdiff_t k) {
    return samples[static_cast<std::size_t>(
        std::clamp<std::ptrdiff_t>(k, 0, static_cast<std::ptrdiff_t>(samples.size()) - 1))];
  };
  const auto k = static_cast<std::ptrdiff_t>(i);
  const double a = at(k - 1), b = at(k), c = at(k + 1), d = at(k + 2);
  return b +
         0.5 * share * (c - a + share * (2.0 * a - 5.0 * b + 4.0 * c - d + share * (3.0 * (b - c) + d - a)));
}

// The force of a tap: zero outside the contact (Dunwoody section 4.3.1), where the record shows only noise,
// which would ring in the sensor's modes. A record with further hits stays as it is.
std::vector<double> contactForce(const std::vector<double>& hammer) {
  constexpr double SECOND_HIT = 0.05;
  if (hasSecondHit(hammer, SECOND_HIT)) return hammer;
  std::vector<double> force = impactWindow(hammer);
  for (std::size_t i = 0; i < force.size(); ++i) force[i] *= hammer[i];
  return force;
}

// Runs the force on the tool through the sensor and the spindle drive, with substeps between the samples.
// force(i, share): force and torque at a share 0..1 of the way from sample i to the next; recorded columns
// are kept.
void run(const MachineModel& model, const CampaignTest& test, const SimulationOptions& options,
         const std::function<CuttingForce(std::size_t, double)>& force, Record& record) {
  const double step = 1.0 / (test.sample_rate * options.substeps);
  std::array<std::vector<double>*, 3> out{};
  std::vector<ModalFilter> sensor;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    sensor.emplace_back(model.force_sensor.axis[axis], 1.0 / step, Hold::first_order);
  }
  const bool load_meter = record.has("load_meter");
  std::optional<SpindleDrive> drive;
  if (load_meter) {
    drive.emplace(model.needSpindle("simulate load_meter"), step);
    drive->reset(test.spindle_speed);
  }
  std::mt19937_64 random(options.seed);
  std::normal_distribution<double> normal;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (record.has(FORCES[axis])) out[axis] = &record.add(FORCES[axis]);
  }
  std::vector<double>* voltage = load_meter ? &record.add("load_meter") : nullptr;
  const double sign = model.force_sensor.measures_workpiece ? -1.0 : 1.0;
  for (std::size_t i = 0; i < record.size(); ++i) {
    CuttingForce now = force(i, 0.0);
    const std::array<double, 3> applied{{now.fx, now.fy, now.fz}};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double measured = sign * sensor[axis].step(applied[axis]);
      if (!out[axis]) continue;
      const double rms = model.force_sensor.noise_rms ? (*model.force_sensor.noise_rms)[axis] : 0.0;
      (*out[axis])[i] = measured + (options.noise ? rms * normal(random) : 0.0);
    }
    double reading = 0.0;
    if (drive) {
      // The reading belongs to this sample; the torque of the way to the next one follows it.
      reading = i == 0 ? drive->step(0.0, test.spindle_speed) : (*voltage)[i];
      (*voltage)[i] = options.noise ? drive->rounded(reading) : reading;
    }
    double last = now.torque;
    double next_reading = reading;
    for (int s = 1; s <= options.substeps; ++s) {
      const double share = static_cast<double>(s) / options.substeps;
      now = force(i, share);
      if (drive) next_reading = drive->step(0.5 * (last + now.torque), test.spindle_speed);
      last = now.torque;
      if (s == options.substeps) break;  // the next sample takes this force
      sensor[0].step(now.fx);
      sensor[1].step(now.fy);
      sensor[2].step(now.fz);
    }
    if (drive && i + 1 < record.size()) (*voltage)[i + 1] = next_reading;
  }
}

// Angle at a record's first sample: the phase that fits the recorded angles best at the constant speed.
double phaseOf(const std::vector<double>& angle, const std::vector<double>& time, double speed) {
  double s = 0.0, c = 0.0;
  for (std::size_t i = 0; i < angle.size(); ++i) {
    s += std::sin(angle[i] - speed * (time[i] - time[0]));
    c += std::cos(angle[i] - speed * (time[i] - time[0]));
  }
  return std::atan2(s, c);
}

Record simulate(const MachineModel& model, const CampaignTest& test, Record record, double phase,
                const SimulationOptions& options) {
  refuseWhatIsNotThere(model, test, options);
  if (test.kind == TestKind::tap) {
    const std::vector<double> hammer = contactForce(record.column("hammer"));
    const std::size_t axis = test.direction == "x" ? 0 : test.direction == "y" ? 1 : 2;
    run(
        model, test, options,
        [&](std::size_t i, double share) {
          CuttingForce force;
          (axis == 0 ? force.fx : axis == 1 ? force.fy : force.fz) = interpolated(hammer, i, share);
          return force;
        },
        record);
    return record;
  }
  if (record.has("spindle_angle")) {
    std::vector<double>& angle = record.add("spindle_angle");
    for (std::size_t i = 0; i < record.size(); ++i) {
      angle[i] = std::fmod(phase + test.spindle_speed * (record.time[i] - record.time[0]), units::TWO_PI);
      if (angle[i] < 0.0) angle[i] += units::TWO_PI;
    }
  }
  if (test.kind == TestKind::air) {
    run(
        model, test, options, [](std::size_t, double) { return CuttingForce{}; }, record);
    return record;
  }
  const MechanisticForce process(model.needTool("simulate a cut"), model.needCutting("simulate a cut"),
                                 *test.engagement);
  const double start = test.engage_time.value_or(record.time.front() - 1.0);
  const double dt = 1.0 / test.sample_rate;
  run(
      model, test, options,
      [&](std::size_t i, double share) {
        const double t = record.time[i] + share * dt;
        // A rounded time stamp must not put the sample of engagement on the wrong side.
        if (t < start - 1e-3 * dt) return CuttingForce{};
        return process.at(phase + test.spindle_speed * (t - record.time[0]));
      },
      record);
  return record;
}

}  // namespace

Record simulateTest(const MachineModel& model, const CampaignTest& test, const Record& recorded,
                    const SimulationOptions& options) {
  if (recorded.size() == 0) throw Error(recorded.file + ": no samples");
  Record record;
  record.file = recorded.file;
  // The grid of the sample rate; a file's times are rounded to its printed digits.
  for (std::size_t i = 0; i < recorded.size(); ++i)
    record.time.push_back(recorded.time[0] + static_cast<double>(i) / test.sample_rate);
  for (const std::string& name : recorded.names) {
    if (KNOWN.count(name) != 0) record.add(name) = recorded.column(name);
  }
  const double phase = recorded.has("spindle_angle") && test.kind != TestKind::tap
                           ? phaseOf(recorded.column("spindle_angle"), record.time, test.spindle_speed)
                           : 0.0;
  return simulate(model, test, std::move(record), phase, options);
}

Record simulateTest(const MachineModel& model, const CampaignTest& test, double duration,
                    const SimulationOptions& options) {
  if (!(duration > 0.0))
    throw Error("simulation: duration " + std::to_string(duration) + " s is not positive");
  if (test.kind == TestKind::tap) throw Error("simulation: a tap needs a recorded hammer force");
  Record record;
  const auto samples = static_cast<std::size_t>(std::llround(duration * test.sample_rate));
  for (std::size_t i = 0; i < samples; ++i) record.time.push_back(static_cast<double>(i) / test.sample_rate);
  for (const char* name : {"spindle_angle", "fx", "fy", "fz"}) record.add(name).assign(samples, 0.0);
  if (model.spindle) record.add("load_meter").assign(samples, 0.0);
  std::mt19937_64 random(options.seed ^ 0x5eedULL);
  const double phase = std::uniform_real_distribution<double>(0.0, units::TWO_PI)(random);
  return simulate(model, test, std::move(record), phase, options);
}

}  // namespace smartmill::sim
