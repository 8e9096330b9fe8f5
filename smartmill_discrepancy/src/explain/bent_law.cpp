#include "smartmill_discrepancy/explain/bent_law.h"

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
using Lines = std::array<std::vector<Complex>, 3>;  // of each force: level, then orders at equal steps

// Laws that are tried. Onsets in shares of the largest feed: what comes on far below the least feed is
// always there, what comes on beyond the largest is a chip force.
// The first exponent is that of the straight law.
constexpr std::array<double, 7> EXPONENTS{{0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6}};
constexpr std::array<double, 7> ONSETS{{0.0, 0.04, 0.08, 0.12, 0.16, 0.24, 0.32}};
constexpr std::array<double, 15> EDGES{
    {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5}};
constexpr int PASSES = 300;        // of gains and phases in turn, at most
constexpr std::size_t NODES = 11;  // feeds at which the bend is told

// One cut as it was measured.
struct Cut {
  std::size_t chosen = 0;  // of the runner's tests
  const TestData* test = nullptr;
  bool turns = false;              // its angle is not measured
  Lines lines;                     // [N]
  std::array<double, 3> weight{};  // samples over the squares of what does not come again

  double chip() const { return test->test.engagement->feed_per_tooth; }
};

// Complex line of order k: its real part times cos(k angle) and minus its imaginary part times sin add up.
Complex lineOf(const std::vector<double>& lines, std::size_t order) {
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
    cut.turns = cut.test->phase_estimated && !cuts.empty();
    const std::vector<double>& angle = cut.test->record.column("spindle_angle");
    const std::size_t first = cut.test->first_cut, size = angle.size();
    const auto from = static_cast<std::ptrdiff_t>(first + (size - first) / 8);
    const std::vector<double> turning(angle.begin() + from, angle.end());
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (!cut.test->record.has(FORCES[axis])) return {};
      const std::vector<double>& force = cut.test->record.column(FORCES[axis]);
      const auto told = repeatability({force.begin() + from, force.end()}, turning);
      if (!told) return {};
      cut.weight[axis] = static_cast<double>(told->samples) / (told->floor * told->floor);
      for (std::size_t k = 0; 2 * k < told->lines.size(); k += step)
        cut.lines[axis].push_back(lineOf(told->lines, k));
    }
    cuts.push_back(std::move(cut));
  }
  return cuts;
}

// Lines of a model in a steady cut of this kind, at another feed.
Lines simulated(const MachineModel& model, CampaignTest test, double chip, std::size_t count) {
  constexpr std::size_t SAMPLES = 360, TURNS = 12;  // of a turn; after which the last one is steady
  test.engagement->feed_per_tooth = chip;
  test.sample_rate = SAMPLES * test.spindle_speed / units::TWO_PI;
  sim::SimulationOptions options;
  options.noise = false;
  options.phase = 0.0;
  const double duration = test.engage_time.value_or(0.0) + units::TWO_PI * TURNS / test.spindle_speed;
  const Record record = sim::simulateTest(model, test, duration, options);
  const std::vector<double>& angle = record.column("spindle_angle");
  const auto teeth = static_cast<std::size_t>(model.tool->teeth);
  Lines lines;
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

Lines sum(const Lines& a, double factor, const Lines& b) {
  Lines s = a;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t k = 0; k < s[axis].size(); ++k) s[axis][k] += factor * b[axis][k];
  }
  return s;
}

// Forces in the plane from one law, along the axis from another.
Lines withAxial(Lines lines, const Lines& axial) {
  lines[2] = axial[2];
  return lines;
}

