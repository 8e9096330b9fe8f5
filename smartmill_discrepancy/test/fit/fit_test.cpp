#include "smartmill_discrepancy/fit/fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "air_cuts.h"
#include "explain/small_campaign.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_discrepancy/hypotheses/hypothesis.h"
#include "smartmill_discrepancy/hypotheses/nominal_freedom.h"
#include "smartmill_discrepancy/search/refinement.h"

namespace smartmill::discrepancy {
namespace {

const Hypothesis& effectOf(const std::vector<Hypothesis>& hypotheses, std::string_view effect) {
  return *std::find_if(hypotheses.begin(), hypotheses.end(),
                       [&](const Hypothesis& h) { return h.effect == effect; });
}

// Machines with random friction that their nominal models lack, and nominal values off by their stated
// uncertainty: the standard deviations of the fit are calibrated.
TEST(Fitter, DeviationsAreCalibrated) {
  std::mt19937_64 random(17);
  std::normal_distribution<double> normal;
  const MachineModel nominal = spindleOnly();
  const NominalFreedom freedom(nominal);
  std::array<Coverage, 2> coverage;
  for (int run = 0; run < Coverage::RUNS; ++run) {
    std::vector<double> off;
    for (const Coordinate& c : freedom.coordinates()) off.push_back(c.prior_std * normal(random));
    MachineModel machine = freedom.apply(nominal, off);
    const double breakaway = 0.2 + 0.02 * (run % 20), speed = 1500.0 + 100.0 * (run % 15);
    machine.effects.push_back(stribeckFriction(breakaway, speed));
    const Dataset data = airCuts(machine, nominal, random);
    const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, nullptr);
    const Hypothesis& stribeck = effectOf(hypotheses, "stribeck_friction");
    const TwinRunner runner(data, {0, 1, 2, 3, 4, 5}, 1, 1);
    const Fitter fitter(runner, freedom);
    FitState start;
    start.nominal.assign(freedom.coordinates().size(), 0.0);
    start.members.push_back({&stribeck, {0.3, std::log(2000.0)}});
    const FitResult fit = fitter.fit(start, nullptr, {30, 1e-10});
    ASSERT_TRUE(fit.converged);
    const std::vector<double>& values = fit.state.members.front().values;
    const std::vector<double> true_values{breakaway, std::log(speed)};
    for (std::size_t k = 0; k < 2; ++k) {
      const auto i = static_cast<Eigen::Index>(start.nominal.size() + k);
      coverage[k].add(values[k] - true_values[k], std::sqrt(fit.covariance(i, i)));
    }
  }
  for (const Coverage& c : coverage) EXPECT_TRUE(c.isCalibrated());
}

// Correlates the noise of air cuts: each sample contains a share of the previous one.
void correlateNoise(double share, const MachineModel& machine, Dataset* data) {
  sim::SimulationOptions quiet;
  quiet.noise = false;
  for (TestData& test : data->tests) {
    std::vector<double> simulated_state = test.record.column("load_meter");
    const std::vector<double> clean =
        sim::simulateTest(machine, test.test, test.record, quiet).column("load_meter");
    double correlated =
        (simulated_state[0] - clean[0]) * (1.0 / std::sqrt(1.0 - share * share) - 1.0) / share;
    for (std::size_t i = 0; i < simulated_state.size(); ++i) {
      correlated = share * correlated + simulated_state[i] - clean[i];
      simulated_state[i] = clean[i] + correlated;
    }
    test.record.add("load_meter") = simulated_state;
  }
}

// Without whitening the standard deviations of slow values are too small by the root of (1 + share) / (1 -
// share), three here; whitened by the residual of a first fit they are calibrated.
TEST(Fitter, DeviationsAreCalibratedWithCorrelatedNoise) {
  constexpr double SHARE = 0.8;
  std::mt19937_64 random(23);
  const MachineModel nominal = spindleOnly();
  MachineModel certain = nominal;
  certain.uncertainty.spindle = 0.0;
  const NominalFreedom freedom(certain);  // without nominal values
  MachineModel machine = nominal;
  machine.effects.push_back(stribeckFriction(0.4, 2500.0));
  Coverage unweighted, whitened;
  for (int run = 0; run < Coverage::RUNS; ++run) {
    Dataset data = airCuts(machine, nominal, random);
    correlateNoise(SHARE, machine, &data);
    const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, nullptr);
    const Hypothesis& stribeck = effectOf(hypotheses, "stribeck_friction");
    TwinRunner runner(data, {0, 1, 2, 3, 4, 5}, 1, 1);
    const Fitter fitter(runner, freedom);
    const FitOptions options{30, 1e-10};
    const FitState start{
        std::vector<double>(freedom.coordinates().size(), 0.0), {{&stribeck, {0.4, std::log(2500.0)}}}, {}};
    const FitResult first = fitter.fit(start, nullptr, options);
    ASSERT_TRUE(first.converged);
    std::vector<Whitening> whitening;
    for (const ChannelSpan& b : runner.spans()) whitening.emplace_back(&first.residual[b.offset], b.size);
    runner.setWhitening(whitening);
    const FitResult fit = fitter.fit(first.state, nullptr, options);
    ASSERT_TRUE(fit.converged);
    EXPECT_NEAR(fit.chi2 / static_cast<double>(runner.size()), 1.0, 0.2);
    unweighted.add(first.state.members[0].values[0] - 0.4, std::sqrt(first.covariance(0, 0)));
    whitened.add(fit.state.members[0].values[0] - 0.4, std::sqrt(fit.covariance(0, 0)));
  }
  EXPECT_GT(unweighted.rms(), 2.0);
  EXPECT_TRUE(whitened.isCalibrated());
}

