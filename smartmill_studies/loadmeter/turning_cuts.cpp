#include "loadmeter/turning_cuts.h"

#include <cmath>
#include <fstream>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/identification/identification.h"

namespace smartmill::loadmeter {

namespace {

constexpr double BLOCK = 5e-3, STATE_PERIOD = 2e-2;  // [s] as lathe_node

/// True force of a cut over time.
class Truth {
 public:
  void clear() { points_.clear(); }
  void add(const ForceBlock& block) {
    Point point{block.stamp, {}};
    const double n = static_cast<double>(block.force[0].size());
    for (std::size_t a = 0; a < 3; ++a) {
      for (const double f : block.force[a]) point.force[a] += f / n;
    }
    points_.push_back(point);
  }
  /// Mean over the steady part of a test.
  void meanOf(const LoadTest& test, LatheCut* cut) const {
    double n = 0.0;
    cut->force = {};
    for (const Point& p : points_) {
      if (p.stamp < test.stamp - test.duration || p.stamp > test.stamp) continue;
      ++n;
      for (std::size_t a = 0; a < 3; ++a) cut->force[a] += p.force[a];
    }
    for (double& f : cut->force) f /= n;
    cut->torque = cut->force[1] * cut->radius;
  }

 private:
  struct Point {
    double stamp;
    std::array<double, 3> force;
  };
  std::vector<Point> points_;
};

}  // namespace

IdentificationParameters latheParameters(const std::string& method) {
  IdentificationParameters parameters;
  parameters.motor.phase_per_metre = {1000.0, 1000.0, 1000.0};
  parameters.motor.phase_per_revolution = 2.0;
  parameters.motor.method = method;
  parameters.force.period = 0.0;
  return parameters;
}

sim::LatheTraits latheTraits(double spindle_speed, std::uint64_t seed) {
  sim::LatheTraits traits;
  traits.spindle_speed = spindle_speed;
  traits.seed = seed;
  // K / K_m = 0.035, below 2 zeta (1 + zeta) = 0.0408 (Merritt).
  traits.cutting_stiffness = 7.0e5;
  traits.chip_exponent = 0.45;
  return traits;
}

sim::TurningTraits standardPasses() {
  sim::TurningTraits traits;
  traits.motor.currents = true;
  traits.passes.angle = traits.passes.feed = traits.passes.depth = {};
  for (const double angle : {0.0, 0.25 * units::PI, 0.5 * units::PI}) {
    for (const double feed : {1.0e-4, 2.0e-4}) {
      for (const double depth : {0.4e-3, 0.9e-3}) {
        traits.passes.angle.push_back(angle);
        traits.passes.feed.push_back(feed);
        traits.passes.depth.push_back(depth);
      }
    }
  }
  return traits;
}

std::vector<LatheCut> runLathe(const sim::LatheTraits& lathe_traits, const sim::TurningTraits& turning,
                               const MachineModel& model, const IdentificationParameters& parameters,
                               const std::optional<MotorCalibration>& calibration) {
  sim::Lathe lathe(lathe_traits);
  sim::TurningMachine machine(lathe, turning, lathe_traits, model.needSpindle("simulate the lathe"));
  LoadMeterIdentification identification(model, parameters);
  if (calibration) {
    identification.forces().setMotors(*calibration);
  } else {
    identification.forces().enableSelfCalibration();  // measures the currents
  }
  std::vector<LatheCut> cuts;
  Truth truth;
  std::optional<MotorMeasurement> air;
  identification.outputs().test = [&](const LoadTest& test) {
    if (!test.motor) throw Error(test.condition.name + ": no motor currents");
    if (!test.isCut()) {
      air = test.motor;
      return;
    }
    LatheCut cut;
    cut.name = test.condition.name;
    cut.radius = test.condition.tool.radius();
    cut.cut = *test.motor;
    cut.air = air.value_or(MotorMeasurement());
    cut.motors = test.force;
    truth.meanOf(test, &cut);
    cuts.push_back(cut);
  };
  identification.outputs().force = [&](const ForceEstimate& force) { cuts.back().estimate = force; };
  const auto size = static_cast<std::size_t>(std::lround(BLOCK * lathe_traits.rate));
  for (double next = 0.0; cuts.size() < turning.passes.angle.size();) {
    const sim::TurningMachine::Block block = machine.advance(size);
    if (block.condition) {
      identification.handle(*block.condition);
      truth.clear();
    }
    truth.add(block.force);
    identification.handle(block.motor_current);
    if (block.state.stamp < next - 0.5 * BLOCK) continue;
    next = block.state.stamp + STATE_PERIOD;
    identification.handle(block.state);
    identification.handle(block.load);
  }
  return cuts;
}

void writeTables(const std::vector<LatheCut>& cuts, const std::string& cuts_file,
                 const std::string& currents_file) {
  std::ofstream forces(cuts_file), currents(currents_file);
  forces << "cut,force_x[N],force_y[N],force_z[N],torque[N m]\n";
  currents << "cut,spindle_speed[rpm]";
  for (const char* axis : AXIS_NAMES) currents << ",current_" << axis << "[A],air_" << axis << "[A]";
  currents << ",current_spindle[A],air_spindle[A]\n";
  const auto pair = [](const std::optional<double>& current, const std::optional<double>& air_current) {
    return current && air_current ? formatted(",%.5f,%.5f", *current, *air_current) : std::string(",,");
  };
  for (std::size_t i = 0; i < cuts.size(); ++i) {
    const LatheCut& cut = cuts[i];
    const std::string name = "cut" + std::to_string(i + 1);
    forces << name;
    currents << name << formatted(",%.3f", units::rpmFromRadPerSec(cut.cut.spindle_speed));
    for (std::size_t a = 0; a < 3; ++a) {
      const double against = cut.cut.velocity[a] > 0.0 ? -cut.force[a] : cut.force[a];
      forces << (cut.cut.range[a] ? formatted(",%.2f", against) : ",");
      currents << pair(cut.cut.range[a], cut.air.range[a]);
    }
    forces << formatted(",%.4f\n", cut.torque);
    currents << pair(cut.cut.spindle_range, cut.air.spindle_range) << "\n";
  }
  if (!forces.flush()) throw Error(cuts_file + ": cannot be written");
  if (!currents.flush()) throw Error(currents_file + ": cannot be written");
}

}  // namespace smartmill::loadmeter
