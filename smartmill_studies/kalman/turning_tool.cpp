#include "kalman/turning_tool.h"

#include <cmath>
#include <filesystem>
#include <random>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/testing/mill.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/in_cut/cut_segments.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::kalman {

std::vector<CampaignTest> TurningToolCase::tests(double speed) const {
  std::vector<CampaignTest> all;
  for (int i = 0; i < cuts; ++i) {
    CampaignTest test;
    test.spindle_speed = speed * (1.0 + width * (cuts > 1 ? 2.0 * i / (cuts - 1) - 1.0 : 0.0));
    test.name = formatted("slot_%.0f", units::rpmFromRadPerSec(test.spindle_speed));
    test.file = test.name + ".csv";
    test.kind = TestKind::cut;
    test.sample_rate = 25600.0;
    test.engage_time = 0.02;
    test.engagement = Engagement{0.0, units::PI, depth, feed_per_tooth};
    all.push_back(test);
  }
  return all;
}

Record TurningToolCase::record(const CampaignTest& test, std::uint64_t seed) const {
  sim::SimulationOptions simulation;
  simulation.seed = seed;
  // Simulated columns.
  Record columns;
  const auto size = static_cast<std::size_t>(duration * test.sample_rate);
  std::vector<double> angle;
  for (std::size_t i = 0; i < size; ++i) {
    columns.time.push_back(static_cast<double>(i) / test.sample_rate);
    angle.push_back(std::fmod(test.spindle_speed * columns.time.back(), units::TWO_PI));
  }
  columns.add("spindle_angle") = angle;
  for (const char* name : {"fx", "fy", "fz", "tool_x", "tool_y"}) columns.add(name).assign(size, 0.0);
  Record cut = simulateTest(spindle.at(test.spindle_speed, model), test, columns, simulation);
  // Noise of the displacement sensors.
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, displacement_noise);
  for (const char* name : {"tool_x", "tool_y"})
    for (double& value : cut.add(name)) value += noise(random);
  return cut;
}

std::array<std::vector<SpeedFrf>, 2> TurningToolCase::identify(std::uint64_t seed) const {
  std::array<std::vector<FrfLine>, 2> lines;
  std::uint64_t n = 0;
  for (const double speed : speeds) {
    for (const CampaignTest& test : tests(speed)) {
      const Record cut = record(test, 1000 * seed + n++);
      for (std::size_t axis = 0; axis < 2; ++axis) {
        const auto found = frfLines(toolSegment(cut, test, axis, model.force_sensor.axis[axis]), options);
        lines[axis].insert(lines[axis].end(), found.begin(), found.end());
      }
    }
  }
  std::array<std::vector<SpeedFrf>, 2> found;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    found[axis] = cuttingFrfs(lines[axis], "m/N", options);
    if (found[axis].size() != speeds.size())
      throw Error("turning tool: its groups of cuts gave " + std::to_string(found[axis].size()) + " FRFs");
  }
  return found;
}

void TurningToolCase::write(const std::string& folder, std::uint64_t seed) const {
  std::filesystem::create_directories(folder);
  Campaign campaign;
  campaign.folder = folder;
  campaign.model_file = "model.yaml";
  for (const double speed : speeds)
    for (const CampaignTest& test : tests(speed)) campaign.tests.push_back(test);
  std::uint64_t n = 0;
  for (const CampaignTest& test : campaign.tests)
    writeCsv(record(test, seed + n++), (std::filesystem::path(folder) / test.file).string());
  MachineModel believed = model;
  believed.effects.clear();
  writeMachineModel(believed, (std::filesystem::path(folder) / "model.yaml").string());
  writeCampaign(campaign, folder);
}

TurningToolCase turningToolCase() {
  TurningToolCase c;
  c.model = mill();
  c.model.file = "turning tool";
  c.model.tool_tip.x.modes = {{1200.0, 0.030, 1.0 / 24e6}};
  c.model.tool_tip.y.modes = {{1100.0, 0.034, 1.0 / 21e6}};
  c.model.force_sensor.axis[0].modes = {{1900.0, 0.02, 0.9}};
  c.model.force_sensor.axis[1].modes = {{1700.0, 0.025, 0.9}};
  for (std::size_t axis = 0; axis < 2; ++axis) c.model.force_sensor.axis[axis].direct = 0.1;
  c.model.force_sensor.noise_rms = Axes3{{1.0, 1.0, 1.0}};
  EffectEntry runout;
  runout.name = "runout";
  runout.numbers = {{"offset_um", 12.0}, {"angle_deg", 40.0}};
  c.model.effects = {runout};
  c.spindle.reference_speed = units::radPerSecFromRpm(18000.0);
  c.spindle.softening = 0.12;
  c.spindle.damping_rise = 0.25;
  for (const double rpm : {4000.0, 6000.0, 9000.0, 12000.0, 15000.0, 18000.0})
    c.speeds.push_back(units::radPerSecFromRpm(rpm));
  c.options.high = 2500.0;
  return c;
}

}  // namespace smartmill::kalman
