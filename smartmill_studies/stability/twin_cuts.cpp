#include "stability/twin_cuts.h"

#include <algorithm>
#include <future>
#include <thread>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::stability {
namespace {

/// Tooth 1 passes +y between two samples: a sample (or a step of the simulator, a quarter of it) exactly at
/// an entry would be in or out of cut by rounding.
constexpr double BETWEEN = 0.137;  // [1] of a sample

CampaignTest testOf(const TwinCut& cut) {
  CampaignTest test;
  test.name = "cut";
  test.sample_rate = cut.samples * cut.speed / units::TWO_PI;
  test.spindle_speed = cut.speed;
  test.engagement = cut.engagement;
  test.engage_time = cut.air * units::TWO_PI / cut.speed;
  return test;
}

/// Sample times and columns, filled by the simulator.
Record planned(const TwinCut& cut, const std::vector<std::string>& columns) {
  const double turn = units::TWO_PI / cut.speed;
  Record record;
  const int n = cut.samples * (cut.air + cut.revolutions);
  for (int i = 0; i < n; ++i) record.time.push_back(turn * i / cut.samples);
  for (const std::string& name : columns) record.add(name).assign(record.time.size(), 0.0);
  return record;
}

}  // namespace

void runTwinCuts(const std::vector<MachineModel>& models, const std::vector<TwinCut>& cuts,
                 const TwinRequest& request, const std::function<void(std::size_t, const Record&)>& judge,
                 const std::function<void(double)>& progress) {
  if (models.size() != 1 && models.size() != cuts.size())
    throw Error("simulator: expected one model or one per cut");
  const auto simulated = [&](std::size_t i) {
    sim::SimulationOptions options;
    options.noise = request.noise;
    options.seed = request.seed + i;
    options.speed_variation = cuts[i].variation;
    options.phase = units::TWO_PI * BETWEEN / cuts[i].samples;
    return sim::simulateTest(models[models.size() == 1 ? 0 : i], testOf(cuts[i]),
                             planned(cuts[i], request.columns), options);
  };
  const std::size_t cores = std::max(1u, std::thread::hardware_concurrency());
  for (std::size_t done = 0; done < cuts.size();) {
    std::vector<std::future<Record>> running;
    for (; running.size() < cores && done + running.size() < cuts.size();)
      running.push_back(std::async(std::launch::async, simulated, done + running.size()));
    for (std::future<Record>& record : running) judge(done++, record.get());
    if (progress) progress(static_cast<double>(done) / static_cast<double>(cuts.size()));
  }
}

}  // namespace smartmill::stability
