#include "smartmill_discrepancy/live_gap.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "smartmill_core/error.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {

LiveGap liveGap(const MachineModel& model, const Stretch& stretch, double limit) {
  if (!model.force_sensor.noise_rms)
    throw Error(model.file + ": force_sensor.noise_rms_n is missing (needed to measure a gap)");
  sim::SimulationOptions options;
  options.noise = false;
  options.substeps = 4;
  const Record simulated = sim::simulateTest(model, stretch.test, stretch.record, options);
  LiveGap result;
  result.stamp = stretch.stamp;
  result.condition = stretch.test.name;
  const std::size_t from = stretch.record.size() / 2;
  std::size_t axis = 0;
  for (const char* channel : {"fx", "fy", "fz"}) {
    const auto &m = stretch.record.column(channel), &s = simulated.column(channel);
    double squares = 0.0;
    for (std::size_t i = from; i < m.size(); ++i) squares += (m[i] - s[i]) * (m[i] - s[i]);
    result.channels.push_back(channel);
    result.gap.push_back(std::sqrt(squares / static_cast<double>(m.size() - from)) /
                         (*model.force_sensor.noise_rms)[axis++]);
    result.model_fits = result.model_fits && result.gap.back() <= limit;
  }
  return result;
}

void recordStretch(const MachineModel& model, const Stretch& stretch, const std::string& folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) throw Error(folder + ": " + failed.message());
  Campaign campaign;
  if (std::filesystem::exists(folder + "/campaign.yaml")) {
    campaign = readCampaign(folder);
  } else {
    campaign.model_file = "model.yaml";
    writeMachineModel(model, folder + "/model.yaml");
  }
  campaign.folder = folder;
  CampaignTest test = stretch.test;
  const auto taken = [&](const std::string& name) {
    return std::any_of(campaign.tests.begin(), campaign.tests.end(),
                       [&](const CampaignTest& t) { return t.name == name; });
  };
  // A name may hold what no file's name may.
  for (char& c : test.name) {
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '_' && c != '-') c = '_';
  }
  const std::string name = test.name;
  for (int k = 2; taken(test.name); ++k) test.name = name + "_" + std::to_string(k);
  test.file = test.name + ".csv";
  writeCsv(stretch.record, folder + "/" + test.file);
  campaign.tests.push_back(test);
  writeCampaign(campaign, folder);
}

}  // namespace smartmill::discrepancy