// Half the prior standard deviation equals four times the prior weight.
TEST(Fitter, PriorWeightScalesTheSquares) {
  std::mt19937_64 random(3);
  const MachineModel nominal = spindleOnly();
  MachineModel surer = nominal, machine = nominal;
  surer.uncertainty.spindle *= 0.5;
  machine.spindle->coulomb *= 1.1;
  const Dataset data = airCuts(machine, nominal, random);
  const TwinRunner runner(data, {0, 1, 2, 3, 4, 5}, 1, 1);
  const NominalFreedom freedom(nominal), sure_freedom(surer);
  const FitState start{std::vector<double>(freedom.coordinates().size(), 0.0), {}, {}};
  FitOptions weighted{30, 1e-12};
  weighted.prior_weight = 4.0;
  const FitResult a = Fitter(runner, freedom).fit(start, nullptr, weighted);
  const FitResult b = Fitter(runner, sure_freedom).fit(start, nullptr, {30, 1e-12});
  for (std::size_t c = 0; c < start.nominal.size(); ++c)
    EXPECT_NEAR(a.state.nominal[c], b.state.nominal[c], 1e-4) << freedom.coordinates()[c].name;
  EXPECT_NEAR(a.bic, b.bic, 1e-3 * b.bic);
}

// State, residual and chi2 of a fit belong together, also after a rejected step.
TEST(Fitter, ResidualBelongsToTheState) {
  std::mt19937_64 random(11);
  const MachineModel nominal = spindleOnly();
  MachineModel machine = nominal;
  machine.effects.push_back(stribeckFriction(0.4, 2500.0));
  const Dataset data = airCuts(machine, nominal, random);
  const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, nullptr);
  const TwinRunner runner(data, {0, 1, 2, 3, 4, 5}, 1, 1);
  const NominalFreedom freedom(nominal);
  const Fitter fitter(runner, freedom);
  const FitState at_nominal{std::vector<double>(freedom.coordinates().size(), 0.0), {}, {}};
  const NominalTangents tangents = fitter.nominalTangents(at_nominal);
  for (const Hypothesis& h : hypotheses) {
    if (h.effect != "stribeck_friction" && h.effect != "load_meter_lag") continue;
    for (const int iterations : {1, 2, 3, 5, 8}) {
      FitState start = at_nominal;
      start.members.push_back({&h, h.probes.front().points.front()});
      const FitResult fit = fitter.fit(start, nullptr, {iterations, 1e-9});
      const double left = residualSquares(runner, runner.simulate(fitter.model(fit.state)));
      EXPECT_NEAR(fit.chi2, left, 1e-9 * left) << h.title() << " after " << iterations;
      // Frozen derivatives are relative to the state at which they were computed.
      const FitResult along = fitter.fit(start, &tangents, {iterations, 1e-9});
      FitState simulated_state = along.state;
      simulated_state.nominal = at_nominal.nominal;
      Eigen::VectorXd there = Eigen::Map<const Eigen::VectorXd>(runner.measured().data(), runner.size());
      const std::vector<double> simulated = runner.simulate(fitter.model(simulated_state));
      there -= Eigen::Map<const Eigen::VectorXd>(simulated.data(), there.size());
      const Eigen::VectorXd shift = -Eigen::Map<const Eigen::VectorXd>(
          along.state.nominal.data(), static_cast<Eigen::Index>(along.state.nominal.size()));
      tangents.columns.addTo(shift, &there);
      EXPECT_NEAR(along.chi2, there.squaredNorm(), 1e-6 * along.chi2) << h.title() << " after " << iterations;
    }
  }
}

