#include "smartmill_discrepancy/explain/nonlinear_chip_law.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/gap/repeatability.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

using Complex = std::complex<double>;
using OrderLines = std::array<std::vector<Complex>, 3>;  // of each force: mean, then orders at equal steps

// One measured cut.
struct Cut {
  std::size_t chosen = 0;  // index in the runner's tests
  const TestData* test = nullptr;
  bool phase_free = false;         // its angle is not measured
  OrderLines lines;                // [N]
  std::array<double, 3> weight{};  // samples over the squares of the asynchronous part

  double chip() const { return test->test.engagement->feed_per_tooth; }
};

// Complex line of order k: force = Re cos(k angle) - Im sin(k angle).
Complex complexLine(const std::vector<double>& lines, std::size_t order) {
  if (order == 0) return lines[0];
  return 2 * order < lines.size() ? Complex(lines[2 * order - 1], -lines[2 * order]) : Complex();
}

std::vector<Cut> cutsOf(const TwinRunner& runner, const std::vector<std::size_t>& tests, std::size_t step) {
  std::vector<Cut> cuts;
  for (const std::size_t t : tests) {
    Cut cut;
    cut.chosen = static_cast<std::size_t>(std::find(runner.tests().begin(), runner.tests().end(), t) -
                                          runner.tests().begin());
    cut.test = &runner.data().tests[t];
    cut.phase_free = cut.test->phase_estimated && !cuts.empty();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (!cut.test->record.has(FORCES[axis])) return {};
      const auto lines = steadyRepeatability(*cut.test, cut.test->record.column(FORCES[axis]));
      if (!lines) return {};
      cut.weight[axis] = static_cast<double>(lines->samples) / (lines->floor * lines->floor);
      for (std::size_t k = 0; 2 * k < lines->lines.size(); k += step)
        cut.lines[axis].push_back(complexLine(lines->lines, k));
    }
    cuts.push_back(std::move(cut));
  }
  return cuts;
}

// Lines of a model in a steady cut at another feed.
OrderLines simulated(const MachineModel& model, CampaignTest test, double chip, std::size_t count) {
  constexpr std::size_t SAMPLES = 360;     // per revolution: more than twice the highest order of a line
  constexpr std::size_t REVOLUTIONS = 12;  // until the last one is steady
  test.engagement->feed_per_tooth = chip;
  test.sample_rate = SAMPLES * test.spindle_speed / units::TWO_PI;
  sim::SimulationOptions options;
  options.noise = false;
  options.phase = 0.0;
  const double duration = test.engage_time.value_or(0.0) + units::TWO_PI * REVOLUTIONS / test.spindle_speed;
  const Record record = sim::simulateTest(model, test, duration, options);
  const std::vector<double>& angle = record.column("spindle_angle");
  const auto teeth = static_cast<std::size_t>(model.tool->teeth);
  OrderLines lines;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::vector<double>& force = record.column(FORCES[axis]);
    for (std::size_t k = 0; k < count; ++k) {
      Complex sum;
      for (std::size_t i = force.size() - SAMPLES; i < force.size(); ++i)
        sum += force[i] * std::polar(1.0, -static_cast<double>(k * teeth) * angle[i]);
      lines[axis].push_back(sum * (k == 0 ? 1.0 : 2.0) / static_cast<double>(SAMPLES));
    }
  }
  return lines;
}

OrderLines sum(const OrderLines& a, double factor, const OrderLines& b) {
  OrderLines s = a;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t k = 0; k < s[axis].size(); ++k) s[axis][k] += factor * b[axis][k];
  }
  return s;
}

// In-plane forces of one law, axial force of another.
OrderLines withAxial(OrderLines lines, const OrderLines& axial) {
  lines[2] = axial[2];
  return lines;
}

