#include "smartmill_discrepancy/fit/fit.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"
#include "smartmill_discrepancy/hypotheses/hypothesis.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

constexpr double NOISE = 2.2e-4;  // [V]

MachineModel spindleOnly() {
  MachineModel m;
  Spindle s;
  s.viscous = 4.1e-4;
  s.coulomb = 0.05;
  s.load_meter_gain = 3.88e-4;
  s.load_meter_bandwidth = 7.0;
  m.spindle = s;
  return m;
}

// Air cuts of a machine, load meter only.
Dataset airCuts(const MachineModel& machine, const MachineModel& nominal, std::mt19937_64& random) {
  std::normal_distribution<double> noise(0.0, NOISE);
  Dataset data;
  data.nominal = nominal;
  data.noise["load_meter"] = NOISE;
  sim::SimulationOptions quiet;
  quiet.noise = false;
  for (const double rpm : {600.0, 1000.0, 2000.0, 3000.0, 6000.0, 12000.0}) {
    TestData t;
    t.test.name = "air_" + std::to_string(static_cast<int>(rpm));
    t.test.kind = TestKind::air;
    t.test.sample_rate = 2000.0;
    t.test.spindle_speed = units::radPerSecFromRpm(rpm);
    t.test.start_time = 0.0;
    t.channels = {"load_meter"};
    std::vector<double> angle, blank;
    for (int i = 0; i < 300; ++i) {
      t.record.time.push_back(i / t.test.sample_rate);
      angle.push_back(std::fmod(t.test.spindle_speed * t.record.time.back(), units::TWO_PI));
      blank.push_back(0.0);
    }
    t.record.add("spindle_angle") = angle;
    t.record.add("load_meter") = blank;
    std::vector<double> shown = sim::simulateTest(machine, t.test, t.record, quiet).column("load_meter");
    for (double& v : shown) v += noise(random);
    t.record.add("load_meter") = shown;
    t.quiet = t.first_cut = t.record.size();
    data.tests.push_back(std::move(t));
  }
  return data;
}

// Machines drawn with friction that their nominal models lack, nominal values off by what is stated of them:
// the fit's standard deviations tell how far it is from the truth.
TEST(Fitter, standardDeviationsAreHonest) {
  constexpr int RUNS = 100;
  std::mt19937_64 random(17);
  std::normal_distribution<double> normal;
  const MachineModel nominal = spindleOnly();
  const NominalFreedom freedom(nominal);
  int inside = 0, all = 0;
  double squares = 0.0;
  for (int run = 0; run < RUNS; ++run) {
    std::vector<double> off;
    for (const Coordinate& c : freedom.coordinates()) off.push_back(c.prior_std * normal(random));
    MachineModel machine = freedom.apply(nominal, off);
    const double breakaway = 0.2 + 0.02 * (run % 20), speed = 1500.0 + 100.0 * (run % 15);
    EffectEntry truth;
    truth.name = "stribeck_friction";
    truth.numbers = {{"breakaway_nm", breakaway}, {"speed_rpm", speed}};
    machine.effects.push_back(truth);
    const Dataset data = airCuts(machine, nominal, random);
    const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, nullptr);
    const auto stribeck = std::find_if(hypotheses.begin(), hypotheses.end(),
                                       [](const Hypothesis& h) { return h.effect == "stribeck_friction"; });
    ASSERT_NE(stribeck, hypotheses.end());
    const TwinRunner runner(data, {0, 1, 2, 3, 4, 5}, 1, 1);
    const Fitter fitter(runner, freedom);
    FitState start;
    start.nominal.assign(freedom.coordinates().size(), 0.0);
    start.members.push_back({&*stribeck, {0.3, std::log(2000.0)}});
    const Fit fit = fitter.fit(start, nullptr, {30, 1e-10, true});
    ASSERT_TRUE(fit.converged);
    const std::vector<double>& values = fit.state.members.front().values;
    const std::vector<double> true_values{breakaway, std::log(speed)};
    for (std::size_t k = 0; k < 2; ++k) {
      const auto i = static_cast<Eigen::Index>(start.nominal.size() + k);
      const double z = (values[k] - true_values[k]) / std::sqrt(fit.covariance(i, i));
      inside += std::abs(z) < 1.96;
      squares += z * z;
      ++all;
    }
  }
  // 200 numbers, 95 % of them inside: three standard deviations of that count are 4.6 %.
  EXPECT_NEAR(inside, 0.95 * all, 0.046 * all);
  EXPECT_NEAR(squares / all, 1.0, 0.3);
}

// A prior stated twice as sure counts four times: the weight is that of its squares.
TEST(Fitter, priorWeightIsThatOfItsSquares) {
  std::mt19937_64 random(3);
  const MachineModel nominal = spindleOnly();
  MachineModel surer = nominal, machine = nominal;
  surer.uncertainty.spindle *= 0.5;
  machine.spindle->coulomb *= 1.1;
  const Dataset data = airCuts(machine, nominal, random);
  const TwinRunner runner(data, {0, 1, 2, 3, 4, 5}, 1, 1);
  const NominalFreedom freedom(nominal), sure_freedom(surer);
  const FitState start{std::vector<double>(freedom.coordinates().size(), 0.0), {}};
  FitOptions weighted{30, 1e-12, true};
  weighted.prior_weight = 4.0;
  const Fit a = Fitter(runner, freedom).fit(start, nullptr, weighted);
  const Fit b = Fitter(runner, sure_freedom).fit(start, nullptr, {30, 1e-12, true});
  for (std::size_t c = 0; c < start.nominal.size(); ++c)
    EXPECT_NEAR(a.state.nominal[c], b.state.nominal[c], 1e-4) << freedom.coordinates()[c].name;
  EXPECT_NEAR(a.bic, b.bic, 1e-3 * b.bic);
}

}  // namespace
}  // namespace smartmill::discrepancy