// Friction far beyond its stated uncertainty pushes nominal values to their bounds: every start ends at the
// same point.
TEST(Fitter, EndsAtOnePointWithValuesAtTheirBounds) {
  std::mt19937_64 random(29);
  const MachineModel nominal = spindleOnly();
  MachineModel machine = nominal;
  machine.spindle->coulomb *= 3.0;
  machine.effects.push_back(stribeckFriction(0.4, 2500.0));
  const Dataset data = airCuts(machine, nominal, random);
  const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, nullptr);
  const Hypothesis& stribeck = effectOf(hypotheses, "stribeck_friction");
  const TwinRunner runner(data, {0, 1, 2, 3, 4, 5}, 1, 1);
  const NominalFreedom freedom(nominal);
  const Fitter fitter(runner, freedom);
  const FitState at_nominal{std::vector<double>(freedom.coordinates().size(), 0.0), {}, {}};
  const NominalTangents tangents = fitter.nominalTangents(at_nominal);
  std::vector<FitResult> fits;
  for (const double breakaway : {0.35, 0.8}) {
    for (const double speed : {1500.0, 5000.0}) {
      FitState start = at_nominal;
      start.members.push_back({&stribeck, {breakaway, std::log(speed)}});
      fits.push_back(fitter.fit(start, &tangents, {8, 1e-6}));
      ASSERT_TRUE(fits.back().converged);
    }
  }
  const FitResult& first = fits.front();
  bool at_bound = false;
  for (std::size_t c = 0; c < first.state.nominal.size(); ++c) {
    const Coordinate& k = freedom.coordinates()[c];
    at_bound = at_bound || first.state.nominal[c] == k.high || first.state.nominal[c] == k.low;
  }
  EXPECT_TRUE(at_bound);
  for (const FitResult& fit : fits) {
    EXPECT_NEAR(fit.chi2 + fit.penalty, first.chi2 + first.penalty, 1e-5 * first.chi2);
    for (std::size_t k = 0; k < 2; ++k) {
      const auto i = static_cast<Eigen::Index>(at_nominal.nominal.size() + k);
      EXPECT_NEAR(fit.state.members[0].values[k], first.state.members[0].values[k],
                  std::sqrt(first.covariance(i, i)));
    }
  }
}

