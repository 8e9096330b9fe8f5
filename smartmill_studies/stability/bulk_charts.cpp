#include "stability/bulk_charts.h"

#include <algorithm>
#include <cmath>

#include "plant/drawn_spindle.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

constexpr double HIGHEST = 20e3;  // [Hz] of the modes
constexpr double COUNTS = 0.003;  // [1] of the softest mode's compliance: stiffer modes are ignored
constexpr int DRAWS = 100;        // per probability

double between(std::mt19937_64& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

ModalModel trueModes(const plant::ToolInSpindle& tool) {
  ModalModel model;
  const std::vector<plant::PointMode> modes = plant::tipModes(tool, HIGHEST);
  double softest = 0.0;
  for (const plant::PointMode& seen : modes) softest = std::max(softest, seen.compliance);
  for (const plant::PointMode& seen : modes) {
    if (seen.compliance < COUNTS * softest) continue;
    Mode mode;
    mode.frequency = seen.frequency;
    mode.damping_ratio = seen.damping_ratio;
    mode.gain = seen.compliance;
    model.modes.push_back(mode);
  }
  return model;
}

/// Measured value of a positive quantity: log-normal with a standard deviation.
double measured(double value, double share, std::mt19937_64& random) {
  const double log_std = std::sqrt(std::log1p(share * share));
  return value * std::exp(log_std * std::normal_distribution<double>()(random));
}

MeasuredModes measure(const ModalModel& truth, const char* direction, const ChartDoubt& doubt,
                      std::mt19937_64& random) {
  MeasuredModes seen;
  seen.tool = "drawn tool";
  seen.point = POINT_TOOL_TIP;
  seen.direction = direction;
  seen.unit = "m/N";
  for (Mode mode : truth.modes) {
    mode.frequency = measured(mode.frequency, doubt.frequency, random);
    mode.damping_ratio = measured(mode.damping_ratio, doubt.damping, random);
    mode.gain = measured(mode.gain, doubt.gain, random);
    mode.frequency_std = doubt.frequency * mode.frequency;
    mode.damping_ratio_std = doubt.damping * mode.damping_ratio;
    mode.gain_std = doubt.gain * mode.gain;
    seen.model.modes.push_back(mode);
  }
  return seen;
}

CoefficientSet measure(const ChartMachine& machine, const ChartDoubt& doubt, std::mt19937_64& random) {
  CoefficientSet set;
  set.tool = "drawn tool";
  set.material = "drawn material";
  set.source = "force";
  set.value = set.std_dev = NOT_IDENTIFIED;
  set.value.ktc = measured(machine.ktc, doubt.ktc, random);
  set.std_dev.ktc = doubt.ktc * set.value.ktc;
  set.value.krc = measured(machine.krc, doubt.krc, random);
  set.std_dev.krc = doubt.krc * set.value.krc;
  return set;
}

}  // namespace

void ChartMachine::setOverhang(double length) {
  for (plant::ToolInSpindle* tool : {&x, &y}) {
    tool->stickout = length;
    tool->fluted_length = fluted_share * length;
  }
}

ChartMachine drawChartMachine(std::mt19937_64& random) {
  ChartMachine m;
  plant::ToolInSpindle& t = m.x;
  const bool carbide = between(random, 0.0, 1.0) < 0.7;
  t.shank_diameter = between(random, 8e-3, 25e-3);
  t.flute_ratio = between(random, 0.76, 0.86);
  t.young = carbide ? 5.8e11 : 2.1e11;
  t.density = carbide ? 14300.0 : 7850.0;
  plant::drawSpindle(random, t);
  m.y = m.x;
  m.y.stiffness_across *= between(random, 0.7, 1.4);
  m.y.stiffness_tilting *= between(random, 0.7, 1.4);
  m.y.damping_ratio = between(random, 0.012, 0.04);
  m.teeth = 2 + static_cast<int>(between(random, 0.0, 4.0));
  m.helix = units::radFromDeg(between(random, 20.0, 45.0));
  m.ktc = between(random, 600e6, 2200e6);
  m.krc = m.ktc * between(random, 0.2, 0.5);
  m.torque = between(random, 20.0, 100.0);
  m.power = between(random, 8e3, 30e3);
  m.fluted_share = between(random, 0.4, 0.8);
  m.setOverhang(t.shank_diameter * between(random, 3.0, 6.5));
  return m;
}

BulkChart bulkChart(const ChartMachine& machine, const ChartParameters& parameters, const ChartDoubt& doubt,
                    std::mt19937_64& random) {
  const ModalModel x = trueModes(machine.x), y = trueModes(machine.y);
  MachineModel model;
  model.file = "a drawn machine";
  model.tool = ToolGeometry{machine.teeth, machine.x.shank_diameter, machine.helix, {}};
  model.spindle.emplace();
  model.spindle->rated_torque = machine.torque;
  model.spindle->rated_power = machine.power;
  ChartMaker maker(parameters, model);
  maker.handle(measure(x, "x", doubt, random));
  maker.handle(measure(y, "y", doubt, random));
  maker.handle(measure(machine, doubt, random));
  BulkChart result;
  result.chart = maker.chart();
  result.first_mode = std::min(x.modes.at(0).frequency, y.modes.at(0).frequency);
  if (result.chart.recommended.empty()) return result;
  const StabilityPoint& best = result.chart.recommended.front();
  result.probability = chatterProbability(*maker.uncertainSystem({}), best.spindle_speed, best.axial_depth,
                                          DRAWS, static_cast<unsigned>(random()));
  RegenerativeSystem truth = *maker.system({});
  truth.modes = systemModes(x, y);
  truth.kt = machine.ktc;
  truth.kr = machine.krc;
  result.chatters = makeFloquetSolver(Method::collocation, truth)
                        ->multiplier(best.spindle_speed, best.axial_depth)
                        .radius() > 1.0;
  return result;
}

}  // namespace smartmill::stability
