#include "smartmill_sim/twin/twin.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <random>
#include <set>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/twin/cutting_machine.h"

namespace smartmill::sim {
namespace {

const std::array<const char*, 3> FORCES{{"fx", "fy", "fz"}};
const std::array<const char*, 2> TIP{{"tool_x", "tool_y"}};

// Columns that this twin can give.
const std::set<std::string> KNOWN{"spindle_angle", "fx",     "fy",     "fz",
                                  "load_meter",    "hammer", "tool_x", "tool_y"};

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

// Runs the machine over the record, with substeps between the samples; recorded columns are kept.
// input(i, share): what happens at a share 0..1 of the way from sample i to the next.
void run(const MachineModel& model, const CampaignTest& test, const SimulationOptions& options,
         CuttingMachine& machine, const std::function<CuttingMachine::Input(std::size_t, double)>& input,
         Record& record) {
  std::array<std::vector<double>*, 3> out{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (record.has(FORCES[axis])) out[axis] = &record.add(FORCES[axis]);
  }
  std::vector<double>* voltage = nullptr;
  if (record.has("load_meter")) {
    model.needSpindle("simulate load_meter");
    voltage = &record.add("load_meter");
    machine.resetLoadMeter(test.spindle_speed);
  }
  std::array<std::vector<double>*, 2> tip{};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    if (record.has(TIP[axis])) tip[axis] = &record.add(TIP[axis]);
  }
  std::mt19937_64 random(options.seed);
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < record.size(); ++i) {
    const CuttingMachine::Output now = machine.step(input(i, 0.0));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (!out[axis]) continue;
      const double rms = model.force_sensor.noise_rms ? (*model.force_sensor.noise_rms)[axis] : 0.0;
      (*out[axis])[i] = now.sensor[axis] + (options.noise ? rms * normal(random) : 0.0);
    }
    for (std::size_t axis = 0; axis < 2; ++axis) {
      if (tip[axis]) (*tip[axis])[i] = now.displacement[axis];
    }
    if (voltage) (*voltage)[i] = options.noise ? machine.rounded(now.load_meter) : now.load_meter;
    for (int s = 1; s < options.substeps; ++s) {
      machine.step(input(i, static_cast<double>(s) / options.substeps));
    }
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
  if (options.substeps < 1) throw Error("simulation: substeps below 1");
  CuttingMachine machine(model, 1.0 / (test.sample_rate * options.substeps));
  if (test.kind == TestKind::tap) {
    const std::vector<double> hammer = contactForce(record.column("hammer"));
    const std::size_t axis = test.direction == "x" ? 0 : test.direction == "y" ? 1 : 2;
    run(
        model, test, options, machine,
        [&](std::size_t i, double share) {
          CuttingMachine::Input input;
          // A record of the tool's displacement is of a hit on the tool, any other of one on the sensor.
          const double force = interpolated(hammer, i, share);
          if (axis < 2 && record.has(TIP[axis])) {
            input.tip_force[axis] = force;
          } else {
            input.sensor_force[axis] = force;
          }
          return input;
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
  const bool cut = test.kind == TestKind::cut;
  double feed = 0.0;  // [m/s]
  if (cut) {
    model.needCutting("simulate a cut");
    feed = test.engagement->feed_per_tooth * model.needTool("simulate a cut").teeth * test.spindle_speed /
           units::TWO_PI;
  }
  const double start = test.engage_time.value_or(record.time.front() - 1.0);
  const double dt = 1.0 / test.sample_rate;
  bool engaged = false;
  run(
      model, test, options, machine,
      [&](std::size_t i, double share) {
        const double t = record.time[i] + share * dt;
        CuttingMachine::Input input;
        input.motion.angle = phase + test.spindle_speed * (t - record.time[0]);
        input.motion.speed = test.spindle_speed;
        input.motion.velocity[0] = feed;
        input.motion.centre[0] = feed * (t - record.time[0]);
        // A rounded time stamp must not put the sample of engagement on the wrong side.
        if (cut && !engaged && t >= start - 1e-3 * dt) {
          machine.engage({{test.engagement->entry, test.engagement->exit, test.engagement->axial_depth}},
                         input.motion);
          engaged = true;
        }
        return input;
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
