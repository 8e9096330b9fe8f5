// rosrun smartmill_discrepancy gap CAMPAIGN: how far measurement and twin are apart, test by test.

#include <algorithm>
#include <cstdio>
#include <map>
#include <string>

#include "smartmill_core/program.h"
#include "smartmill_discrepancy/data/phase.h"
#include "smartmill_discrepancy/gap/gap.h"

namespace {

void run(const std::string& folder, const std::string& model_file, int threads) {
  using namespace smartmill;
  const Campaign campaign = readCampaign(folder);
  const MachineModel nominal = readMachineModel(campaign.modelPath());
  // The noise is that of the campaign, whatever model is compared with it.
  discrepancy::Dataset data = discrepancy::loadDataset(campaign, nominal);
  for (const std::string& note : data.notes) std::fprintf(stderr, "note: %s\n", note.c_str());
  const MachineModel model = model_file.empty() ? nominal : readMachineModel(model_file);
  discrepancy::turnPhases(data, model);
  const discrepancy::CampaignGap gap = discrepancy::campaignGap(data, model, threads);
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

int main(int argc, char** argv) {
  std::string campaign, model;
  int threads = 2;
  smartmill::CommandLine line{
      "Gap between a campaign's records and the twin: RMS of the difference over the noise; 1 is the noise "
      "floor."};
  line.option("campaign", campaign, "campaign folder").required();
  line.option("--model", model, "machine model file (default: the campaign's)");
  line.option("--threads", threads, "computing threads").within(1, 64);
  return runProgram(line, argc, argv, [&] { run(campaign, model, threads); });
}
