// rosrun smartmill_sim simulate MODEL CAMPAIGN -o OUT: re-creates a campaign from its model and plan.

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <string>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/program.h"
#include "smartmill_sim/twin/twin.h"

namespace {

using namespace smartmill;

void run(const std::string& model_file, const std::string& campaign_path, const std::string& out,
         sim::SimulationOptions options) {
  namespace fs = std::filesystem;
  const MachineModel model = readMachineModel(model_file);
  Campaign campaign = readCampaign(campaign_path);
  if (fs::exists(out) && fs::equivalent(out, campaign.folder)) {
    throw Error(out + ": the campaign's own folder would be overwritten");
  }
  fs::create_directories(out);
  double simulated = 0.0, used = 0.0;  // [s] of records, of the processor
  for (CampaignTest& test : campaign.tests) {
    std::fprintf(stderr, "simulating %s\n", test.name.c_str());
    const Record recorded = readRecord(campaign, test);
    const std::clock_t start = std::clock();
    const Record record = sim::simulateTest(model, test, recorded, options);
    used += static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    simulated += static_cast<double>(record.size()) / test.sample_rate;
    ++options.seed;
    // Written as smartmill CSV whatever the recorded format was.
    test.file_format.clear();
    test.channels.clear();
    const fs::path file = fs::path(out) / test.file;
    fs::create_directories(file.parent_path());
    writeCsv(record, file.string());
  }
  std::fprintf(stderr, "%.2f s of records in %.3f s of processor time: %.0f times real time\n", simulated,
               used, simulated / std::max(used, 1e-6));
  campaign.model_file = "model.yaml";
  writeMachineModel(model, (fs::path(out) / "model.yaml").string());
  writeCampaign(campaign, out);
}

}  // namespace

int main(int argc, char** argv) {
  std::string model, campaign, out, noise = "on";
  smartmill::sim::SimulationOptions options;
  CommandLine line{"Re-creates a campaign from a machine model and the campaign's plan."};
  line.option("model", model, "machine model file").required();
  line.option("campaign", campaign, "campaign folder: plan, sample times, spindle phase, hammer forces")
      .required();
  line.option("-o,--out", out, "folder of the new campaign").required();
  line.option("--noise", noise, "on, or off: neither noise nor rounding").oneOf({"on", "off"});
  line.option("--seed", options.seed, "of the noise");
  return runProgram(line, argc, argv, [&] {
    options.noise = noise == "on";
    run(model, campaign, out, options);
  });
}
