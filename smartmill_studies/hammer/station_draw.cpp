#include "hammer/station_draw.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "smartmill_core/units.h"

namespace smartmill::hammer {
namespace {

class Dice {
 public:
  Dice(std::uint64_t seed, int number) {
    std::seed_seq words{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32),
                        static_cast<std::uint32_t>(number)};
    random_.seed(words);
  }
  double between(double low, double high) {
    return low + (high - low) * std::uniform_real_distribution<double>(0.0, 1.0)(random_);
  }
  double logBetween(double low, double high) { return std::exp(between(std::log(low), std::log(high))); }
  double normal(double std_dev) { return std_dev * std::normal_distribution<double>()(random_); }
  int whole(int low, int high) { return static_cast<int>(std::floor(between(low, high + 1))); }
  bool chance(double share) { return between(0.0, 1.0) < share; }

 private:
  std::mt19937_64 random_;
};

ToolGeometry drawTool(Dice& dice) {
  ToolGeometry tool;
  tool.teeth = dice.whole(2, 6);
  tool.diameter = std::round(dice.between(8.0, 25.0)) * units::MM;
  tool.helix = units::radFromDeg(dice.between(0.0, 45.0));
  if (dice.chance(0.3)) {
    double sum = 0.0;
    for (int k = 0; k < tool.teeth; ++k) sum += tool.pitch.emplace_back(dice.between(0.88, 1.12));
    for (double& pitch : tool.pitch) pitch *= units::TWO_PI / sum;
  }
  return tool;
}

void drawStructure(Dice& dice, const ToolGeometry& tool, double stickout, sim::StationTraits& t) {
  t.structure = "beam";
  t.flute_length = std::min(dice.between(1.0, 2.5) * tool.diameter, stickout - 5e-3);
  t.flute_core = dice.between(0.75, 0.88);
  const bool carbide = dice.chance(0.7);
  t.young = carbide ? dice.between(5.4e11, 6.2e11) : dice.between(2.0e11, 2.2e11);
  t.density = carbide ? dice.between(14000.0, 15000.0) : dice.between(7700.0, 8200.0);
  t.tool_damping = dice.between(0.002, 0.01);
  const int modes = dice.whole(2, 4);
  t.spindle_frequency.clear();
  t.spindle_damping.clear();
  t.spindle_stiffness.clear();
  t.spindle_slope.clear();
  double frequency = dice.between(400.0, 900.0);
  for (int k = 0; k < modes; ++k) {
    t.spindle_frequency.push_back(frequency);
    t.spindle_damping.push_back(dice.between(0.02, 0.05));
    t.spindle_stiffness.push_back(dice.logBetween(6e7, 4e8));
    t.spindle_slope.push_back(dice.between(-12.0, 12.0));
    frequency *= dice.between(1.35, 2.0);
  }
  t.joint_stiffness = dice.logBetween(1e8, 1e9);
  t.joint_rotation = dice.logBetween(1.0, 4.0) * 5e4 * std::pow(tool.diameter / 16e-3, 2);
  t.joint_damping = dice.between(0.02, 0.08);
  t.plane_ratio = dice.between(0.93, 1.07);
  t.plane_turn = dice.between(-0.05, 0.05);  // a mode of the other plane contributes at most 0.25 %
}

void drawSensor(Dice& dice, const ToolGeometry& tool, double depth, sim::StationTraits& t) {
  t.read_height = dice.between(1e-3, 3e-3);
  t.electrode = std::min(dice.between(1e-3, 2.5e-3), 0.2 * tool.diameter);
  t.housing = dice.between(6e-3, 10e-3);
  t.beside = dice.between(-0.15e-3, 0.15e-3);
  t.gain_error = dice.between(-0.1, 0.1);
  t.bend = dice.between(-0.03, 0.03);
  t.cross_sensor = dice.chance(0.3);
  const double pitch = units::TWO_PI / tool.teeth;
  t.tooth = dice.chance(0.25) ? "insert" : "flute";
  t.rake_flank = t.tooth == "insert" ? dice.between(0.05, 0.12) : dice.between(0.15, 0.3) * pitch;
  t.relief_flank = dice.between(0.2, 0.35) * pitch;
  t.land = dice.chance(0.5) ? dice.between(0.0, 0.03) : 0.0;
  const double lowest = dice.chance(0.6) ? std::min(40e-6, 0.2 * depth) : 0.0;
  for (int k = 0; k < tool.teeth; ++k) t.tooth_low.push_back(dice.between(0.0, lowest));
  t.eccentricity = dice.between(0.0, 20e-6);
  t.eccentricity_angle = dice.between(0.0, units::TWO_PI);
}

void drawSolenoid(Dice& dice, sim::StationTraits& t) {
  t.pulse_skew = dice.between(-0.2, 0.2);
  t.pulse_scatter = dice.between(0.0, 0.04);
  t.contact_scatter = dice.between(0.0, 0.06);
  t.bounce_chance = dice.chance(0.5) ? dice.between(0.0, 0.25) : 0.0;
  t.bounce_share = dice.between(0.15, 0.6);
  t.bounce_delay = dice.between(0.5e-3, 4e-3);
  t.coil_time = dice.between(1e-3, 5e-3);
  t.coil_force = dice.between(-4.0, 4.0);
  t.coil_volt = dice.between(-2e-3, 2e-3);  // the thesis reports none in the displacement
  t.axis_scatter = 0.07e-6;  // distance within 0.1 um, as the thesis measured by interferometer
}

smartmill::HammerStation drawStand(Dice& dice, const ToolGeometry& tool) {
  smartmill::HammerStation h;
  h.offset = dice.between(10e-3, 18e-3);
  h.peak_force = dice.between(100.0, 300.0);
  h.contact_time = dice.between(0.15e-3, 0.3e-3);
  h.force_noise_rms = dice.between(0.1, 0.4);
  h.gap_at_zero_volt = 250e-6;
  h.gain_volt = h.range_volt = 10.0;
  h.voltage_noise_rms = dice.between(0.5e-3, 2e-3);
  h.flute_depth = std::min(dice.between(0.4e-3, 1.5e-3), 0.08 * tool.diameter);
  h.position["x"] = {0.3, 0.1, 0.05};
  h.position["y"] = {0.25, 0.2, 0.05};
  return h;
}

}  // namespace