// The law's forces, of chips and of edges by themselves.
class Law {
 public:
  Law(MachineModel base, const CampaignTest& test, double middle, std::size_t count)
      : base_(std::move(base)), bare_(base_), test_(test), middle_(middle), count_(count) {
    bare_.cutting->kte = bare_.cutting->kre = bare_.cutting->kae = 0.0;
  }
  Lines chips(double exponent, double chip) const {
    MachineModel model = bare_;
    if (exponent > 0.0)
      model.effects.push_back(
          effectEntry("size_effect", {{"exponent", exponent}, {"reference_chip_um", middle_ / units::UM}}));
    return simulated(model, test_, chip, count_);
  }
  /// @param straight chips() of no exponent at that chip: what the cut is without edges
  Lines edges(double onset, double chip, const Lines& straight) const {
    MachineModel model = base_;
    if (onset > 0.0) model.effects.push_back(effectEntry("edge_buildup", {{"chip_um", onset / units::UM}}));
    return sum(simulated(model, test_, chip, count_), -1.0, straight);
  }
  /// @param straight as edges() takes it
  Lines of(const ChipLaw& law, double chip, const Lines& straight) const {
    return sum(chips(law.exponent, chip), law.edge_share, edges(law.onset, chip, straight));
  }
  Lines own(const MachineModel& model, double chip) const { return simulated(model, test_, chip, count_); }

 private:
  MachineModel base_, bare_;
  CampaignTest test_;
  double middle_;
  std::size_t count_;
};

// What stands for the lines of the cuts, and where the cuts lie for it.
struct Seen {
  Lines gains;                   // [1] of a sensor behind a law
  std::vector<Lines> predicted;  // [N] of each cut
  std::vector<double> phase;     // [rad] of each cut
  double squares = 0.0;
};

Complex turnedLine(const Cut& cut, std::size_t axis, std::size_t k, double phase, std::size_t step) {
  return cut.lines[axis][k] * std::polar(1.0, -phase * static_cast<double>(k * step));
}

Seen begun(const std::vector<Cut>& cuts, const std::vector<double>& phase, std::size_t count) {
  Seen seen;
  for (std::vector<Complex>& of_axis : seen.gains) of_axis.resize(count);
  seen.predicted.assign(cuts.size(), seen.gains);
  seen.phase = phase;
  return seen;
}

// Gains by which the lines of a law come nearest to those of the cuts.
void predictByGains(const std::vector<Cut>& cuts, const std::vector<Lines>& law, std::size_t step,
                    Seen* seen) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t k = 0; k < seen->gains[axis].size(); ++k) {
      Complex product;
      double own = 0.0;
      for (std::size_t i = 0; i < cuts.size(); ++i) {
        const Complex of_law = law[i][axis][k];
        product +=
            cuts[i].weight[axis] * std::conj(of_law) * turnedLine(cuts[i], axis, k, seen->phase[i], step);
        own += cuts[i].weight[axis] * std::norm(of_law);
      }
      seen->gains[axis][k] = own > 0.0 ? product / own : 0.0;
      for (std::size_t i = 0; i < cuts.size(); ++i)
        seen->predicted[i][axis][k] = seen->gains[axis][k] * law[i][axis][k];
    }
  }
}

// One step of each free phase; the squares as they were before it. @return its largest step [rad]
double setPhases(const std::vector<Cut>& cuts, std::size_t step, Seen* seen) {
  seen->squares = 0.0;
  double largest = 0.0;
  for (std::size_t i = 0; i < cuts.size(); ++i) {
    double along = 0.0, squares = 0.0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t k = 0; k < seen->gains[axis].size(); ++k) {
        const Complex line = turnedLine(cuts[i], axis, k, seen->phase[i], step);
        const Complex left = line - seen->predicted[i][axis][k];
        const Complex turned = Complex(0.0, -static_cast<double>(k * step)) * line;
        seen->squares += cuts[i].weight[axis] * (k == 0 ? 1.0 : 0.5) * std::norm(left);
        along += cuts[i].weight[axis] * std::real(std::conj(turned) * left);
        squares += cuts[i].weight[axis] * std::norm(turned);
      }
    }
    if (!cuts[i].turns || squares <= 0.0) continue;
    seen->phase[i] -= along / squares;
    largest = std::max(largest, std::abs(along / squares));
  }
  return largest;
}

Seen seenThrough(const std::vector<Cut>& cuts, const std::vector<Lines>& law, std::size_t step,
                 const std::vector<double>& phase) {
  constexpr double SETTLED = 1e-6;  // [rad]
  Seen seen = begun(cuts, phase, law.front()[0].size());
  for (int pass = 0; pass < PASSES; ++pass) {
    predictByGains(cuts, law, step, &seen);
    if (setPhases(cuts, step, &seen) < SETTLED) break;
  }
  return seen;
}

