// A chattering cut, compared by one-step prediction, as data: it improves coefficients and tool modes with
// calibrated uncertainties next to shallow cuts only. The truth is that of the simulation.

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "explain/small_campaign.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/testing/shared_data.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_discrepancy/explain/outcome.h"
#include "smartmill_discrepancy/search/refinement.h"

namespace smartmill::discrepancy {
namespace {

constexpr double DEEP = 4e-3, SHALLOW = 0.5e-3;  // [m] around the critical limit of about 1 mm

MachineModel slender(double stiffness, double damping) {
  MachineModel m = believed();
  m.tool_tip.x.modes = {{900.0, damping, 1.0 / stiffness}};
  m.tool_tip.y.modes = {{1010.0, damping, 1.0 / stiffness}};
  m.uncertainty.cutting = 10.0;
  m.uncertainty.stiffness = m.uncertainty.damping = 30.0;
  return m;
}

// With or without the displacement of the tip, in steps four times as fine as those of the fit.
Record measured(const CampaignTest& test, bool has_tip, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  sim::SimulationOptions options;
  options.substeps = 32;
  options.seed = random();
  const MachineModel truth = slender(30e6, 0.03);
  Record record = sim::simulateTest(truth, test, 0.15, options);
  if (!has_tip) return record;
  for (const char* tip : {"tool_x", "tool_y"}) record.add(tip).assign(record.size(), 0.0);
  record = sim::simulateTest(truth, test, record, options);
  for (const char* tip : {"tool_x", "tool_y"}) {
    for (double& x : record.add(tip)) x += 5e-8 * normal(random);
  }
  return record;
}

Dataset campaignOf(const MachineModel& nominal, const std::string& folder, bool deep, bool has_tip) {
  Campaign campaign;
  campaign.folder = folder;
  campaign.model_file = "model.yaml";
  campaign.tests = {slot("a", 4500, 0.06, 0), slot("b", 6000, 0.1, 20), slot("deep", 4500, 0.06, 40)};
  for (CampaignTest& t : campaign.tests) t.engagement->axial_depth = t.name == "deep" ? DEEP : SHALLOW;
  if (!deep) campaign.tests.pop_back();
  writeMachineModel(nominal, campaign.modelPath());
  std::mt19937_64 random(7);
  for (const CampaignTest& t : campaign.tests) writeCsv(measured(t, has_tip, random), folder + "/" + t.file);
  return loadDataset(campaign, readMachineModel(campaign.modelPath()));
}

struct FittedValues {
  std::vector<std::string> names;
  std::vector<double> value, std_dev;
  double gap = 0.0, error_before = 0.0, error_after = 0.0;
};

FittedValues fitted(const Dataset& data) {
  WorkbenchOptions options;
  options.threads = 1;
  Workbench bench(data, options);
  FitState start;
  start.nominal.assign(bench.freedom().coordinates().size(), 0.0);
  FittedValues fitted_values;
  const auto error = [](const ModelResidual& r) {
    return r.chattering.empty() ? 0.0 : r.chattering.begin()->second;
  };
  fitted_values.error_before = error(residualOf(bench, data.nominal));
  SearchResult found;
  for (int pass = 0; pass < 2; ++pass) {
    EXPECT_TRUE(refine(bench, start, {}, &found));
    start = found.best.state;
    bench.guidance().updateWeights(start);
  }
  const ModelResidual after = residualOf(bench, bench.exact().model(start));
  fitted_values.gap = after.gap.fit;
  fitted_values.error_after = error(after);
  const Eigen::MatrixXd covariance = robustCovariance(bench, found.best);
  for (std::size_t c = 0; c < start.nominal.size(); ++c) {
    const auto k = static_cast<Eigen::Index>(c);
    fitted_values.names.push_back(bench.freedom().coordinates()[c].name);
    fitted_values.value.push_back(start.nominal[c]);
    fitted_values.std_dev.push_back(std::sqrt(covariance(k, k)));
  }
  return fitted_values;
}

TEST(ChatteringCut, ImprovesTheFitWithCalibratedDeviations) {
  const TemporaryFolder with_folder, without_folder;
  // 20 % too much stiffness and damping: coordinates are logarithms of factors.
  const MachineModel nominal = slender(36e6, 0.036);
  const Dataset data = campaignOf(nominal, with_folder.file("."), true, true);
  ASSERT_EQ(data.tests.size(), 3u);
  EXPECT_TRUE(data.chattering.empty());
  EXPECT_TRUE(data.tests.back().chatter && data.tests.back().guided && !data.tests.back().heldout);
  const FittedValues with = fitted(data);
  const FittedValues without = fitted(campaignOf(nominal, without_folder.file("."), false, true));
  for (std::size_t c = 0; c < with.names.size(); ++c) {
    const std::string& name = with.names[c];
    double truth = 0.0;
    if (name.find("stiffness") != std::string::npos) truth = std::log(30.0 / 36.0);
    if (name.find("damping") != std::string::npos) truth = std::log(0.03 / 0.036);
    EXPECT_LT(with.std_dev[c], without.std_dev[c]) << name;
    // Vibration determines the modes.
    if (name.find("damping") != std::string::npos) {
      EXPECT_LT(with.std_dev[c], 0.5 * without.std_dev[c]) << name;
    }
    EXPECT_LT(std::abs(with.value[c] - truth), 3.5 * with.std_dev[c]) << name;
  }
  EXPECT_NEAR(with.gap, 1.0, 0.02);
  EXPECT_LT(with.error_after, 0.5 * with.error_before);
}

// Without displacement or tool modes the cut cannot be guided and is excluded.
TEST(ChatteringCut, IsExcludedIfItCannotBeGuided) {
  const TemporaryFolder rigid_folder, forces_folder;
  for (const Dataset& data : {campaignOf(believed(), rigid_folder.file("."), true, true),
                              campaignOf(slender(30e6, 0.03), forces_folder.file("."), true, false)}) {
    EXPECT_EQ(data.tests.size(), 2u);
    ASSERT_EQ(data.chattering.size(), 1u);
    EXPECT_EQ(data.chattering.front().data.test.name, "deep");
  }
}

// Records of another program: two cuts far from the stability limit and one so near that rounding errors
// excite its vibration. Runout as in truth.yaml.
struct NearLimit {
  double offset =
      0.0;  // [standard deviations] distance of cutting law and tool from the truth, by their covariance
  double kre_std = 0.0;  // of the logarithm
};

NearLimit fittedNearLimit(const std::string& folder, bool guided) {
  const Campaign campaign = readCampaign(folder);
  MachineModel truth = readMachineModel(campaign.modelPath());
  truth.effects.push_back(effectEntry("runout", {{"offset_um", 21.98}, {"angle_deg", 217.9}}));
  truth.uncertainty.cutting = truth.uncertainty.damping = truth.uncertainty.stiffness = 30.0;
  const NominalFreedom freedom(truth);
  const auto isCompared = [](const Coordinate& c) {
    return c.name.rfind("cutting.", 0) == 0 || c.name.rfind("tool_tip.", 0) == 0;
  };
  std::vector<double> off;
  for (const Coordinate& c : freedom.coordinates())
    off.push_back(!isCompared(c) ? 0.0 : c.name.find("frequency") != std::string::npos ? 0.005 : -0.1);
  Dataset data = loadDataset(campaign, freedom.apply(truth, off));
  const auto isUsed = [](const TestData& t) {
    return t.test.name == "slot_4500_deep" || t.test.name == "slot_1200" || t.test.name == "slot_4500_100";
  };
  data.tests.erase(
      std::remove_if(data.tests.begin(), data.tests.end(), [&](const TestData& t) { return !isUsed(t); }),
      data.tests.end());
  for (TestData& t : data.tests) t.heldout = false;
  WorkbenchOptions options;
  options.threads = 1;
  Workbench bench(data, options);
  FitState state;
  state.nominal.assign(off.size(), 0.0);
  SearchResult found;
  for (int pass = 0; pass < 2; ++pass) {
    EXPECT_TRUE(refine(bench, state, {}, &found));
    state = found.best.state;
    if (guided) bench.guidance().guideNearLimit(state);
    bench.guidance().updateWeights(state);
  }
  const Eigen::MatrixXd covariance = robustCovariance(bench, found.best);
  NearLimit result;
  std::vector<Eigen::Index> indices;
  for (std::size_t c = 0; c < off.size(); ++c) {
    const auto k = static_cast<Eigen::Index>(c);
    if (isCompared(freedom.coordinates()[c])) indices.push_back(k);
    if (freedom.coordinates()[c].name == "cutting.Kre_n_per_mm") result.kre_std = std::sqrt(covariance(k, k));
  }
  Eigen::VectorXd offset(static_cast<Eigen::Index>(indices.size()));
  for (Eigen::Index k = 0; k < offset.size(); ++k) {
    const auto c = static_cast<std::size_t>(indices[static_cast<std::size_t>(k)]);
    offset[k] = state.nominal[c] + off[c];
  }
  const Eigen::MatrixXd of_compared = covariance(indices, indices);
  result.offset =
      std::sqrt(offset.dot(linear::solveSymmetric(of_compared, offset)) / static_cast<double>(offset.size()));
  return result;
}

TEST(CutNearItsLimit, IsGuidedAndUnbiasedByItsVibration) {
  SMARTMILL_SHARED_DATA(folder, "campaigns/vibrating_runout");
  const NearLimit guided = fittedNearLimit(folder, true), free = fittedNearLimit(folder, false);
  EXPECT_LT(guided.offset, 1.5);
  EXPECT_LT(guided.offset, free.offset);
  EXPECT_LT(guided.kre_std, 0.5 * free.kre_std);
}

}  // namespace
}  // namespace smartmill::discrepancy
