#include "smartmill_kalman/commands.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <future>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "commands/compensate_results.h"
#include "recordings/bag_compensation.h"
#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/parameters/parameter_options.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/campaign_compensation.h"
#include "smartmill_kalman/compensation/record_compensation.h"
#include "smartmill_kalman/sensor/blind_mode.h"
#include "smartmill_recording/reading_progress.h"
#include "smartmill_recording/recording_file.h"

namespace {

using namespace smartmill;

struct Request {
  std::string program, source, out, model, method = "kalman", matrix_out;
  kalman::NodeParameters parameters;
  bool identify = false, coupled = false, blind = false;
  double blind_low = 600.0, blind_high = 1500.0;  // [Hz]
  double lag = 0.05;                              // [s]
  PulseTachometerParameters tachometer;
};

/// Latency of the result, for the report.
const char* latency(const Request& request) {
  if (request.method == "fixed-lag") return "lag compensated";
  return request.method == "inverse" ? "latency of 256 samples compensated" : "no latency";
}

/// Reports modes that a cut shows without a tap.
void printBlind(const std::string& name, const Record& record, const CampaignTest& test,
                const Request& request) {
  for (const char* channel : FORCE_CHANNELS) {
    const kalman::BlindMode found = kalman::findBlindMode(
        record.column(channel), test.sample_rate, test.spindle_speed, request.blind_low, request.blind_high);
    if (found.likelihood < 10.0) {
      std::printf("%s %s: no mode between the harmonics of the spindle\n", name.c_str(), channel);
    } else {
      std::printf("%s %s: mode at %.1f +- %.1f Hz, damping %.4f +- %.4f\n", name.c_str(), channel,
                  found.mode.frequency, found.mode.frequency_std, found.mode.damping_ratio,
                  found.mode.damping_ratio_std);
    }
  }
}

std::array<std::vector<double>, 3> forces(const Record& record) {
  return {record.column("fx"), record.column("fy"), record.column("fz")};
}

kalman::NodeParameters parametersOf(const Request& request) {
  kalman::NodeParameters parameters = request.parameters;
  if (request.method == "fixed-lag") parameters.compensation.lag = request.lag;
  if (request.method == "delay") parameters.compensation.delay_form = true;
  parameters.validate();
  return parameters;
}

void fromCampaign(const Request& request) {
  if (request.coupled && request.method != "kalman") throw Error("--coupled: only with --method kalman");
  const Campaign campaign = readCampaign(request.source);
  const kalman::NodeParameters parameters = parametersOf(request);
  const kalman::SensorFitParameters fit{parameters.taps.fit_low, parameters.taps.fit_high,
                                        parameters.taps.max_modes};
  std::array<ModalModel, 3> sensor;
  std::optional<kalman::SensorMatrix> matrix;
  bool workpiece = false;
  if (request.coupled) {
    matrix = kalman::identifySensorMatrix(campaign, fit);
    for (std::size_t axis = 0; axis < 3; ++axis) sensor[axis] = matrix->h[axis][axis];
    double worst = 1.0;
    for (double f = 0.0; f <= fit.high; f += 5.0) worst = std::max(worst, matrix->condition(f));
    std::printf(
        "static cross-talk [%%]: xy %.2f xz %.2f yx %.2f yz %.2f zx %.2f zy %.2f; condition at most %.1f\n",
        100.0 * matrix->h[0][1].staticGain(), 100.0 * matrix->h[0][2].staticGain(),
        100.0 * matrix->h[1][0].staticGain(), 100.0 * matrix->h[1][2].staticGain(),
        100.0 * matrix->h[2][0].staticGain(), 100.0 * matrix->h[2][1].staticGain(), worst);
    if (!request.matrix_out.empty()) kalman::writeSensorMatrix(*matrix, request.matrix_out);
    workpiece = kalman::measuresWorkpiece(campaign, request.model);
  } else if (request.identify) {
    workpiece = kalman::measuresWorkpiece(campaign, request.model);
    sensor = kalman::identifySensor(campaign, fit);
  } else {
    const MachineModel model = readMachineModel(request.model.empty() ? campaign.modelPath() : request.model);
    sensor = model.force_sensor.axis;
    workpiece = model.force_sensor.measures_workpiece;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) kalman::printSensor(AXIS_NAMES[axis], sensor[axis]);
  std::size_t cuts = 0;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::cut) continue;
    std::fprintf(stderr, "compensating %s\n", test.name.c_str());
    Record record = readRecord(campaign, test);
    if (workpiece) kalman::negateForces(record);
    for (const std::string& note : record.notes) std::fprintf(stderr, "%s\n", note.c_str());
    const double speed = kalman::spindleSpeedOf(record, test);
    if (test.tachometer) {
      std::printf("%s: %.2f rpm by the tachometer, commanded %.2f rpm\n", test.name.c_str(),
                  units::rpmFromRadPerSec(speed), units::rpmFromRadPerSec(test.spindle_speed));
    }
    if (request.blind) printBlind(test.name, record, test, request);
    const auto force =
        matrix ? kalman::compensate(record, *matrix, speed, test.sample_rate, parameters.compensation.filter)
               : kalman::compensate(record, sensor, false, speed, test.sample_rate,
                                    parameters.compensation.filter, kalman::methodOf(request.method),
                                    request.lag);
    kalman::writeForce(request.out, test.name, record.time, force);
    std::fputs(kalman::rangeLine(test.name, forces(record), force).c_str(), stdout);
    ++cuts;
  }
  if (cuts == 0) throw Error(campaign.folder + ": no cuts");
  if (request.blind) {
    std::printf(
        "a mode of a cut may belong to the tool, the workpiece or the sensor, and its gain is unknown: it is "
        "not "
        "used; identify the sensor by a tap\n");
  }
  std::printf("%zu cuts written to %s (%s)\n", cuts, request.out.c_str(), latency(request));
}

