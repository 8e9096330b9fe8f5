#include "smartmill_discrepancy/search/screening.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "explain/small_campaign.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_discrepancy/hypotheses/hypothesis.h"

namespace smartmill::discrepancy {
namespace {

// Slots of a machine whose fz reads 20 % too much: in cuts the axial coefficients stand for it, as
// far as their stated uncertainty lets them.
Dataset axialGain(const std::string& folder) {
  MachineModel machine = believed();
  machine.effects = {effectEntry("gain_error", {{"gain", 1.2}}, {{"channel", "fz"}})};
  Campaign campaign;
  campaign.folder = folder;
  campaign.model_file = "model.yaml";
  campaign.tests = slotsOfManyKinds();
  writeMachineModel(believed(), folder + "/model.yaml");
  writeCampaign(campaign, folder);
  sim::SimulationOptions options;
  for (const CampaignTest& test : campaign.tests) {
    ++options.seed;
    writeCsv(sim::simulateTest(machine, test, 0.1, options), folder + "/" + test.file);
  }
  return loadDataset(campaign, readMachineModel(campaign.modelPath()));
}

// A value that stands at its bound moves back when what pushed it there is tried: what is promised is what
// the fit then takes.
TEST(Screening, WhatPushedAValueToItsBoundIsPromisedWhole) {
  const TemporaryFolder folder;
  const Dataset data = axialGain(folder.file("."));
  const NominalFreedom freedom(data.nominal);
  const TwinRunner runner(data, {0, 1, 2, 3, 4, 5, 6, 7}, 1, 1);
  const Fitter fitter(runner, freedom);
  FitState stated;
  stated.nominal.assign(freedom.coordinates().size(), 0.0);
  const NominalTangents tangents = fitter.nominalTangents(stated);
  const Fit now = fitter.fit(stated, &tangents, {30, 1e-9, true});
  ASSERT_TRUE(now.converged);
  bool at_bound = false;
  for (std::size_t c = 0; c < now.state.nominal.size(); ++c)
    at_bound = at_bound || now.state.nominal[c] > 0.999 * freedom.coordinates()[c].high;
  ASSERT_TRUE(at_bound);

  const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, nullptr);
  ScreeningMemory memory;
  const std::vector<Promise> promises = screen(fitter, now, tangents, hypotheses, 100.0, &memory);
  const auto gain = std::find_if(promises.begin(), promises.end(), [](const Promise& p) {
    return p.hypothesis->effect == "gain_error" && p.hypothesis->variant == "fz";
  });
  ASSERT_NE(gain, promises.end());
  FitState with = now.state;
  with.members.push_back({gain->hypothesis, gain->start});
  EXPECT_NEAR(numbersOf(gain->hypothesis->entry(gain->start)).front().second, 1.2, 0.02);
  const Fit fit = fitter.fit(with, &tangents, {30, 1e-9, true});
  const double taken = now.chi2 + now.penalty - fit.chi2 - fit.penalty;
  EXPECT_NEAR(gain->gain, taken, 0.05 * taken);
  // What a fit would be sure of is told before it.
  const AskedShare promised = fittedShare(fitter, *gain), fitted = fittedShare(fitter, fit, now);
  EXPECT_NEAR(promised.share, 1.0, 0.02);
  EXPECT_NEAR(promised.std_dev, fitted.std_dev, 0.1 * fitted.std_dev);
  EXPECT_TRUE(Standing::holdsInFitted(promised));
}

// Runout moves the teeth of a four-tooth tool out by its size times cosine and sine of a quarter turn after
// the other: of one tooth that stands out by 20 um half can be runout towards it. Nothing else of the
// catalogue but radii themselves does anything to radii.
TEST(Screening, runoutTakesThePlaceOfRadii) {
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
  const auto found = inPlaceOf(fitter, member, runout);
  ASSERT_TRUE(found);
  EXPECT_NEAR((*found)[0], 10.0, 1e-6);
  EXPECT_NEAR((*found)[1], 0.0, 1e-6);
  const auto back = inPlaceOf(fitter, {&runout, *found}, radius);
  ASSERT_TRUE(back);
  const std::vector<double> radii = radius.entry(*back).lists.at("offset_um");
  const std::vector<double> expected{10.0, 0.0, -10.0, 0.0};
  for (std::size_t j = 0; j < 4; ++j) EXPECT_NEAR(radii[j], expected[j], 1e-6);
  for (const Hypothesis& h : hypotheses) {
    if (h.effect == "tooth_radius" || h.effect == "runout") continue;
    EXPECT_FALSE(inPlaceOf(fitter, member, h)) << h.title();
  }
}

}  // namespace
}  // namespace smartmill::discrepancy