MachineModel slenderTool() {
  MachineModel m = mill();
  m.tool_tip.x.modes = {{1100.0, 0.03, 1.0 / 25e6}};
  m.tool_tip.y.modes = {{900.0, 0.04, 1.0 / 30e6}};
  m.force_sensor.noise_rms = {{1.0, 1.0, 1.0}};
  m.uncertainty = {3.0, 0.0, 0.0, 0.0, 0.0};
  return m;
}

// A slot of little more than a revolution, with one tool vibration while a tooth advances by D / R.
Dataset slowSlot(const MachineModel& machine, const MachineModel& nominal, std::mt19937_64& random) {
  TestData t;
  t.test.name = "slot";
  t.test.kind = TestKind::cut;
  t.test.sample_rate = 12800.0;
  t.test.spindle_speed = units::radPerSecFromRpm(1200.0);
  t.test.engagement = Engagement{0.0, units::PI, 1e-3, 0.2e-3};
  sim::SimulationOptions options;
  options.seed = random();
  options.substeps = 2;
  t.record = sim::simulateTest(machine, t.test, 0.06, options);
  t.channels = {"fx", "fy"};
  t.quiet = t.first_cut = 0;
  Dataset data;
  data.nominal = nominal;
  for (std::size_t a = 0; a < 2; ++a) data.noise[t.channels[a]] = machine.force_sensor.noise_rms->at(a);
  data.tests.push_back(std::move(t));
  return data;
}

// Machines between surface rule and true tooth path: the share is estimated with calibrated uncertainty.
TEST(Fitter, EstimatesThePathShare) {
  std::mt19937_64 random(31);
  std::normal_distribution<double> normal;
  const MachineModel nominal = slenderTool();
  const NominalFreedom freedom(nominal);
  const std::size_t share = freedom.coordinates().size() - 1;
  Coverage coverage;
  for (int run = 0; run < Coverage::RUNS; ++run) {
    std::vector<double> off;
    for (const Coordinate& c : freedom.coordinates()) off.push_back(c.prior_std * normal(random));
    off[share] = 0.1 * (run % 11);
    const Dataset data = slowSlot(freedom.apply(nominal, off), nominal, random);
    const TwinRunner runner(data, {0}, 1, 2);
    const Fitter fitter(runner, freedom);
    const FitResult fit = fitter.fit({std::vector<double>(off.size(), 0.0), {}, {}}, nullptr, {30, 1e-8});
    ASSERT_TRUE(fit.converged);
    const auto i = static_cast<Eigen::Index>(share);
    coverage.add(fit.state.nominal[share] - off[share], std::sqrt(fit.covariance(i, i)));
    ASSERT_LT(std::sqrt(fit.covariance(i, i)), 0.1);
  }
  EXPECT_TRUE(coverage.isCalibrated());
}