/// File name of a test; a repeated name gets a number.
std::string fileName(std::string name, std::set<std::string>& used) {
  if (name.empty()) name = "cut";
  for (char& c : name) {
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '-' && c != '.' && c != '_') c = '_';
  }
  std::string unique = name;
  for (int n = 2; !used.insert(unique).second; ++n) unique = name + "_" + std::to_string(n);
  return unique;
}

/// Writes a cut of a bag. @return its report
std::string writeCut(const std::string& folder, const std::string& name, kalman::BagCut cut) {
  std::string report = kalman::rangeLine(name, cut.measured, cut.compensated);
  if (!cut.force_model.empty()) report += name + ": force model: " + cut.force_model + "\n";
  kalman::writeForce(folder, name, std::move(cut.offset), std::move(cut.compensated));
  return report + formatted("%s: time 0 is %.9f s, the first %.3f s are settling\n", name.c_str(), cut.stamp,
                            cut.settling);
}

void fromBag(const Request& request) {
  if (request.identify || request.coupled || request.blind) {
    throw Error(
        "--identify, --coupled, --blind: expected a campaign; the taps of a bag are evaluated as in the "
        "node");
  }
  const kalman::NodeParameters parameters = parametersOf(request);
  const std::string model_file = request.model.empty() ? parameters.model : request.model;
  if (model_file.empty()) throw Error(request.source + ": bag without a machine model (--model)");
  const MachineModel model = readMachineModel(model_file);
  if (model.force_sensor.channels) {
    const kalman::ChannelForces channels(*model.force_sensor.channels);
    std::printf("%zu channels to %zu components, condition number %.2f", channels.channels(),
                channels.components(), channels.condition());
    for (std::size_t c = 0; c < channels.deviations().size(); ++c) {
      std::printf("%s %s %.3g %s", c == 0 ? "; standard deviation" : ",", PLATE_CHANNELS[c],
                  channels.deviations()[c], c < 3 ? "N" : "N m");
    }
    std::printf("\n");
  }
  std::set<std::string> used;
  std::vector<std::future<std::string>> written;  // while the bag is read on
  const auto began = std::chrono::steady_clock::now();
  const kalman::BagSummary summary = kalman::compensateBag(
      request.source, model.force_sensor, parameters, kalman::methodOf(request.method), request.tachometer,
      [&](kalman::BagCut&& cut) {
        const std::string name = fileName(cut.name, used);
        written.push_back(std::async(std::launch::async, writeCut, request.out, name, std::move(cut)));
      },
      printReadingProgress);
  for (std::future<std::string>& cut : written) std::fputs(cut.get().c_str(), stdout);
  for (const kalman::SensorResult& result : summary.identified) {
    std::printf("taps in %s: %s\n", result.modes.direction.c_str(), result.message.c_str());
    if (result.code == FrfCode::ok) kalman::printSensor(result.modes.direction.c_str(), result.modes.model);
  }
  if (summary.cuts == 0) throw Error(request.source + ": no cut (cut/condition of kind CUT) with samples");
  if (!summary.rotation_known) {
    std::fprintf(stderr, "%s: %s: no transform of the sensor, forces are in the sensor's frame\n",
                 request.program.c_str(), request.source.c_str());
  }
  if (summary.gaps + summary.not_finite + summary.late > 0) {
    std::fprintf(stderr, "%s: %zu gaps, %zu samples not finite, %zu inputs out of order\n",
                 request.program.c_str(), summary.gaps, summary.not_finite, summary.late);
  }
  if (summary.pulses) {
    const PulseTachometer::Counts& pulses = *summary.pulses;
    std::printf(
        "no spindle/angle: speed by %zu pulses of daq/tachometer, %zu missing, %zu double, %zu irregular%s\n",
        pulses.pulses, pulses.missing, pulses.doubled, pulses.irregular,
        summary.tachometer_fault.empty() ? "" : ("; last: " + summary.tachometer_fault).c_str());
  }
  const double wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  std::printf("%zu cuts written to %s (no latency); %.1f s of data in %.2f s, %.0f x real time\n",
              summary.cuts, request.out.c_str(), summary.duration, wall, summary.duration / wall);
}