// Chip and edge forces of a law, separately.
class Law {
 public:
  Law(MachineModel base, const CampaignTest& test, double middle, std::size_t count)
      : base_(std::move(base)), bare_(base_), test_(test), middle_(middle), count_(count) {
    bare_.cutting->kte = bare_.cutting->kre = bare_.cutting->kae = 0.0;
  }
  OrderLines chips(double exponent, double chip) const {
    MachineModel model = bare_;
    if (exponent > 0.0)
      model.effects.push_back(
          effectEntry("size_effect", {{"exponent", exponent}, {"reference_chip_um", middle_ / units::UM}}));
    return simulated(model, test_, chip, count_);
  }
  /// @param linear chips() without exponent at that feed: the cut without edge forces
  OrderLines edges(double onset, double chip, const OrderLines& linear) const {
    MachineModel model = base_;
    if (onset > 0.0) model.effects.push_back(effectEntry("edge_buildup", {{"chip_um", onset / units::UM}}));
    return sum(simulated(model, test_, chip, count_), -1.0, linear);
  }
  /// @param linear as in edges()
  OrderLines of(const ChipLaw& law, double chip, const OrderLines& linear) const {
    return sum(chips(law.exponent, chip), law.edge_share, edges(law.onset, chip, linear));
  }
  OrderLines own(const MachineModel& model, double chip) const {
    return simulated(model, test_, chip, count_);
  }

 private:
  MachineModel base_, bare_;
  CampaignTest test_;
  double middle_;
  std::size_t count_;
};

// Sensor gains, predicted lines and phases that fit a law to the cuts.
struct SensorFit {
  OrderLines gains;                   // [1] of the sensor
  std::vector<OrderLines> predicted;  // [N] by cut
  std::vector<double> phase;          // [rad] by cut
  double squares = 0.0;
};

Complex alignedLine(const Cut& cut, std::size_t axis, std::size_t k, double phase, std::size_t step) {
  return cut.lines[axis][k] * std::polar(1.0, -phase * static_cast<double>(k * step));
}

SensorFit initialFit(const std::vector<Cut>& cuts, const std::vector<double>& phase, std::size_t count) {
  SensorFit fit;
  for (std::vector<Complex>& of_axis : fit.gains) of_axis.resize(count);
  fit.predicted.assign(cuts.size(), fit.gains);
  fit.phase = phase;
  return fit;
}

// Least-squares gains between the lines of a law and those of the cuts.
void fitGains(const std::vector<Cut>& cuts, const std::vector<OrderLines>& law, std::size_t step,
              SensorFit* fit) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t k = 0; k < fit->gains[axis].size(); ++k) {
      Complex product;
      double own = 0.0;
      for (std::size_t i = 0; i < cuts.size(); ++i) {
        const Complex of_law = law[i][axis][k];
        product +=
            cuts[i].weight[axis] * std::conj(of_law) * alignedLine(cuts[i], axis, k, fit->phase[i], step);
        own += cuts[i].weight[axis] * std::norm(of_law);
      }
      fit->gains[axis][k] = own > 0.0 ? product / own : 0.0;
      for (std::size_t i = 0; i < cuts.size(); ++i)
        fit->predicted[i][axis][k] = fit->gains[axis][k] * law[i][axis][k];
    }
  }
}

// One Gauss-Newton step of each free phase; squares are those before the step. @return largest step [rad]
double stepPhases(const std::vector<Cut>& cuts, std::size_t step, SensorFit* fit) {
  fit->squares = 0.0;
  double largest_step = 0.0;
  for (std::size_t i = 0; i < cuts.size(); ++i) {
    double along = 0.0, squares = 0.0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t k = 0; k < fit->gains[axis].size(); ++k) {
        const Complex line = alignedLine(cuts[i], axis, k, fit->phase[i], step);
        const Complex residual = line - fit->predicted[i][axis][k];
        const Complex derivative = Complex(0.0, -static_cast<double>(k * step)) * line;
        fit->squares += cuts[i].weight[axis] * (k == 0 ? 1.0 : 0.5) * std::norm(residual);
        along += cuts[i].weight[axis] * std::real(std::conj(derivative) * residual);
        squares += cuts[i].weight[axis] * std::norm(derivative);
      }
    }
    if (!cuts[i].phase_free || squares <= 0.0) continue;
    fit->phase[i] -= along / squares;
    largest_step = std::max(largest_step, std::abs(along / squares));
  }
  return largest_step;
}

SensorFit fitSensor(const std::vector<Cut>& cuts, const std::vector<OrderLines>& law, std::size_t step,
                    const std::vector<double>& phase) {
  constexpr double TOLERANCE = 1e-6;  // [rad] of the last step
  constexpr int PASSES = 300;         // maximum alternations of gains and phases
  SensorFit fit = initialFit(cuts, phase, law.front()[0].size());
  for (int pass = 0; pass < PASSES; ++pass) {
    fitGains(cuts, law, step, &fit);
    if (stepPhases(cuts, step, &fit) < TOLERANCE) break;
  }
  return fit;
}

