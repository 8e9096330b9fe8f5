#include "smartmill_discrepancy/data/labels.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/data/alignment.h"
#include "smartmill_discrepancy/gap/twin_runner.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

/// Limits far beyond any effect of the catalogue.
struct LabelOptions {
  double doubtful_gap = 5.0;  ///< squares over the noise above which a label is doubtful
  double swapped = 0.1;       ///< [1] of the squares: maximum after a swap of channels
  double relabelled = 0.35;   ///< [1] of the squares: maximum with another test's label
  double comparable = 1.5;    ///< [1] maximum ratio of these squares to those of the label's own test
  double small_gap = 6.0;     ///< [N2] squares of a label's own test that count as this many at least
  double unusual = 3.0;       ///< [1] minimum ratio of a cut's squares to the median of all cuts
  std::size_t min_cuts = 4;   ///< from which on a median means something
  double speed = 0.02;        ///< [1] error of a stated spindle speed
  double unit_factor = 30.0;  ///< [1] factor beyond any gain error, below that of N and kN
  double min_signal = 100.0;  ///< [1] squares over the noise from which a factor below one is known
  double inverted = 0.5;      ///< [1] minimum squared correlation with the negative model
};

const LabelOptions LIMITS;

double squaresBetween(const std::vector<double>& a, const std::vector<double>& b) {
  double s = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) s += (a[i] - b[i]) * (a[i] - b[i]);
  return s;
}

sim::SimulationOptions coarseSimulation() {
  sim::SimulationOptions options;
  options.noise = false;
  options.substeps = COARSE_SUBSTEPS;
  return options;
}

// Speed of the recorded spindle angle [rad/s].
double rotationSpeed(const TestData& t) {
  const std::vector<double>& angle = t.record.column("spindle_angle");
  return rotationOf(angle) / (static_cast<double>(angle.size() - 1) / t.test.sample_rate);
}

double forceSquares(const TestData& t, const Record& simulated) {
  double s = 0.0;
  for (const std::string& channel : FORCES) {
    if (t.record.has(channel)) s += squaresBetween(t.record.column(channel), simulated.column(channel));
  }
  return s;
}

std::vector<std::string> wrongSpeeds(const Dataset& data) {
  std::vector<std::string> wrong;
  for (const TestData& t : data.tests) {
    if (t.test.kind == TestKind::tap || t.phase_estimated || !t.record.has("spindle_angle")) continue;
    const double speed = rotationSpeed(t);
    if (std::abs(speed / t.test.spindle_speed - 1.0) <= LIMITS.speed) continue;
    wrong.push_back(formatted(
        "test %s looks mislabelled: its spindle angle advances at %.0f rpm, spindle_speed_rpm is %.0f",
        t.test.name.c_str(), units::rpmFromRadPerSec(speed), units::rpmFromRadPerSec(t.test.spindle_speed)));
  }
  return wrong;
}

// One channel of all cuts, measured and simulated.
struct Comparison {
  double product = 0.0, simulated = 0.0, measured = 0.0;  // sums over samples; the last two of squares
};

Comparison compare(const Dataset& data, const std::vector<Record>& own, const std::string& channel) {
  Comparison c;
  for (std::size_t i = 0; i < own.size(); ++i) {
    const TestData& t = data.tests[i];
    if (t.test.kind != TestKind::cut || !t.record.has(channel) || !own[i].has(channel)) continue;
    const auto &m = t.record.column(channel), &s = own[i].column(channel);
    for (std::size_t k = 0; k < m.size(); ++k) {
      c.product += m[k] * s[k];
      c.simulated += s[k] * s[k];
      c.measured += m[k] * m[k];
    }
  }
  return c;
}

// Units and signs: one factor over all records of a channel.
std::vector<std::string> wrongScales(const Dataset& data, const std::vector<Record>& own) {
  std::vector<std::string> wrong, inverted;
  for (const auto& [channel, noise] : data.noise) {
    const Comparison c = compare(data, own, channel);
    if (c.product < 0.0 && c.product * c.product > LIMITS.inverted * c.simulated * c.measured)
      inverted.push_back(channel);
    if (c.simulated <= noise * noise) continue;
    const double factor = std::abs(c.product / c.simulated);
    if (factor > LIMITS.unit_factor ||
        (factor < 1.0 / LIMITS.unit_factor &&
         c.product * c.product / c.simulated > LIMITS.min_signal * noise * noise)) {
      wrong.push_back(formatted("%s is %.3g times the simulated value in every cut: its unit looks wrong",
                                channel.c_str(), factor));
    }
  }
  if (!inverted.empty())
    wrong.push_back(joined(inverted) +
                    " have the opposite sign of the simulation: sign or force_sensor.measures looks wrong");
  return wrong;
}