void run(const Request& request) {
  if (!std::filesystem::exists(request.source)) throw Error(request.source + ": cannot read");
  std::filesystem::create_directories(request.out);
  if (isRecording(request.source)) {
    fromBag(request);
  } else {
    fromCampaign(request);
  }
}

}  // namespace

namespace smartmill::kalman {

Command compensateCommand() {
  Command command("compensate", "recovers the force at the tool from the records of a force sensor");
  command.description = "Recovers the force at the tool from the records of a force sensor: one CSV per cut.";
  command.examples = {
      {"campaigns/none --identify -o forces", "sensor modes from the campaign's own taps"},
      {"session.bag --model mill.yaml -o forces", "every cut of a recorded session"},
      {"campaigns/none --method smoother -o forces", "smoother in place of the causal filter"}};
  command.files = {{"OUT/*.csv", "force of a cut: t[s],fx[N],fy[N],fz[N]"},
                   {"launch/config/kalman.yaml", "the node's parameters, for --params"}};
  command.setBody(run, [](CommandLine& line, Request& o) {
    o.program = line.program();
    line.option("SOURCE", o.source, "campaign folder, or a bag").required();
    line.option("-o,--out", o.out, "folder for one CSV per cut").required();
    line.option("--model", o.model, "model file with the force sensor (default: the campaign's)");
    line.flag("--identify", o.identify, "campaign: identify the sensor's modes from its own taps");
    line.flag("--blind", o.blind, "campaign: report the sensor's modes that the cuts show without a tap");
    line.option("--blind-low-hz", o.blind_low, "lower end of the band of --blind").showDefault();
    line.option("--blind-high-hz", o.blind_high, "upper end of the band of --blind").showDefault();
    line.flag(
        "--coupled", o.coupled,
        "campaign: sensor with its cross-talk from the campaign's own taps along x, y and z; method kalman");
    line.option("--matrix-out", o.matrix_out,
                "with --coupled: file of the matrix, for the node's parameter sensor_matrix");
    line.option(
            "--method", o.method,
            "kalman (causal, as the node), delay (as the node with `delay_form`), smoother, fixed-lag (as "
            "the node with `lag`) or inverse")
        .oneOf(kalman::methodNames())
        .showDefault();
    line.option("--lag-s", o.lag, "lag of fixed-lag [s]").within(0.0, 10.0).showDefault();
    line.option("--pulses-per-revolution", o.tachometer.pulses_per_revolution,
                "bag without spindle/angle: pulses of daq/tachometer per revolution")
        .showDefault();
    line.option("--pulse-threshold-v", o.tachometer.threshold,
                "bag without spindle/angle: voltage of daq/tachometer at which a pulse begins")
        .showDefault();
    ParameterOptions parameters(line, tableOf(o.parameters), "launch/config/kalman.yaml");
    parameters.add("--sensor", "sensor");
    parameters.add("--bandwidth-hz", "bandwidth");
    parameters.add("--noise-rms-n", "noise_rms");
    parameters.add("--settling-revolutions", "settling_revolutions");
  });
  return command;
}

}  // namespace smartmill::kalman