// A law by its place among those that are tried.
struct Place {
  std::size_t exponent = 0, onset = 0, edge = 0;

  ChipLaw law(double largest) const { return {EXPONENTS[exponent], ONSETS[onset] * largest, EDGES[edge]}; }
};

// Laws of the forces in the plane of the tool's turning and along its axis.
struct Pair {
  Place in_plane, axial;
};

// All laws that are tried, at the feeds of the cuts.
class Trials {
 public:
  Trials(const std::vector<Cut>& cuts, const Law& law, double largest, std::size_t teeth)
      : cuts_(cuts), teeth_(teeth), phase_(cuts.size(), 0.0) {
    for (const double exponent : EXPONENTS) {
      chips_.emplace_back();
      for (const Cut& c : cuts) chips_.back().push_back(law.chips(exponent, c.chip()));
    }
    for (const double onset : ONSETS) {
      edges_.emplace_back();
      for (std::size_t i = 0; i < cuts.size(); ++i)
        edges_.back().push_back(law.edges(onset * largest, cuts[i].chip(), chips_.front()[i]));
    }
  }
  // Phases begin where the last trial left them.
  Seen seen(const Pair& pair) {
    std::vector<Lines> lines;
    for (std::size_t i = 0; i < cuts_.size(); ++i)
      lines.push_back(withAxial(linesOf(pair.in_plane, i), linesOf(pair.axial, i)));
    Seen seen = seenThrough(cuts_, lines, teeth_, phase_);
    phase_ = seen.phase;
    return seen;
  }

 private:
  Lines linesOf(const Place& p, std::size_t cut) const {
    return sum(chips_[p.exponent][cut], EDGES[p.edge], edges_[p.onset][cut]);
  }

  const std::vector<Cut>& cuts_;
  std::size_t teeth_;
  std::vector<double> phase_;
  std::vector<std::vector<Lines>> chips_, edges_;  // of each exponent and onset, of each cut
};

enum class Of { all, in_plane, axial };

// @param of which forces all laws are tried
void tryAll(Of of, Trials* trials, Pair* pair, Seen* best) {
  Pair tried = *pair;
  Place p;
  for (p.exponent = 0; p.exponent < EXPONENTS.size(); ++p.exponent) {
    for (p.onset = 0; p.onset < ONSETS.size(); ++p.onset) {
      for (p.edge = 0; p.edge < EDGES.size(); ++p.edge) {
        if (of != Of::axial) tried.in_plane = p;
        if (of != Of::in_plane) tried.axial = p;
        Seen seen = trials->seen(tried);
        if (!best->phase.empty() && seen.squares >= best->squares) continue;
        *best = std::move(seen);
        *pair = tried;
      }
    }
  }
}

// The best of all laws, and how the straight one does. Nothing ties the axial force to the others: its law
// is its own where the lines ask for that.
Seen chosenLaw(Trials* trials, double largest, BentLaw* found) {
  constexpr int SWEEPS = 5;
  for (std::size_t edge = 0; edge < EDGES.size(); ++edge) {
    const double squares = trials->seen({{0, 0, edge}, {0, 0, edge}}).squares;
    if (edge == 0 || squares < found->straight_squares) found->straight_squares = squares;
  }
  Pair alike;
  Seen best;
  tryAll(Of::all, trials, &alike, &best);
  Pair apart = alike;
  Seen own = best;
  for (int sweep = 0; sweep < SWEEPS; ++sweep) {
    const double before = own.squares;
    tryAll(Of::axial, trials, &apart, &own);
    tryAll(Of::in_plane, trials, &apart, &own);
    if (own.squares >= before) break;
  }
  found->squares = own.squares;
  const bool asked = best.squares - own.squares > found->costOfALaw();
  const Pair& taken = asked ? apart : alike;
  if (asked) best = std::move(own);
  found->squares = best.squares;
  found->in_plane = taken.in_plane.law(largest);
  found->axial = taken.axial.law(largest);
  return best;
}

