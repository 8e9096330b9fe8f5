#pragma once

#include <functional>
#include <string>
#include <vector>

#include "smartmill_core/units.h"
#include "smartmill_discrepancy/explain/explain.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {

inline MachineModel believed() {
  MachineModel m;
  m.tool = ToolGeometry{4, 12e-3, units::radFromDeg(35.0), {}};
  m.cutting = CuttingCoefficients{796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3};
  m.force_sensor.noise_rms = Axes3{{1.0, 1.0, 1.0}};
  return m;
}

/// Within the stated uncertainty of 3 %.
inline MachineModel real() {
  MachineModel m = believed();
  m.cutting->ktc *= 1.03;
  m.cutting->kre *= 0.96;
  return m;
}

inline CampaignTest slot(const std::string& name, double rpm, double feed_mm, double start) {
  CampaignTest t;
  t.name = name;
  t.file = name + ".csv";
  t.kind = TestKind::cut;
  t.sample_rate = 12800.0;
  t.spindle_speed = units::radPerSecFromRpm(rpm);
  t.engagement = Engagement{0.0, units::PI, 2e-3, feed_mm * units::MM};
  t.engage_time = 0.02;
  t.start_time = start;
  t.cut_time_before = 0.2 * start;
  return t;
}

/// Slots at three feeds and three speeds over a quarter of an hour.
inline std::vector<CampaignTest> slotsOfManyKinds() {
  return {slot("a", 4500, 0.06, 90),  slot("b", 4500, 0.03, 180), slot("c", 4500, 0.1, 270),
          slot("d", 3000, 0.06, 360), slot("e", 7200, 0.06, 540), slot("f", 7200, 0.1, 720),
          slot("g", 3000, 0.03, 810), slot("h", 4500, 0.06, 900)};
}

/// A campaign with the nominal model believed(). @param record of a test, drawn with a seed
inline Dataset datasetOf(const std::function<Record(const CampaignTest&, std::uint64_t seed)>& record,
                         const std::string& folder,
                         const std::vector<CampaignTest>& tests = slotsOfManyKinds()) {
  Campaign campaign;
  campaign.folder = folder;
  campaign.model_file = "model.yaml";
  campaign.tests = tests;
  writeMachineModel(believed(), folder + "/model.yaml");
  writeCampaign(campaign, folder);
  std::uint64_t seed = 1;
  for (const CampaignTest& test : campaign.tests) writeCsv(record(test, ++seed), folder + "/" + test.file);
  return loadDataset(campaign, readMachineModel(campaign.modelPath()));
}

inline Explanation explained(const std::function<Record(const CampaignTest&, std::uint64_t seed)>& record,
                             const std::string& folder, const ExplainOptions& options = {},
                             const std::vector<CampaignTest>& tests = slotsOfManyKinds()) {
  return explain(datasetOf(record, folder, tests), options, folder);
}

}  // namespace smartmill::discrepancy
