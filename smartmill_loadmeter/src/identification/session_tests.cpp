// Identification from the tests of a session: identification.h.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "load_estimator.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/calibration/friction_law.h"
#include "smartmill_loadmeter/identification/identification.h"

namespace smartmill::loadmeter {

namespace {

// One resolution for all tests, because a test whose readings are on few steps does not show it.
void computeMeans(std::vector<LoadTest>* air_cuts, std::vector<LoadTest>* cuts, const Spindle& spindle) {
  std::vector<double> voltages;
  for (const auto* tests : {air_cuts, cuts}) {
    for (const LoadTest& t : *tests) voltages.insert(voltages.end(), t.voltages.begin(), t.voltages.end());
  }
  const double step = resolutionOf(voltages, spindle.load_meter_resolution);
  for (auto* tests : {air_cuts, cuts}) {
    for (LoadTest& t : *tests) {
      if (t.voltages.size() >= 2) t.computeMean(spindle, step);
    }
  }
}

// Mean conditions of the cuts, from which the database measures distances.
void addConditions(const std::vector<LoadTest>& cuts, CoefficientRecord* record) {
  const CuttingCondition& first = cuts.front().condition;
  record->teeth = first.tool.teeth;
  record->diameter = first.tool.diameter;
  record->helix = first.tool.helix;
  record->cutting_speed = record->feed_per_tooth = record->axial_depth = record->entry = record->exit = 0.0;
  const double share = 1.0 / static_cast<double>(cuts.size());
  for (const LoadTest& test : cuts) {
    const Engagement& e = test.condition.engagement;
    record->cutting_speed += share * test.speed * test.condition.tool.radius();
    record->feed_per_tooth += share * e.feed_per_tooth;
    record->axial_depth += share * e.axial_depth;
    record->entry += share * e.entry;
    record->exit += share * e.exit;
    record->set.stamp = std::max(record->set.stamp, test.stamp);
    record->set.tool = test.condition.tool_name;
    record->set.material = test.condition.material;
  }
}

// Air cuts and cuts as records in the order of time; the edge ages with each cut.
std::vector<LoadRecord> recordsOf(const std::vector<LoadTest>& air_cuts, const std::vector<LoadTest>& cuts,
                                  const Spindle& spindle, double noise) {
  struct Entry {
    const LoadTest* test;
    bool cut;
  };
  std::vector<Entry> entries;
  for (const LoadTest& test : air_cuts) entries.push_back({&test, false});
  for (const LoadTest& test : cuts) entries.push_back({&test, true});
  std::stable_sort(entries.begin(), entries.end(),
                   [](const Entry& a, const Entry& b) { return a.test->stamp < b.test->stamp; });
  std::vector<LoadRecord> records;
  std::map<std::string, double> age;
  for (const auto& [test, cut] : entries) {
    double& edge = age[test->condition.tool_name];
    records.push_back(
        loadRecord(*test, cut, spindle, noise, entries.front().test->stamp, edge + 0.5 * test->duration));
    if (cut) edge += test->duration;
  }
  return records;
}

std::string descriptionOf(const LoadRecordResult& found) {
  std::string text;
  for (const std::string& term : found.terms) text += "; with " + term;
  if (found.runout > 0.0) {
    text += formatted("; runout of %.1f um", found.runout / units::UM);
  }
  for (const std::string& note : found.notes) text += "; " + note;
  return text;
}

}  // namespace

double resolutionOf(const std::vector<double>& readings, double resolution) {
  std::vector<double> sorted = readings;
  std::sort(sorted.begin(), sorted.end());
  double smallest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    const double difference = sorted[i] - sorted[i - 1];
    if (difference > 1e-9 * std::abs(sorted[i])) smallest = std::min(smallest, difference);
  }
  return std::isfinite(smallest) ? std::max(smallest, resolution) : resolution;
}

void LoadTest::computeMean(const Spindle& spindle, double step) {
  const double interval = duration / static_cast<double>(voltages.size() - 1);
  voltage = meanVoltage(voltages, interval, timeConstant(spindle.load_meter_bandwidth), step);
}

double LoadTest::variance() const {
  return voltages.size() < 2 ? 0.0 : std::pow(standardDeviation(voltages), 2);
}

