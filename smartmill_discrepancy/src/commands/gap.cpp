#include "smartmill_discrepancy/commands.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <string>

#include "smartmill_discrepancy/data/alignment.h"
#include "smartmill_discrepancy/gap/gap.h"

namespace {

struct Arguments {
  std::string campaign, model;
  int threads = 2;
};

void run(const Arguments& arguments) {
  using namespace smartmill;
  const Campaign campaign = readCampaign(arguments.campaign);
  const MachineModel nominal = readMachineModel(campaign.modelPath());
  // The noise is that of the campaign, for any model.
  discrepancy::Dataset data = discrepancy::loadDataset(campaign, nominal);
  for (const auto& notes : {data.notes, data.stream_shifts})
    for (const std::string& note : notes) std::fprintf(stderr, "note: %s\n", note.c_str());
  const MachineModel model = arguments.model.empty() ? nominal : readMachineModel(arguments.model);
  discrepancy::alignPhases(data, model);
  const discrepancy::CampaignGap gap = discrepancy::campaignGap(data, model, arguments.threads);
  std::map<std::string, double> largest;
  std::printf("%-24s %-12s %8s %14s\n", "test", "channel", "gap", "residual rms");
  for (const auto& row : gap.channels) {
    std::printf("%-24s %-12s %8.3f %14.4g\n", row.test.c_str(), row.channel.c_str(), row.gap,
                row.residual_rms);
    largest[row.channel] = std::max(largest[row.channel], row.gap);
  }
  for (const auto& [channel, value] : largest) {
    std::printf("largest %-12s %8.3f (noise %.4g)\n", channel.c_str(), value, data.noise.at(channel));
  }
  std::printf("overall gap %.4f\n", gap.overall);
}

}  // namespace

namespace smartmill::discrepancy {

Command gapCommand() {
  Command command("gap", "prints the gap between a campaign's records and the twin, test by test");
  command.description =
      "Gap between a campaign's records and the twin: RMS of the difference over the noise; 1 is the noise "
      "floor.";
  command.examples = {
      {"campaigns/runout", "with the campaign's own model"},
      {"campaigns/runout --model found/model.yaml", "with another model, over the same noise"}};
  command.files = {{"CAMPAIGN/campaign.yaml", "the tests, their records and the model"}};
  command.setBody(run, [](CommandLine& line, Arguments& arguments) {
    line.option("CAMPAIGN", arguments.campaign, "campaign folder").required();
    line.option("--model", arguments.model, "machine model file (default: the campaign's)");
    line.option("--threads", arguments.threads, "threads").within(1, 64).showDefault();
  });
  return command;
}

}  // namespace smartmill::discrepancy
