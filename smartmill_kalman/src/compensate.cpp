// rosrun smartmill_kalman compensate CAMPAIGN -o OUT: force at the tool of every cut of a campaign.

#include <cstdio>
#include <filesystem>
#include <iostream>
#include <string>

#include <CLI/CLI.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/campaign_compensation.h"

namespace {

using namespace smartmill;

struct Request {
  std::string campaign, out, model;
  bool identify = false;
  kalman::HarmonicFilterParameters filter;
  kalman::SensorFitParameters fit;
};

void print(const char* axis, const ModalModel& sensor) {
  std::printf("sensor %s: direct %.4f", axis, sensor.direct);
  for (const Mode& mode : sensor.modes) {
    std::printf("; %.2f Hz, damping %.4f, gain %.4f", mode.frequency, mode.damping_ratio, mode.gain);
  }
  std::printf("\n");
}

void run(const Request& request) {
  const Campaign campaign = readCampaign(request.campaign);
  std::array<ModalModel, 3> sensor;
  bool workpiece = false;
  kalman::HarmonicFilterParameters filter = request.filter;
  if (request.identify) {
    sensor = kalman::identifySensor(campaign, request.fit);
  } else {
    const MachineModel model = readMachineModel(request.model.empty() ? campaign.modelPath() : request.model);
    sensor = model.force_sensor.axis;
    workpiece = model.force_sensor.measures_workpiece;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) print(axis == 0 ? "x" : axis == 1 ? "y" : "z", sensor[axis]);
  std::filesystem::create_directories(request.out);
  std::size_t cuts = 0;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::cut) continue;
    std::fprintf(stderr, "compensating %s\n", test.name.c_str());
    const Record record = readRecord(campaign, test);
    const auto force =
        kalman::compensate(record, sensor, workpiece, test.spindle_speed, test.sample_rate, filter);
    Record result;
    result.time = record.time;
    result.add("fx") = force[0];
    result.add("fy") = force[1];
    result.add("fz") = force[2];
    writeCsv(result, (std::filesystem::path(request.out) / (test.name + ".csv")).string());
    const auto range = [](const std::vector<double>& v) { return percentile(v, 0.9) - percentile(v, 0.1); };
    std::printf("%s: range 10..90 %% measured x %.1f y %.1f N, compensated x %.1f y %.1f N\n",
                test.name.c_str(), range(record.column("fx")), range(record.column("fy")), range(force[0]),
                range(force[1]));
    ++cuts;
  }
  if (cuts == 0) throw Error(campaign.folder + ": the campaign has no cuts");
  std::printf("%zu cuts written to %s (no latency)\n", cuts, request.out.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CLI::App app{"Recovers the force at the tool from the records of a force sensor."};
  app.add_option("campaign", request.campaign, "campaign folder")->required();
  app.add_option("-o,--out", request.out, "folder for one CSV a cut")->required();
  app.add_option("--model", request.model, "model file with the force sensor (default: the campaign's)");
  app.add_flag("--identify", request.identify, "take the sensor's modes from the campaign's own taps");
  app.add_option("--bandwidth-hz", request.filter.bandwidth, "harmonics up to this frequency");
  app.add_option("--noise-rms-n", request.filter.noise_rms, "noise of one sample");
  app.add_option("--settling-revolutions", request.filter.settling_revolutions,
                 "time constant of the amplitudes");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  try {
    run(request);
  } catch (const std::exception& e) {
    std::cerr << "compensate: " << e.what() << "\n";
    return 1;
  }
  return 0;
}