// The path share is written as an entry if it is significant.
TEST(NominalFreedom, WritesAndRemovesThePathShare) {
  MachineModel nominal = slenderTool();
  const NominalFreedom freedom(nominal);
  ASSERT_EQ(freedom.coordinates().back().name, "tool.path_share");
  std::vector<double> values(freedom.coordinates().size(), 0.0), std_devs(values.size(), 0.01);
  EXPECT_EQ(toothPathOf(freedom.apply(nominal, values)), nullptr);
  values.back() = 0.7;
  MachineModel model = freedom.apply(nominal, values);
  EXPECT_NEAR(toothPathOf(model)->numbers.at("share"), 0.7, 1e-12);
  std_devs.back() = 0.2;
  freedom.writeStdDevs(model, std_devs);
  ASSERT_NE(toothPathOf(model), nullptr);
  EXPECT_EQ(toothPathOf(model)->std_devs.at("share"), 0.2);
  std_devs.back() = 0.3;
  freedom.writeStdDevs(model, std_devs);
  EXPECT_EQ(toothPathOf(model), nullptr);
  // Away from the true path: no machine does this, scatter does.
  values.back() = -0.7;
  model = freedom.apply(nominal, values);
  std_devs.back() = 0.2;
  freedom.writeStdDevs(model, std_devs);
  EXPECT_EQ(toothPathOf(model), nullptr);
  values.back() = 0.7;
  // A new fit adds to an existing share.
  nominal.effects = {effectEntry("empirical:tooth_path", {{"share", 0.2}})};
  model = NominalFreedom(nominal).apply(nominal, values);
  EXPECT_EQ(model.effects.size(), 1u);
  EXPECT_NEAR(toothPathOf(model)->numbers.at("share"), 0.9, 1e-12);
  // An insignificant share is set to zero, and the other values move to their conditional optimum.
  FitResult fit;
  fit.state.nominal.assign(freedom.coordinates().size(), 0.0);
  fit.state.nominal.front() = 0.01;
  fit.state.nominal.back() = 0.2;
  const auto count = static_cast<Eigen::Index>(fit.state.nominal.size());
  fit.covariance = 0.25 * Eigen::MatrixXd::Identity(count, count);
  Eigen::MatrixXd of_fit = 0.04 * Eigen::MatrixXd::Identity(count, count);
  of_fit(0, count - 1) = of_fit(count - 1, 0) = 0.002;
  FitResult kept_fit = fit;
  kept_fit.covariance = of_fit / 16.0;
  dropInsignificantPathShare(nominal, freedom, of_fit, &kept_fit);
  EXPECT_EQ(kept_fit.state, fit.state);
  dropInsignificantPathShare(nominal, freedom, of_fit, &fit);
  EXPECT_EQ(fit.state.nominal.back(), -0.2);
  EXPECT_NEAR(fit.state.nominal.front(), 0.01 - 0.4 * 0.05, 1e-12);
  EXPECT_NEAR(toothPathOf(freedom.apply(nominal, fit.state.nominal))->numbers.at("share"), 0.0, 1e-15);
  // No tool, no path share.
  nominal.tool.reset();
  const NominalFreedom none(nominal);
  for (const Coordinate& c : none.coordinates()) EXPECT_NE(c.name, "tool.path_share");
}

// BIC gain of a hum. @param amplitude [N] of the machine's hum
double gainOfHum(double amplitude) {
  const TemporaryFolder folder;
  MachineModel machine = believed();
  if (amplitude > 0.0)
    machine.effects.push_back(
        effectEntry("mains_hum", {{"frequency_hz", 50.0}, {"amplitude_n", amplitude}, {"y_ratio", 0.6}}));
  const auto record = [&](const CampaignTest& test, std::uint64_t seed) {
    sim::SimulationOptions options;
    options.seed = seed;
    options.random_phases = true;
    return sim::simulateTest(machine, test, 0.2, options);
  };
  const Dataset data = datasetOf(record, folder.file("."));
  const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, nullptr);
  const auto hum = std::find_if(hypotheses.begin(), hypotheses.end(), [](const Hypothesis& h) {
    return h.effect == "mains_hum" && h.variant == "50 Hz";
  });
  const TwinRunner runner(data, {0, 1, 2, 3, 4, 5, 6, 7}, 1, 1);
  const NominalFreedom freedom(data.nominal);
  const Fitter fitter(runner, freedom);
  FitState start;
  start.nominal.assign(freedom.coordinates().size(), 0.0);
  const FitResult without_it = fitter.fit(start, nullptr, {30, 1e-10});
  start.members.push_back({&*hum, {0.5, 0.6}});
  const FitResult with = fitter.fit(start, nullptr, {30, 1e-10});
  EXPECT_TRUE(with.converged && without_it.converged);
  return without_it.bic - with.bic;
}

// The phase of a hum is estimated in each record, so noise alone fits a positive amplitude.
TEST(Fitter, NoiseAloneIsNoHum) {
  EXPECT_LT(gainOfHum(0.0), -20.0);
  EXPECT_GT(gainOfHum(2.0), 200.0);
}

}  // namespace
}  // namespace smartmill::discrepancy
