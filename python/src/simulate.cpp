#include <filesystem>
#include <utility>
#include <vector>

#include "convert.h"
#include "module.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/twin/twin.h"
#include "work.h"

namespace smartmill::python {
namespace {

using Records = std::vector<std::pair<CampaignTest, Record>>;

py::tuple simulateCampaign(const std::optional<MachineModel>& given, const std::string& path, bool noise,
                           std::uint64_t seed, const py::object& progress) {
  Records records = interruptible(progress, [=](Work& work) {
    const Campaign campaign = readCampaign(path);
    const MachineModel model = modelOf(campaign, given);
    sim::SimulationOptions options;
    options.noise = noise;
    options.seed = seed;
    Records simulated;
    for (const CampaignTest& test : campaign.tests) {
      work.progress(static_cast<double>(simulated.size()) / static_cast<double>(campaign.tests.size()),
                    "simulating " + test.name);
      simulated.emplace_back(test, sim::simulateTest(model, test, readRecord(campaign, test), options));
      ++options.seed;
    }
    work.progress(1.0, "");
    return simulated;
  });
  return tupleOf(records, [](const auto& r) { return toPython(r.first, r.second); });
}

py::object simulateCut(const MachineModel& model, const py::object& cut, double duration, double rate,
                       const std::optional<double>& phase, bool noise, std::uint64_t seed) {
  CampaignTest test;
  test.name = "cut";
  test.sample_rate = rate;
  test.spindle_speed = cut.attr("spindle_speed").cast<double>();
  test.engagement = engagementOf(cut);
  test.feed_direction = cut.attr("feed_direction").cast<double>();
  sim::SimulationOptions options;
  options.noise = noise;
  options.seed = seed;
  options.phase = phase;
  Record record =
      interruptible(py::none(), [=](Work&) { return sim::simulateTest(model, test, duration, options); });
  return toPython(test, std::move(record));
}

}  // namespace

void addSimulate(py::module_& m) {
  m.def("simulate_campaign", &simulateCampaign, py::arg("model"), py::arg("campaign"), py::arg("noise"),
        py::arg("seed"), py::arg("progress"));
  m.def("simulate_cut", &simulateCut, py::arg("model"), py::arg("cut"), py::arg("duration"), py::arg("rate"),
        py::arg("phase"), py::arg("noise"), py::arg("seed"));
}

}  // namespace smartmill::python
