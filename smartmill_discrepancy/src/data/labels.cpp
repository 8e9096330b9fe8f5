#include "smartmill_discrepancy/data/labels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/gap/twin_runner.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

constexpr double FAR = 5.0;      // gap beyond which a label is doubted
constexpr double SWAPPED = 0.1;  // share of the squares that a swap leaves
constexpr double RELABELLED =
    0.35;  // the same with another test's label, when it then fits as well as that test does
constexpr double AS_WELL = 1.5;
constexpr double SPEED_TOLERANCE = 0.02;
constexpr double UNIT = 30.0;  // factor that no gain error reaches
constexpr double ALIKE = 0.5;  // squared correlation of a channel with the model's, turned about

double squaresBetween(const std::vector<double>& a, const std::vector<double>& b) {
  double s = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) s += (a[i] - b[i]) * (a[i] - b[i]);
  return s;
}

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& n : names) text += (text.empty() ? "" : ", ") + n;
  return text;
}

// Speed at which the recorded angle turns [rad/s].
double turningSpeed(const TestData& t) {
  const std::vector<double>& angle = t.record.column("spindle_angle");
  double turned = 0.0;
  for (std::size_t i = 1; i < angle.size(); ++i)
    turned += std::remainder(angle[i] - angle[i - 1], units::TWO_PI);
  return turned / (static_cast<double>(angle.size() - 1) / t.test.sample_rate);
}

double forceSquares(const TestData& t, const Record& simulated) {
  double s = 0.0;
  for (const std::string& channel : FORCES) {
    if (t.record.has(channel)) s += squaresBetween(t.record.column(channel), simulated.column(channel));
  }
  return s;
}

}  // namespace

Labels checkLabels(const Dataset& data, int threads) {
  Labels labels;
  std::vector<std::string>& wrong = labels.wrong;
  char line[300];
  for (const TestData& t : data.tests) {
    if (t.test.kind == TestKind::tap || t.phase_estimated || !t.record.has("spindle_angle")) continue;
    const double speed = turningSpeed(t);
    if (std::abs(speed / t.test.spindle_speed - 1.0) > SPEED_TOLERANCE) {
      std::snprintf(line, sizeof line,
                    "test %s looks mislabelled: its spindle turns at %.0f rpm, spindle_speed_rpm says %.0f",
                    t.test.name.c_str(), units::rpmFromRadPerSec(speed),
                    units::rpmFromRadPerSec(t.test.spindle_speed));
      wrong.push_back(line);
    }
  }
  if (!wrong.empty()) return labels;

  const std::size_t count = data.tests.size();
  sim::SimulationOptions options;
  options.noise = false;
  options.substeps = 2;
  std::vector<Record> own(count);
  runParallel(count, threads, [&](std::size_t i) {
    own[i] = sim::simulateTest(data.nominal, data.tests[i].test, data.tests[i].record, options);
  });

  // Units and signs: one factor over all records of a channel.
  std::vector<std::string> turned;
  for (const auto& [channel, noise] : data.noise) {
    double product = 0.0, square = 0.0, measured = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      if (data.tests[i].test.kind != TestKind::cut || !data.tests[i].record.has(channel) ||
          !own[i].has(channel))
        continue;
      const auto &m = data.tests[i].record.column(channel), &s = own[i].column(channel);
      for (std::size_t k = 0; k < m.size(); ++k) {
        product += m[k] * s[k];
        square += s[k] * s[k];
        measured += m[k] * m[k];
      }
    }
    if (product < 0.0 && product * product > ALIKE * square * measured) turned.push_back(channel);
    if (square <= noise * noise) continue;
    const double factor = std::abs(product / square);
    if (factor > UNIT || (factor < 1.0 / UNIT && product * product / square > 100.0 * noise * noise)) {
      std::snprintf(line, sizeof line,
                    "%s reads %.3g times what the model says in every cut: its unit looks wrong",
                    channel.c_str(), factor);
      wrong.push_back(line);
    }
  }
  if (!turned.empty())
    wrong.push_back(joined(turned) +
                    " read minus what the model says: sign or force_sensor.measures looks wrong");
  if (!wrong.empty()) return labels;

  // Swapped channels.
  std::map<std::pair<std::size_t, std::size_t>, std::vector<std::string>> swapped;
  std::vector<bool> doubted(count, false);
  for (std::size_t i = 0; i < count; ++i) {
    const TestData& t = data.tests[i];
    if (t.test.kind == TestKind::air) continue;
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t b = a + 1; b < 3; ++b) {
        const std::string &x = FORCES[a], &y = FORCES[b];
        if (!t.record.has(x) || !t.record.has(y)) continue;
        const double as_is = squaresBetween(t.record.column(x), own[i].column(x)) +
                             squaresBetween(t.record.column(y), own[i].column(y));
        const double swap = squaresBetween(t.record.column(x), own[i].column(y)) +
                            squaresBetween(t.record.column(y), own[i].column(x));
        const double floor = static_cast<double>(t.record.size()) *
                             (std::pow(data.noise.at(x), 2) + std::pow(data.noise.at(y), 2));
        if (as_is > FAR * floor && swap - floor < SWAPPED * (as_is - floor)) {
          swapped[{a, b}].push_back(t.test.name);
          doubted[i] = true;
        }
      }
    }
  }
  for (const auto& [pair, tests] : swapped)
    wrong.push_back(FORCES[pair.first] + " and " + FORCES[pair.second] + " look swapped in tests " +
                    joined(tests));
  if (!wrong.empty()) return labels;

  // A cut that another cut's label fits far better than its own, while the others fit theirs.
  std::vector<double> gaps(count, 0.0), all;
  for (std::size_t i = 0; i < count; ++i) {
    if (data.tests[i].test.kind != TestKind::cut) continue;
    gaps[i] = forceSquares(data.tests[i], own[i]) / static_cast<double>(data.tests[i].record.size());
    all.push_back(gaps[i]);
  }
  if (all.size() < 4) return labels;
  const double usual = median(all);
  for (std::size_t i = 0; i < count; ++i) {
    const TestData& t = data.tests[i];
    if (t.test.kind != TestKind::cut || gaps[i] < 3.0 * usual || gaps[i] < FAR) continue;
    double best = gaps[i], theirs = 0.0;
    std::string name;
    for (std::size_t k = 0; k < count; ++k) {
      const TestData& other = data.tests[k];
      if (other.test.kind != TestKind::cut || other.test.name == t.test.name) continue;
      CampaignTest test = t.test;
      test.engagement = other.test.engagement;
      const double gap = forceSquares(t, sim::simulateTest(data.nominal, test, t.record, options)) /
                         static_cast<double>(t.record.size());
      if (gap < best) {
        best = gap;
        theirs = gaps[k];
        name = other.test.name;
      }
    }
    if (best < RELABELLED * gaps[i] && best < AS_WELL * std::max(theirs, 6.0))
      labels.doubtful.push_back("test " + t.test.name + " looks mislabelled: feed, depth or immersion of " +
                                name + " fit its record");
  }
  return labels;
}

}  // namespace smartmill::discrepancy
