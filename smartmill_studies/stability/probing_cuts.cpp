#include "stability/probing_cuts.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "plant/beam.h"
#include "plant/drawn_spindle.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/model_system.h"

namespace smartmill::stability {
namespace {

constexpr double FREQUENCY_STD = 0.01;  // [1] of a chatter frequency
constexpr double LOAD_METER_STD = 0.1;  // [1] of the tangential coefficient

}  // namespace

RegenerativeSystem UntappedMachine::system() const {
  return systemOf(model, units::degFromRad(engagement.entry), units::degFromRad(engagement.exit));
}

UntappedMachine drawUntappedMachine(std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit;
  const auto between = [&](double low, double high) { return low + (high - low) * unit(random); };
  UntappedMachine machine;
  MachineModel& m = machine.model;
  m.file = "drawn machine";
  ToolGeometry tool;
  const double diameters[] = {0.008, 0.010, 0.012, 0.016, 0.020};
  tool.diameter = diameters[static_cast<std::size_t>(between(0.0, 5.0))];
  tool.teeth = 2 + static_cast<int>(between(0.0, 3.0));
  tool.helix = units::radFromDeg(between(20.0, 45.0));
  m.tool = tool;
  // Tangential coefficients of aluminium, cast iron, steel, titanium [N/m2].
  const double kt[][2] = {{6e8, 9.5e8}, {9e8, 1.5e9}, {1.5e9, 2.4e9}, {1.4e9, 2.1e9}};
  const auto material = static_cast<std::size_t>(between(0.0, 4.0));
  CuttingCoefficients c;
  c.ktc = between(kt[material][0], kt[material][1]);
  c.krc = c.ktc * between(0.15, 0.6);
  c.kac = c.ktc * between(0.1, 0.3);
  c.kte = between(8e3, 30e3);
  c.kre = between(8e3, 35e3);
  c.kae = between(0.5e3, 4e3);
  m.cutting = c;
  plant::ToolInSpindle beam;
  beam.shank_diameter = tool.diameter;
  beam.stickout = tool.diameter * between(3.0, 5.5);
  beam.fluted_length = beam.stickout * between(0.45, 0.75);
  beam.flute_ratio = between(0.76, 0.88);
  beam.young = between(540e9, 620e9);
  beam.density = 14400.0;
  plant::drawSpindle(random, beam);
  for (ModalModel* axis : {&m.tool_tip.x, &m.tool_tip.y}) {
    for (const plant::PointMode& mode : plant::tipModes(beam, 6000.0)) {
      Mode drawn;
      drawn.frequency = mode.frequency;
      drawn.damping_ratio = mode.damping_ratio * between(0.7, 1.3);
      drawn.gain = mode.compliance;
      axis->modes.push_back(drawn);
    }
    beam.stiffness_across *= between(0.75, 1.3);
    beam.stiffness_tilting *= between(0.8, 1.25);
  }
  const double arcs[][2] = {{0, 180}, {0, 90}, {90, 180}, {120, 180}, {0, 60}, {45, 180}};
  const auto arc = static_cast<std::size_t>(between(0.0, 6.0));
  machine.engagement.entry = units::radFromDeg(arcs[arc][0]);
  machine.engagement.exit = units::radFromDeg(arcs[arc][1]);
  machine.engagement.feed_per_tooth = between(0.04e-3, 0.12e-3);
  machine.range.speed_high = units::radPerSecFromRpm(between(8000.0, 24000.0));
  machine.range.speed_low = machine.range.speed_high * between(0.2, 0.4);
  machine.range.max_depth = 1.5 * tool.diameter;
  return machine;
}

CutProposal mostRemoval(const UntappedMachine& machine) {
  constexpr std::size_t SPEEDS = 400;
  const CutRange& range = machine.range;
  std::vector<double> speeds;
  for (std::size_t k = 0; k < SPEEDS; ++k)
    speeds.push_back(range.speed_low * std::pow(range.speed_high / range.speed_low,
                                                static_cast<double>(k) / static_cast<double>(SPEEDS - 1)));
  const auto solver = makeFloquetSolver(Method::collocation, machine.system(), SolverOptions::ofManyPoints());
  CutProposal best;
  const std::vector<Limit> limits = solver->limits(speeds, range.max_depth);
  for (std::size_t k = 0; k < SPEEDS; ++k) {
    const double depth = std::min(limits[k].depth, range.max_depth);
    if (speeds[k] * depth > best.removal()) best = {speeds[k], depth, 1.0, 0.0};
  }
  return best;
}

ProbedMachine::ProbedMachine(const UntappedMachine& machine, std::uint64_t seed)
    : kt_(machine.model.cutting->ktc),
      solver_(makeFloquetSolver(Method::collocation, machine.system())),
      random_(seed) {
}

JudgedCut ProbedMachine::at(double speed, double depth) {
  std::normal_distribution<double> normal;
  JudgedCut cut;
  cut.speed = speed;
  cut.depth = depth;
  const auto [multiplier, frequency] = solver_->at(speed)->motion(depth);
  cut.chatter = multiplier.radius() > 1.0;
  if (cut.chatter) {
    const double heard = std::abs(frequency) * (1.0 + FREQUENCY_STD * normal(random_));
    cut.frequency = Measured{heard, FREQUENCY_STD * heard};
  }
  if (first_) cut.kt = Measured{kt_ * (1.0 + LOAD_METER_STD * normal(random_)), LOAD_METER_STD * kt_};
  first_ = false;
  return cut;
}

ProbingResult probe(const UntappedMachine& machine, int cuts, const LearningOptions& options,
                    std::uint64_t seed) {
  RegenerativeSystem known;
  known.teeth = machine.model.tool->teeth;
  known.helix = machine.model.tool->helix;
  known.diameter = machine.model.tool->diameter;
  known.entry = machine.engagement.entry;
  known.exit = machine.engagement.exit;
  ChartLearning learning(MachinePrior::wide(known), machine.range, options);
  ProbedMachine cutting(machine, seed);
  ProbingResult result;
  for (int k = 0; k < cuts; ++k) {
    const CutProposal next = learning.next();
    result.proposed.push_back(next);
    result.cuts.push_back(cutting.at(next.speed, next.depth));
    learning.add(result.cuts.back());
  }
  result.recommended = learning.recommended();
  if (!result.recommended) return result;
  const CutProposal& cut = *result.recommended;
  result.stable = !cutting.at(cut.speed, cut.depth).chatter;
  result.most = mostRemoval(machine);
  result.removal = cut.removal() / result.most.removal();
  return result;
}

}  // namespace smartmill::stability