// Indices of a law in the grid.
struct GridPoint {
  std::size_t exponent = 0, onset = 0, edge = 0;

  ChipLaw law(const ChipLawOptions& grid, double max_chip) const {
    return {grid.exponents[exponent], grid.onsets[onset] * max_chip, grid.edge_shares[edge]};
  }
};

// Laws of in-plane and axial forces.
struct LawPair {
  GridPoint in_plane, axial;
};

// All laws of the grid at the feeds of the cuts.
class LawGrid {
 public:
  LawGrid(const std::vector<Cut>& cuts, const Law& law, double max_chip, std::size_t teeth,
          const ChipLawOptions& options)
      : cuts_(cuts), teeth_(teeth), options_(options), phase_(cuts.size(), 0.0) {
    for (const double exponent : options.exponents) {
      chips_.emplace_back();
      for (const Cut& c : cuts) chips_.back().push_back(law.chips(exponent, c.chip()));
    }
    for (const double onset : options.onsets) {
      edges_.emplace_back();
      for (std::size_t i = 0; i < cuts.size(); ++i)
        edges_.back().push_back(law.edges(onset * max_chip, cuts[i].chip(), chips_.front()[i]));
    }
  }
  const ChipLawOptions& options() const { return options_; }
  // Phases start from the previous fit.
  SensorFit fit(const LawPair& pair) {
    std::vector<OrderLines> lines;
    for (std::size_t i = 0; i < cuts_.size(); ++i)
      lines.push_back(withAxial(linesOf(pair.in_plane, i), linesOf(pair.axial, i)));
    SensorFit fit = fitSensor(cuts_, lines, teeth_, phase_);
    phase_ = fit.phase;
    return fit;
  }

 private:
  OrderLines linesOf(const GridPoint& p, std::size_t cut) const {
    return sum(chips_[p.exponent][cut], options_.edge_shares[p.edge], edges_[p.onset][cut]);
  }

  const std::vector<Cut>& cuts_;
  std::size_t teeth_;
  const ChipLawOptions& options_;
  std::vector<double> phase_;
  std::vector<std::vector<OrderLines>> chips_, edges_;  // by exponent or onset, then by cut
};

enum class FittedForces { all, in_plane, axial };

// @param of forces whose law is varied
void searchGrid(FittedForces of, LawGrid* grid, LawPair* pair, SensorFit* best) {
  const ChipLawOptions& options = grid->options();
  LawPair trial = *pair;
  GridPoint p;
  for (p.exponent = 0; p.exponent < options.exponents.size(); ++p.exponent) {
    for (p.onset = 0; p.onset < options.onsets.size(); ++p.onset) {
      for (p.edge = 0; p.edge < options.edge_shares.size(); ++p.edge) {
        if (of != FittedForces::axial) trial.in_plane = p;
        if (of != FittedForces::in_plane) trial.axial = p;
        SensorFit fit = grid->fit(trial);
        if (!best->phase.empty() && fit.squares >= best->squares) continue;
        *best = std::move(fit);
        *pair = trial;
      }
    }
  }
}

// Best law of the grid and best linear law. The axial force gets a separate law if the lines justify it.
SensorFit selectLaw(LawGrid* grid, double max_chip, NonlinearChipLaw* found) {
  const ChipLawOptions& options = grid->options();
  for (std::size_t edge = 0; edge < options.edge_shares.size(); ++edge) {
    const double squares = grid->fit({{0, 0, edge}, {0, 0, edge}}).squares;
    if (edge == 0 || squares < found->linear_squares) found->linear_squares = squares;
  }
  LawPair common;
  SensorFit best;
  searchGrid(FittedForces::all, grid, &common, &best);
  LawPair split = common;
  SensorFit own = best;
  for (int sweep = 0; sweep < options.sweeps; ++sweep) {
    const double before = own.squares;
    searchGrid(FittedForces::axial, grid, &split, &own);
    searchGrid(FittedForces::in_plane, grid, &split, &own);
    if (own.squares >= before) break;
  }
  found->squares = own.squares;
  const bool separate = best.squares - own.squares > found->requiredReduction();
  const LawPair& selected = separate ? split : common;
  if (separate) best = std::move(own);
  found->squares = best.squares;
  found->in_plane = selected.in_plane.law(options, max_chip);
  found->axial = selected.axial.law(options, max_chip);
  return best;
}

