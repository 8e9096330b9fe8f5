#include "smartmill_sim/commands.h"

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <string>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/campaign/stream_offset.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/twin/twin.h"

namespace {

using namespace smartmill;

struct Arguments {
  std::string model, campaign, out, noise = "on";
  sim::SimulationOptions options;
};

void run(const Arguments& a) {
  namespace fs = std::filesystem;
  const MachineModel model = readMachineModel(a.model);
  Campaign campaign = readCampaign(a.campaign);
  const std::string& out = a.out;
  sim::SimulationOptions options = a.options;
  options.noise = a.noise == "on";
  if (fs::exists(out) && fs::equivalent(out, campaign.folder)) {
    throw Error(out + ": this is the campaign's own folder, choose another one");
  }
  fs::create_directories(out);
  double simulated = 0.0, used = 0.0;  // [s] duration of the records, processor time
  for (CampaignTest& test : campaign.tests) {
    std::fprintf(stderr, "simulating %s\n", test.name.c_str());
    const Record recorded = aligned(readRecord(campaign, test), test);
    const std::clock_t start = std::clock();
    const Record record = sim::simulateTest(model, test, recorded, options);
    used += static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    simulated += static_cast<double>(record.size()) / test.sample_rate;
    ++options.seed;
    // The output is smartmill CSV for any recorded format.
    test.file_format.clear();
    test.channels.clear();
    test.stream_offset.clear();
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

namespace smartmill::sim {

Command simulateCommand() {
  Command command("simulate", "simulates a campaign from a machine model and the campaign's plan");
  command.description = "Simulates a campaign from a machine model and the campaign's plan.";
  command.examples = {{"mill.yaml campaigns/runout -o simulated", "the campaign as recorded on this machine"},
                      {"mill.yaml campaigns/runout -o exact --noise off", "without noise and rounding"}};
  command.files = {{"OUT/campaign.yaml", "the plan of the new campaign"},
                   {"OUT/model.yaml", "the machine model"},
                   {"OUT/*.csv", "the records, at the paths of the original ones"}};
  command.setBody(run, [](CommandLine& line, Arguments& a) {
    line.option("MODEL", a.model, "machine model file").required();
    line.option("CAMPAIGN", a.campaign, "campaign folder: plan, sample times, spindle phase, hammer forces")
        .required();
    line.option("-o,--out", a.out, "folder of the new campaign").required();
    line.option("--noise", a.noise, "on; off: neither noise nor rounding").oneOf({"on", "off"}).showDefault();
    line.option("--seed", a.options.seed, "seed of the noise").showDefault();
  });
  return command;
}

}  // namespace smartmill::sim