// What the law, as the sensor shows it, bends more over the feed than the model's own.
Bend bendOf(const Law& law, const MachineModel& model, const BentLaw& found, const Lines& gains, double least,
            double largest, std::size_t teeth) {
  Bend bend;
  std::vector<Lines> more;
  for (std::size_t n = 0; n < NODES; ++n) {
    const double chip = least + (largest - least) * static_cast<double>(n) / (NODES - 1);
    bend.chips.push_back(chip);
    const Lines straight = law.chips(0.0, chip);
    Lines lines = withAxial(law.of(found.in_plane, chip, straight), law.of(found.axial, chip, straight));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t k = 0; k < lines[axis].size(); ++k) lines[axis][k] *= gains[axis][k];
    }
    more.push_back(sum(lines, -1.0, law.own(model, chip)));
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t k = 0; k < gains[axis].size(); ++k) {
      std::vector<double>& table = bend.orders[static_cast<double>(k * teeth)][FORCES[axis]];
      for (std::size_t n = 0; n < NODES; ++n) {
        const double way = static_cast<double>(n) / (NODES - 1);
        const Complex b = more[n][axis][k] - (1.0 - way) * more.front()[axis][k] - way * more.back()[axis][k];
        table.push_back(b.real());
        table.push_back(-b.imag());
      }
    }
  }
  return bend;
}

}  // namespace

std::array<double, 2> Bend::at(double order, const std::string& channel, double chip) const {
  const auto found = orders.find(order);
  const auto next = std::upper_bound(chips.begin(), chips.end(), chip);
  if (found == orders.end() || next == chips.begin() || next == chips.end()) return {{0.0, 0.0}};
  const auto n = static_cast<std::size_t>(next - chips.begin());
  const double way = (chip - chips[n - 1]) / (chips[n] - chips[n - 1]);
  const std::vector<double>& table = found->second.at(channel);
  std::array<double, 2> two{};
  for (std::size_t part = 0; part < 2; ++part)
    two[part] = (1.0 - way) * table[2 * n - 2 + part] + way * table[2 * n + part];
  return two;
}

double BentLaw::costOfALaw() const {
  constexpr double NUMBERS = 3.0;
  return NUMBERS * std::log(lines) * squares / lines;
}

std::optional<BentLaw> bentLaw(const TwinRunner& runner, const std::vector<std::size_t>& tests,
                               const MachineModel& nominal, const MachineModel& model) {
  const auto bends = [](const EffectEntry& e) {
    return e.name == "size_effect" || e.name == "edge_buildup" ||
           e.name == std::string(EMPIRICAL) + ":chip_thickness";
  };
  if (!nominal.tool || !nominal.cutting || std::any_of(model.effects.begin(), model.effects.end(), bends))
    return {};
  const auto teeth = static_cast<std::size_t>(nominal.tool->teeth);
  const std::vector<Cut> cuts = cutsOf(runner, tests, teeth);
  if (cuts.empty()) return {};
  double least = cuts.front().chip(), largest = least;
  std::size_t count = cuts.front().lines[0].size();
  for (const Cut& c : cuts) {
    least = std::min(least, c.chip());
    largest = std::max(largest, c.chip());
    count = std::min(count, c.lines[0].size());
  }
  MachineModel even = nominal;
  even.effects.clear();
  const Law law(even, cuts.front().test->test, 0.5 * (least + largest), count);
  BentLaw found;
  found.lines = static_cast<double>(cuts.size() * 3 * (2 * count - 1));
  Trials trials(cuts, law, largest, teeth);
  const Seen seen = chosenLaw(&trials, largest, &found);
  found.turned.assign(runner.tests().size(), 0.0);
  for (std::size_t i = 0; i < cuts.size(); ++i) found.turned[cuts[i].chosen] = seen.phase[i];
  if (found.bends()) found.bend = bendOf(law, model, found, seen.gains, least, largest, teeth);
  return found;
}

}  // namespace smartmill::discrepancy
