// rosrun smartmill_studies kalman_tuning_over_speed: process noise over the spindle speed (Burzoni 6.2) as
// the node tunes it, compared with the fixed design on cuts at other speeds of the simulated machine.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "kalman/spindle_rig.h"
#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace {

using namespace smartmill;
using kalman::CalibrationGoal;
using kalman::SpindleRig;
using Forces = std::array<std::vector<double>, 3>;

constexpr double LENGTH = 0.139;   // [m] of tool and holder
constexpr double APPROACH = 0.05;  // [s] of feed in air before the stock; the tuner requires 20 ms
constexpr double RATE = sim::World::SAMPLE_RATE;
/// [rpm] of the run-up, and of the cuts that count: lowest to highest of the shipped spindle.
constexpr std::array<double, 9> RUN_UP{{1000, 1500, 2200, 3300, 5000, 7300, 11000, 15500, 20000}};
constexpr std::array<double, 10> COUNTED{{1000, 1400, 2000, 2800, 3900, 5400, 7500, 10400, 14400, 20000}};

CalibrationGoal step(CalibrationGoal::Step which) {
  CalibrationGoal goal;
  goal.step = which;
  return goal;
}

void calibrate(SpindleRig& rig, bool table) {
  rig.publishCondition(CuttingCondition::Kind::none);
  if (!table) {
    rig.readStatic({0.100, LENGTH, 0.180}, {0.0, 100.0, 200.0, 300.0, 0.0}, false);
    rig.ask(step(CalibrationGoal::Step::fit));
    rig.world().setToolLength(LENGTH);
    rig.run(0.5);
  }
  for (const char* direction : {"y", "x", "z"}) rig.tap(direction, 5);
  if (!table) rig.ask(step(CalibrationGoal::Step::fit));
}

/// A slot from before tool entry on, after two segments of air (unbalance, then noise).
SpindleRig::Record slot(SpindleRig& rig, const MachineModel& model, double rpm) {
  const Workpiece& stock = model.workpiece.value();
  const ToolGeometry& tool = model.needTool("cut");
  const double speed = units::radPerSecFromRpm(rpm), pitch = 1.15 * tool.diameter;
  const int rows = static_cast<int>((stock.high[1] - stock.low[1]) / pitch);
  const int row = rig.slots();
  if (row >= rows) throw Error("tuning study: no fresh stock for another slot");
  const double y = stock.low[1] + pitch * (row + 0.5);
  const Engagement engagement{0.0, units::PI, 0.8e-3, 0.1e-3};
  const double feed = engagement.feed_per_tooth * tool.teeth * speed / units::TWO_PI;  // [m/s]
  const double approach = std::max(0.5e-3, APPROACH * feed);
  rig.spin(speed);
  rig.place({stock.low[0] - 2.0 * tool.radius(), y, stock.high[2] + 10e-3});
  for (int segment = 0; segment < 2; ++segment) {
    rig.publishCondition(CuttingCondition::Kind::air);
    rig.run(1.0);
  }
  rig.publishCondition(CuttingCondition::Kind::cut, engagement);
  rig.place({stock.low[0] - tool.radius() - approach, y, stock.high[2] - engagement.axial_depth});
  rig.start();
  rig.run(std::max(1.0, (tool.diameter + 2.0 * approach) / feed + 1200.0 / rpm), {feed, 0.0, 0.0});
  SpindleRig::Record record = rig.take();
  rig.place({stock.low[0], y, stock.high[2] + 10e-3});
  rig.publishCondition(CuttingCondition::Kind::none);
  return record;
}

/// The samples of a cut through the filters of the node. @param memory empty: the fixed design
Forces filtered(const SpindleRig::Record& record, SpindleRig& rig, double rpm,
                const kalman::MemorySchedule& memory) {
  Forces force;
  kalman::ForceCompensation compensation({}, false, {{}, [&](const ForceBlock& block) {
                                                       for (std::size_t axis = 0; axis < 3; ++axis)
                                                         force[axis].insert(force[axis].end(),
                                                                            block.force[axis].begin(),
                                                                            block.force[axis].end());
                                                     }});
  for (std::size_t axis = 0; axis < 3; ++axis)
    compensation.setSensor(axis, rig.sorted().forces().sensor(axis));
  compensation.setMemory(memory);
  CuttingCondition condition;
  condition.kind = CuttingCondition::Kind::cut;
  compensation.handle(condition);
  SampleBlock block;
  block.sample_rate = RATE;
  block.channels = {"fx", "fy", "fz"};
  block.units.assign(3, "N");
  SpindleAngle angle;
  angle.speed = units::radPerSecFromRpm(rpm);
  for (std::size_t i = 0; i + sim::World::BLOCK <= record.measured[2].size(); i += sim::World::BLOCK) {
    block.first_index = i;
    angle.stamp = block.stamp = static_cast<double>(i) / RATE;
    block.samples.clear();
    for (std::size_t k = i; k < i + sim::World::BLOCK; ++k) {
      for (std::size_t axis = 0; axis < 3; ++axis) block.samples.push_back(record.measured[axis][k]);
    }
    compensation.handle(angle);
    compensation.handle(block);
  }
  return force;
}

