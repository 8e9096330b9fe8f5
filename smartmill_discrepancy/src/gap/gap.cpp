#include "smartmill_discrepancy/gap/gap.h"

#include <cmath>

#include "smartmill_discrepancy/gap/twin_runner.h"

namespace smartmill::discrepancy {

CampaignGap campaignGap(const Dataset& data, const MachineModel& model, int threads) {
  std::vector<std::size_t> all;
  for (std::size_t t = 0; t < data.tests.size(); ++t) {
    if (!data.tests[t].chatter) all.push_back(t);
  }
  const TwinRunner runner(data, all, threads, EXACT_SUBSTEPS);
  const std::vector<double> simulated = runner.simulate(model);
  CampaignGap result;
  double sum = 0.0;
  for (const ChannelSpan& b : runner.spans()) {
    double squares = 0.0;
    for (std::size_t i = b.offset; i < b.offset + b.size; ++i)
      squares += std::pow(runner.measured()[i] - simulated[i], 2);
    const double gap = std::sqrt(squares / static_cast<double>(b.size));
    result.channels.push_back({data.tests[b.test].test.name, b.channel, gap, gap * b.noise});
    sum += squares;
  }
  result.overall = std::sqrt(sum / static_cast<double>(runner.size()));
  return result;
}

}  // namespace smartmill::discrepancy
