#include "smartmill_discrepancy/search/screening.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "explain/small_campaign.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_discrepancy/hypotheses/hypothesis.h"
#include "smartmill_discrepancy/search/start_values.h"

namespace smartmill::discrepancy {
namespace {

// Slots of a machine whose fz reads 20 % too much: in cuts the axial coefficients replace it within their
// stated uncertainty.
Dataset axialGain(const std::string& folder) {
  MachineModel machine = believed();
  machine.effects = {effectEntry("gain_error", {{"gain", 1.2}}, {{"channel", "fz"}})};
  return datasetOf(
      [&](const CampaignTest& test, std::uint64_t seed) {
        sim::SimulationOptions options;
        options.seed = seed;
        return sim::simulateTest(machine, test, 0.1, options);
      },
      folder);
}

// A value at its bound moves back when the effect that pushed it there is added: the predicted gain is that
// of the fit.
TEST(Screening, PredictsTheGainOfAValueAtItsBound) {
  const TemporaryFolder folder;
  const Dataset data = axialGain(folder.file("."));
  const NominalFreedom freedom(data.nominal);
  const TwinRunner runner(data, {0, 1, 2, 3, 4, 5, 6, 7}, 1, 1);
  const Fitter fitter(runner, freedom);
  FitState stated;
  stated.nominal.assign(freedom.coordinates().size(), 0.0);
  const NominalTangents tangents = fitter.nominalTangents(stated);
  const FitResult now = fitter.fit(stated, &tangents, {30, 1e-9});
  ASSERT_TRUE(now.converged);
  bool at_bound = false;
  for (std::size_t c = 0; c < now.state.nominal.size(); ++c)
    at_bound = at_bound || now.state.nominal[c] > 0.999 * freedom.coordinates()[c].high;
  ASSERT_TRUE(at_bound);

  const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, nullptr);
  ScreeningMemory memory;
  const std::vector<PredictedGain> predictions = screen(fitter, now, tangents, hypotheses, 100.0, &memory);
  const auto gain = std::find_if(predictions.begin(), predictions.end(), [](const PredictedGain& p) {
    return p.hypothesis->effect == "gain_error" && p.hypothesis->variant == "fz";
  });
  ASSERT_NE(gain, predictions.end());
  FitState with = now.state;
  with.members.push_back({gain->hypothesis, gain->start});
  EXPECT_NEAR(numbersOf(gain->hypothesis->entry(gain->start)).front().second, 1.2, 0.02);
  const FitResult fit = fitter.fit(with, &tangents, {30, 1e-9});
  const double reduction = now.chi2 + now.penalty - fit.chi2 - fit.penalty;
  EXPECT_NEAR(gain->gain, reduction, 0.05 * reduction);
  // The predicted effect scale is that of the fit.
  const EffectScale predicted = fittedScale(fitter, *gain), fitted = fittedScale(fitter, fit, now);
  EXPECT_NEAR(predicted.scale, 1.0, 0.02);
  EXPECT_NEAR(predicted.std_dev, fitted.std_dev, 0.1 * fitted.std_dev);
  EXPECT_TRUE(ValidationResult::isAcceptedByFitted(predicted));
}

// Runout changes the radii of a four-tooth tool by its size times the cosine at quarter revolutions: of one
// tooth that is 20 um longer than the others runout can reproduce half. No other effect of the catalogue
// changes radii.
TEST(Screening, RunoutReplacesToothRadii) {
  const TemporaryFolder folder;
  const Dataset data = axialGain(folder.file("."));
  const NominalFreedom freedom(data.nominal);
  const TwinRunner runner(data, {0}, 1, 1);
  const Fitter fitter(runner, freedom);
  const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, nullptr);
  const auto find = [&](const std::string& effect) {
    return &*std::find_if(hypotheses.begin(), hypotheses.end(),
                          [&](const Hypothesis& h) { return h.effect == effect; });
  };
  const Hypothesis &radius = *find("tooth_radius"), &runout = *find("runout");
  ASSERT_EQ(data.nominal.tool->teeth, 4);
  EffectEntry one_out;
  one_out.name = "tooth_radius";
  one_out.lists["offset_um"] = {15.0, -5.0, -5.0, -5.0};
  const Member member{&radius, radius.values(one_out)};
  const auto found = equivalentValues(fitter, member, runout);
  ASSERT_TRUE(found);
  EXPECT_NEAR((*found)[0], 10.0, 1e-6);
  EXPECT_NEAR((*found)[1], 0.0, 1e-6);
  const auto back = equivalentValues(fitter, {&runout, *found}, radius);
  ASSERT_TRUE(back);
  const std::vector<double> radii = radius.entry(*back).lists.at("offset_um");
  const std::vector<double> expected{10.0, 0.0, -10.0, 0.0};
  for (std::size_t j = 0; j < 4; ++j) EXPECT_NEAR(radii[j], expected[j], 1e-6);
  for (const Hypothesis& h : hypotheses) {
    if (h.effect == "tooth_radius" || h.effect == "runout") continue;
    EXPECT_FALSE(equivalentValues(fitter, member, h)) << h.title();
  }
}

}  // namespace
}  // namespace smartmill::discrepancy