DrawnStation drawStation(std::uint64_t seed, int number) {
  Dice dice(seed, number);
  DrawnStation d;
  const ToolGeometry tool = drawTool(dice);
  d.believed.tool = tool;
  const smartmill::HammerStation stand = drawStand(dice, tool);
  d.believed.hammer = stand;
  const double stickout = std::max(dice.between(2.8, 5.0) * tool.diameter, stand.offset + 15e-3);
  d.believed.stickout = stickout;
  drawStructure(dice, tool, stickout, d.traits);
  drawSensor(dice, tool, stand.flute_depth, d.traits);
  drawSolenoid(dice, d.traits);
  d.force_scatter = dice.between(0.02, 0.1);
  d.mounting = dice.between(0.0, units::TWO_PI);
  d.direction = dice.chance(0.5) ? "x" : "y";
  for (double& off : d.set_up) off = std::clamp(dice.normal(40e-6), -100e-6, 100e-6);
  // A tool of wrong length or no tool: nothing is in front of the sensor.
  d.out_of_range = dice.chance(0.03);
  d.stickout_error = std::clamp(dice.normal(0.4e-3), -1e-3, 1e-3);
  d.fluted_error = std::clamp(dice.normal(0.8e-3), -2e-3, 2e-3);
  d.true_model = d.believed;
  for (auto& [name, place] : d.true_model.hammer->position) {
    for (std::size_t axis = 0; axis < 2; ++axis)
      place[axis] += d.set_up[axis] + (d.out_of_range ? 3e-3 : 0.0);
  }
  return d;
}

DrawnStation withSensorOpposite(DrawnStation drawn) {
  for (MachineModel* model : {&drawn.believed, &drawn.true_model}) {
    ToolGeometry& tool = *model->tool;
    tool.teeth += tool.teeth % 2;
    tool.pitch.clear();
    model->hammer->offset = 0.0;
    model->hammer->opposite = smartmill::HammerStation::Opposite{tool.diameter + 10e-3, 20e-3};
    drawn.traits.tooth_low.resize(static_cast<std::size_t>(tool.teeth), 0.0);
  }
  return drawn;
}

}  // namespace smartmill::hammer