// Curvature of the law behind the sensor, in addition to that of the model.
FeedCurvature curvatureOf(const Law& law, const MachineModel& model, const NonlinearChipLaw& found,
                          const OrderLines& gains, double min_chip, double max_chip, std::size_t teeth,
                          std::size_t nodes) {
  const auto intervals = static_cast<double>(nodes - 1);
  FeedCurvature curvature;
  std::vector<OrderLines> difference;
  for (std::size_t n = 0; n < nodes; ++n) {
    const double chip = min_chip + (max_chip - min_chip) * static_cast<double>(n) / intervals;
    curvature.chips.push_back(chip);
    const OrderLines linear = law.chips(0.0, chip);
    OrderLines lines = withAxial(law.of(found.in_plane, chip, linear), law.of(found.axial, chip, linear));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t k = 0; k < lines[axis].size(); ++k) lines[axis][k] *= gains[axis][k];
    }
    difference.push_back(sum(lines, -1.0, law.own(model, chip)));
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t k = 0; k < gains[axis].size(); ++k) {
      std::vector<double>& table = curvature.orders[static_cast<double>(k * teeth)][FORCES[axis]];
      for (std::size_t n = 0; n < nodes; ++n) {
        const double fraction = static_cast<double>(n) / intervals;
        const Complex b = difference[n][axis][k] - (1.0 - fraction) * difference.front()[axis][k] -
                          fraction * difference.back()[axis][k];
        table.push_back(b.real());
        table.push_back(-b.imag());
      }
    }
  }
  return curvature;
}

}  // namespace

std::array<double, 2> FeedCurvature::at(double order, const std::string& channel, double chip) const {
  const auto found = orders.find(order);
  const auto next = std::upper_bound(chips.begin(), chips.end(), chip);
  if (found == orders.end() || next == chips.begin() || next == chips.end()) return {{0.0, 0.0}};
  const auto n = static_cast<std::size_t>(next - chips.begin());
  const double fraction = (chip - chips[n - 1]) / (chips[n] - chips[n - 1]);
  const std::vector<double>& table = found->second.at(channel);
  std::array<double, 2> two{};
  for (std::size_t component = 0; component < 2; ++component)
    two[component] = (1.0 - fraction) * table[2 * n - 2 + component] + fraction * table[2 * n + component];
  return two;
}

double NonlinearChipLaw::requiredReduction() const {
  constexpr double VALUES = 3.0;  // of a ChipLaw
  return VALUES * std::log(line_count) * squares / line_count;
}

std::optional<NonlinearChipLaw> identifyChipLaw(const TwinRunner& runner,
                                                const std::vector<std::size_t>& tests,
                                                const MachineModel& nominal, const MachineModel& model,
                                                const ChipLawOptions& options) {
  const auto isNonlinear = [](const EffectEntry& e) {
    return e.name == "size_effect" || e.name == "edge_buildup" ||
           e.name == std::string(EMPIRICAL) + ":chip_thickness";
  };
  if (!nominal.tool || !nominal.cutting ||
      std::any_of(model.effects.begin(), model.effects.end(), isNonlinear))
    return {};
  const auto teeth = static_cast<std::size_t>(nominal.tool->teeth);
  const std::vector<Cut> cuts = cutsOf(runner, tests, teeth);
  if (cuts.empty()) return {};
  double min_chip = cuts.front().chip(), max_chip = min_chip;
  std::size_t count = cuts.front().lines[0].size();
  for (const Cut& c : cuts) {
    min_chip = std::min(min_chip, c.chip());
    max_chip = std::max(max_chip, c.chip());
    count = std::min(count, c.lines[0].size());
  }
  MachineModel even = nominal;
  even.effects.clear();
  const Law law(even, cuts.front().test->test, 0.5 * (min_chip + max_chip), count);
  NonlinearChipLaw found;
  found.line_count = static_cast<double>(cuts.size() * 3 * (2 * count - 1));
  LawGrid grid(cuts, law, max_chip, teeth, options);
  const SensorFit fit = selectLaw(&grid, max_chip, &found);
  found.phase_shift.assign(runner.tests().size(), 0.0);
  for (std::size_t i = 0; i < cuts.size(); ++i) found.phase_shift[cuts[i].chosen] = fit.phase[i];
  if (found.isNonlinear())
    found.curvature = curvatureOf(law, model, found, fit.gains, min_chip, max_chip, teeth, options.feeds);
  return found;
}

}  // namespace smartmill::discrepancy