// T = V / (K omega): relative errors add up.
double LoadTest::torqueStdAsVoltage() const {
  return std::hypot(voltage.std_dev, voltage.mean * speed_std / speed);
}

IdleTorque idleTorque(const std::vector<LoadTest>& air_cuts, const Spindle& spindle,
                      double spindle_uncertainty_percent) {
  IdleTorque idle;
  Friction friction = modelFriction(spindle, spindle_uncertainty_percent);
  if (!air_cuts.empty()) {
    std::vector<AirCut> air;
    std::vector<TimedAirCut> timed;
    double first = air_cuts.front().stamp;
    for (const LoadTest& test : air_cuts) first = std::min(first, test.stamp);
    bool weighted = true;
    for (const LoadTest& test : air_cuts) {
      air.push_back({test.speed, test.voltage.mean, test.torqueStdAsVoltage()});
      timed.push_back({air.back(), test.stamp - first});
      weighted = weighted && air.back().voltage_std > 0.0;
    }
    friction = fitFriction(air, spindle.load_meter_gain, spindle.friction_zero_below);
    idle.viscous = friction.viscous;
    idle.coulomb = friction.coulomb;
    if (weighted && air.size() > FrictionTerms{true, false}.unknowns()) {
      const FittedFriction best =
          fitFrictionLaws(timed, spindle.load_meter_gain, spindle.friction_zero_below).front();
      if (best.terms.unknowns() > 2) {
        idle.viscous = best.law.viscous;
        idle.coulomb = best.law.coulomb;
        idle.unknowns = best.terms.unknowns();
        idle.covariance = best.covariance;
        idle.torque = [best, first](const LoadTest& t) { return best.law.torque(t.speed, t.stamp - first); };
        idle.gradient = [best, first](const LoadTest& t) {
          std::vector<double> slope;
          for (std::size_t i = 0; i < best.value.size(); ++i) {
            std::vector<double> v = best.value;
            const double step = 1e-5 * (std::abs(v[i]) + 1e-6);
            const auto at = [&](double value) {
              v[i] = value;
              return frictionLaw(best.terms, v.data(), best.law.zero_below)
                  .torque(t.speed, t.stamp - first);
            };
            slope.push_back((at(best.value[i] + step) - at(best.value[i] - step)) / (2.0 * step));
          }
          return slope;
        };
        return idle;
      }
    }
  }
  idle.unknowns = 2;
  idle.covariance.assign(friction.covariance.begin(), friction.covariance.end());
  idle.torque = [friction](const LoadTest& t) { return friction.at(t.speed); };
  idle.gradient = [friction](const LoadTest& t) {
    const std::array<double, 2> g = friction.gradient(t.speed);
    return std::vector<double>{g[0], g[1]};
  };
  return idle;
}

SessionResult identifyFromTests(std::vector<LoadTest> air_cuts, std::vector<LoadTest> cuts,
                                const Spindle& spindle, double spindle_uncertainty_percent,
                                double largest_runout) {
  computeMeans(&air_cuts, &cuts, spindle);
  double noise2 = 0.0;
  for (const auto* tests : {&air_cuts, &cuts}) {
    for (const LoadTest& t : *tests) noise2 += std::pow(t.torqueStdAsVoltage(), 2);
  }
  const double noise = std::sqrt(noise2 / std::max(1.0, static_cast<double>(air_cuts.size() + cuts.size())));
  LoadRecordOptions options;
  options.runout_uncertainty = largest_runout / std::sqrt(3.0);
  LoadEstimator estimator(recordsOf(air_cuts, cuts, spindle, noise), spindle, spindle_uncertainty_percent,
                          options, noise, true, "");
  const LoadRecordResult found = estimator.estimate();
  SessionResult result;
  result.record.set = found.set;
  addConditions(cuts, &result.record);
  const auto index = CoefficientRecord::covarianceIndex;
  result.record.covariance[index(0, 0)] = found.set.std_dev.ktc * found.set.std_dev.ktc;
  result.record.covariance[index(0, 3)] = found.covariance_tc_te;
  result.record.covariance[index(3, 3)] = found.set.std_dev.kte * found.set.std_dev.kte;
  result.found = descriptionOf(found);
  return result;
}

}  // namespace smartmill::loadmeter
