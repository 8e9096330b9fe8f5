// rosrun smartmill_discrepancy gap CAMPAIGN: how far measurement and twin are apart, test by test.

#include <algorithm>
#include <cstdio>
#include <exception>
#include <iostream>
#include <map>
#include <string>

#include <CLI/CLI.hpp>

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
  CLI::App app{
      "Gap between a campaign's records and the twin: RMS of the difference over the noise; 1 is the noise "
      "floor."};
  app.add_option("campaign", campaign, "campaign folder")->required();
  app.add_option("--model", model, "machine model file (default: the campaign's)");
  app.add_option("--threads", threads, "computing threads")->check(CLI::Range(1, 64));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  try {
    run(campaign, model, threads);
  } catch (const std::exception& e) {
    std::cerr << "gap: " << e.what() << "\n";
    return 1;
  }
  return 0;
}
