#include "smartmill_discrepancy/gap.h"

#include <cmath>
#include <utility>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

const std::vector<std::string> CHANNELS{"fx", "fy", "fz", "load_meter"};
constexpr std::size_t LEAST_QUIET = 50;  // samples without cutting that make an estimate of noise

// Samples of a record before any force acts: all of an air cut, a cut before its engagement.
std::size_t quietSamples(const CampaignTest& test, const Record& record) {
  if (test.kind == TestKind::air) return record.size();
  if (test.kind != TestKind::cut || !test.engage_time) return 0;
  std::size_t count = 0;
  while (count < record.size() && record.time[count] < *test.engage_time - 0.5 / test.sample_rate) ++count;
  return count;
}

struct Residual {
  std::string test, channel;
  std::vector<double> values;
};

struct Pool {
  double squares = 0.0;
  std::size_t freedom = 0;
};

}  // namespace

CampaignGap campaignGap(const Campaign& campaign, const MachineModel& model,
                        const std::function<void(const std::string&)>& progress) {
  sim::SimulationOptions options;
  options.noise = false;
  std::vector<Residual> residuals;
  std::map<std::string, Pool> quiet;
  for (const CampaignTest& test : campaign.tests) {
    if (progress) progress(test.name);
    const Record measured = readRecord(campaign, test);
    const Record simulated = sim::simulateTest(model, test, measured, options);
    const std::size_t count = quietSamples(test, measured);
    for (const std::string& channel : CHANNELS) {
      if (!measured.has(channel)) continue;
      Residual residual{test.name, channel, measured.column(channel)};
      for (std::size_t i = 0; i < residual.values.size(); ++i)
        residual.values[i] -= simulated.column(channel)[i];
      if (count >= LEAST_QUIET) {
        // About the mean: an offset is a disagreement, not noise.
        const std::vector<double> part(residual.values.begin(),
                                       residual.values.begin() + static_cast<std::ptrdiff_t>(count));
        const double deviation = standardDeviation(part);
        quiet[channel].squares += deviation * deviation * static_cast<double>(count - 1);
        quiet[channel].freedom += count - 1;
      }
      residuals.push_back(std::move(residual));
    }
  }

  CampaignGap result;
  double squares = 0.0, samples = 0.0;
  for (const Residual& residual : residuals) {
    double& noise = result.noise[residual.channel];
    if (noise == 0.0) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (residual.channel == CHANNELS[axis] && model.force_sensor.noise_rms)
          noise = (*model.force_sensor.noise_rms)[axis];
      }
      const Pool& pool = quiet[residual.channel];
      if (noise == 0.0 && pool.freedom > 0)
        noise = std::sqrt(pool.squares / static_cast<double>(pool.freedom));
      if (!(noise > 0.0)) {
        throw Error(campaign.folder + ": no noise estimate for " + residual.channel +
                    ": the model states none and no record has a part without cutting");
      }
    }
    const double value = rms(residual.values);
    result.channels.push_back({residual.test, residual.channel, value / noise, value});
    squares += value * value / (noise * noise) * static_cast<double>(residual.values.size());
    samples += static_cast<double>(residual.values.size());
  }
  if (samples == 0.0) throw Error(campaign.folder + ": no channel to compare");
  result.overall = std::sqrt(squares / samples);
  return result;
}

}  // namespace smartmill::discrepancy