// Whether swapping two force channels of a test fits the model far better.
bool looksSwapped(const Dataset& data, const TestData& t, const Record& own, const std::string& x,
                  const std::string& y) {
  if (!t.record.has(x) || !t.record.has(y)) return false;
  const double as_is =
      squaresBetween(t.record.column(x), own.column(x)) + squaresBetween(t.record.column(y), own.column(y));
  const double swap =
      squaresBetween(t.record.column(x), own.column(y)) + squaresBetween(t.record.column(y), own.column(x));
  const double floor =
      static_cast<double>(t.record.size()) * (std::pow(data.noise.at(x), 2) + std::pow(data.noise.at(y), 2));
  return as_is > LIMITS.doubtful_gap * floor && swap - floor < LIMITS.swapped * (as_is - floor);
}

std::vector<std::string> swappedChannels(const Dataset& data, const std::vector<Record>& own) {
  std::vector<std::string> wrong;
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = a + 1; b < 3; ++b) {
      std::vector<std::string> tests;
      for (std::size_t i = 0; i < own.size(); ++i) {
        const TestData& t = data.tests[i];
        if (t.test.kind != TestKind::air && looksSwapped(data, t, own[i], FORCES[a], FORCES[b]))
          tests.push_back(t.test.name);
      }
      if (!tests.empty())
        wrong.push_back(FORCES[a] + " and " + FORCES[b] + " look swapped in tests " + joined(tests));
    }
  }
  return wrong;
}

// The label of another cut that fits a record best.
struct Foreign {
  double gap = 0.0, theirs = 0.0;  // [N2] of the record with the label, and of the label's own record
  std::string name;
};

Foreign bestForeignLabel(const Dataset& data, const MachineModel& model, const std::vector<double>& gaps,
                         std::size_t of) {
  const TestData& t = data.tests[of];
  Foreign best{gaps[of], 0.0, {}};
  for (std::size_t k = 0; k < gaps.size(); ++k) {
    const TestData& other = data.tests[k];
    if (other.test.kind != TestKind::cut || other.test.name == t.test.name) continue;
    CampaignTest test = t.test;
    test.engagement = other.test.engagement;
    test.feed_direction = other.test.feed_direction;
    const double gap = forceSquares(t, sim::simulateTest(model, test, t.record, coarseSimulation())) /
                       static_cast<double>(t.record.size());
    if (gap < best.gap) best = {gap, gaps[k], other.test.name};
  }
  return best;
}

// Cuts that the label of another cut fits far better, while other cuts fit their own.
std::vector<std::string> foreignLabels(const Dataset& data, const MachineModel& model,
                                       const std::vector<Record>& own) {
  std::vector<double> gaps(own.size(), 0.0), all;
  for (std::size_t i = 0; i < own.size(); ++i) {
    if (data.tests[i].test.kind != TestKind::cut) continue;
    gaps[i] = forceSquares(data.tests[i], own[i]) / static_cast<double>(data.tests[i].record.size());
    all.push_back(gaps[i]);
  }
  if (all.size() < LIMITS.min_cuts) return {};
  const double usual = median(all);
  std::vector<std::string> doubtful;
  for (std::size_t i = 0; i < own.size(); ++i) {
    const TestData& t = data.tests[i];
    if (t.test.kind != TestKind::cut || gaps[i] < LIMITS.unusual * usual || gaps[i] < LIMITS.doubtful_gap)
      continue;
    const Foreign best = bestForeignLabel(data, model, gaps, i);
    if (best.gap < LIMITS.relabelled * gaps[i] &&
        best.gap < LIMITS.comparable * std::max(best.theirs, LIMITS.small_gap))
      doubtful.push_back("test " + t.test.name + " looks mislabelled: feed, depth or immersion of " +
                         best.name + " fit its record");
  }
  return doubtful;
}

std::vector<Record> simulated(const Dataset& data, const MachineModel& model, int threads) {
  std::vector<Record> own(data.tests.size());
  runParallel(own.size(), threads, [&](std::size_t i) {
    own[i] = sim::simulateTest(model, data.tests[i].test, data.tests[i].record, coarseSimulation());
  });
  return own;
}

bool chatters(const TestData& test) {
  return test.chatter.has_value();
}

bool anyChatters(const Dataset& data) {
  return std::any_of(data.tests.begin(), data.tests.end(), chatters);
}

// Labels of chattering cuts cannot be checked by free simulation.
Dataset withoutChatter(const Dataset& data) {
  Dataset others = data;
  others.tests.erase(std::remove_if(others.tests.begin(), others.tests.end(), chatters), others.tests.end());
  return others;
}

}  // namespace

Labels checkLabels(const Dataset& data, int threads) {
  Labels labels;
  labels.wrong = wrongSpeeds(data);
  if (!labels.wrong.empty()) return labels;
  if (anyChatters(data)) return checkLabels(withoutChatter(data), threads);
  const std::vector<Record> own = simulated(data, data.nominal, threads);
  labels.wrong = wrongScales(data, own);
  if (labels.wrong.empty()) labels.wrong = swappedChannels(data, own);
  if (labels.wrong.empty()) labels.doubtful = foreignLabels(data, data.nominal, own);
  return labels;
}

std::vector<std::string> doubtfulLabels(const MachineModel& model, const Dataset& data, int threads) {
  if (anyChatters(data)) return doubtfulLabels(model, withoutChatter(data), threads);
  return foreignLabels(data, model, simulated(data, model, threads));
}

}  // namespace smartmill::discrepancy