/// RMS [N] of the vector of the force error, and of each axis.
std::array<double, 4> errors(const Forces& force, const Forces& truth) {
  std::array<double, 4> rms{};
  const std::size_t n = std::min(force[2].size(), truth[2].size());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double squares = 0.0;
    for (std::size_t i = 0; i < n; ++i) squares += std::pow(force[axis][i] - truth[axis][i], 2);
    rms[axis + 1] = std::sqrt(squares / static_cast<double>(n));
    rms[0] = std::hypot(rms[0], rms[axis + 1]);
  }
  return rms;
}

void study(MachineModel model, std::uint64_t seed, bool table) {
  // Stock for all slots: each cuts fresh material.
  model.workpiece.value().low[1] = -0.25;
  model.workpiece->high[1] = 0.25;
  sim::WorldOptions world;
  world.seed = seed;
  world.spindle_sensor.present = !table;
  SpindleRig rig(model, world, {}, {}, table);
  rig.sorted().forces().spindle().setLength(LENGTH);
  calibrate(rig, table);
  for (const double rpm : RUN_UP) {
    std::fprintf(stderr, "run-up: cut at %.0f rpm\n", rpm);
    slot(rig, model, rpm);
  }
  const kalman::CalibrationResult tuned = rig.ask(step(CalibrationGoal::Step::fit));
  std::printf("%s\n%s\n", table ? "table dynamometer" : "sensor in the spindle", tuned.message.c_str());
  std::printf("%6s %28s %28s %20s %22s\n", "rpm", "fixed: vector, x y z [N]", "tuned: vector, x y z [N]",
              "memory x y z [rev]", "expected x y z [N]");
  std::vector<double> reduction;
  int not_worse = 0;
  for (const double rpm : COUNTED) {
    const SpindleRig::Record record = slot(rig, model, rpm);
    const auto fixed = errors(filtered(record, rig, rpm, {}), record.truth);
    const auto now = errors(filtered(record, rig, rpm, rig.sorted().forces().memory()), record.truth);
    reduction.push_back(100.0 * (1.0 - now[0] / fixed[0]));
    // Equal to a thousandth: the digits of the table.
    not_worse += now[0] <= 1.001 * fixed[0];
    std::printf("%6.0f %7.2f %6.2f %6.2f %6.2f %7.2f %6.2f %6.2f %6.2f   ", rpm, fixed[0], fixed[1], fixed[2],
                fixed[3], now[0], now[1], now[2], now[3]);
    const kalman::MemorySchedule& memory = rig.sorted().forces().memory();
    const double speed = units::radPerSecFromRpm(rpm);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto revolutions = memory.memory(axis, speed);
      revolutions ? std::printf(" %5.2f", *revolutions) : std::printf(" fixed");
    }
    std::printf("   ");
    for (std::size_t axis = 0; axis < 3; ++axis)
      std::printf(" %6.2f", memory.error(axis, speed).value_or(0.0));
    std::printf("\n");
  }
  std::printf("not worse at %d of %zu speeds, median reduction %.1f %%, least %.1f, largest %.1f\n\n",
              not_worse, COUNTED.size(), median(reduction),
              *std::min_element(reduction.begin(), reduction.end()),
              *std::max_element(reduction.begin(), reduction.end()));
}

}  // namespace

int main(int argc, char** argv) {
  std::string file;
  std::uint64_t seed = 2030;
  CommandLine line{"Tuned and fixed process noise over the spindle speed: RMS force errors of cuts."};
  line.option("MODEL", file, "smartmill-model/1 of the simulated machine").required();
  line.option("--seed", seed, "of noise and scatter").showDefault();
  return runProgram(line, argc, argv, [&] {
    const MachineModel model = readMachineModel(file);
    study(model, seed, true);
    study(model, seed, false);
  });
}
