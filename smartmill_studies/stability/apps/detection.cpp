// rosrun smartmill_studies stability_detection MODEL --entry-deg A --exit-deg B --speeds LO:HI --max-depth-mm
// D

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/model_system.h"
#include "stability/detection_study.h"

namespace {

using namespace smartmill;

struct Request {
  std::string model, speeds, out, signal = "force";
  double entry_deg = 0.0, exit_deg = 180.0, max_depth_mm = 0.0, runout_um = 5.0, noise_n = 3.0,
         severity = -1.0;
  int cuts = 300, teeth = 0;
  unsigned seed = 1;
};

/// @return whether the targets are met.
bool run(const Request& request) {
  MachineModel model = readMachineModel(request.model);
  model.needTool("simulate cuts");
  if (request.teeth > 0) {
    model.tool->teeth = request.teeth;
    model.tool->pitch.clear();
  }
  if (request.runout_um > 0.0) {
    EffectEntry runout;
    runout.name = "runout";
    runout.numbers = {{"offset_um", request.runout_um}, {"angle_deg", 40.0}};
    model.effects.push_back(runout);
  }
  model.force_sensor.noise_rms = Axes3{{request.noise_n, request.noise_n, request.noise_n}};
  const stability::RegenerativeSystem system =
      stability::systemOf(model, request.entry_deg, request.exit_deg);
  stability::DetectionOptions options;
  double low = 0.0, high = 0.0;
  char rest = 0;
  if (std::sscanf(request.speeds.c_str(), "%lf:%lf%c", &low, &high, &rest) != 2)
    throw Error("--speeds " + request.speeds + ": LO:HI is due");
  options.speed_low = units::radPerSecFromRpm(low);
  options.speed_high = units::radPerSecFromRpm(high);
  options.max_depth = request.max_depth_mm * units::MM;
  options.cuts = request.cuts;
  options.seed = request.seed;
  options.signal = request.signal;
  if (request.signal != "force") options.detector.least_severity = 0.0;
  if (request.severity >= 0.0) options.detector.least_severity = request.severity;
  const auto cuts = detectionStudy(model, system, options,
                                   [](double share) { std::fprintf(stderr, "\r%3.0f %%", 100.0 * share); });
  std::fprintf(stderr, "\n");
  int stable = 0, alarms = 0, chattering = 0, found = 0, near = 0;
  double most_stable = 0.0, energy_stable = 0.0, energy_chatter = 1.0;
  std::vector<double> delays;
  for (const stability::DetectionCut& cut : cuts) {
    if (!cut.chatters) {
      ++stable;
      alarms += cut.found;
      most_stable = std::max(most_stable, cut.alternation);
      energy_stable = std::max(energy_stable, cut.energy);
      if (cut.found)
        std::printf("false alarm: %.1f rpm, %.4f mm, multiplier %.4f, %.1f Hz\n",
                    units::rpmFromRadPerSec(cut.speed), cut.depth / units::MM, cut.radius,
                    cut.found_frequency);
      continue;
    }
    ++chattering;
    energy_chatter = std::min(energy_chatter, std::max(cut.energy, cut.alternation));
    if (!cut.found) {
      std::printf("missed: %.1f rpm, %.4f mm, multiplier %.4f, %.1f Hz, alternation %.3f, energy %.3f\n",
                  units::rpmFromRadPerSec(cut.speed), cut.depth / units::MM, cut.radius, cut.frequency,
                  cut.alternation, cut.energy);
      continue;
    }
    ++found;
    if (std::isfinite(cut.onset)) delays.push_back((cut.detected - cut.onset) * cut.speed / units::TWO_PI);
    const bool right = std::abs(cut.found_frequency - cut.frequency) < 0.01 * cut.frequency;
    near += right;
    if (!right)
      std::printf("another frequency: %.1f rpm, %.4f mm: %.1f Hz, the noiseless record %.1f Hz\n",
                  units::rpmFromRadPerSec(cut.speed), cut.depth / units::MM, cut.found_frequency,
                  cut.frequency);
  }
  std::sort(delays.begin(), delays.end());
  std::printf(
      "%s: %d false alarms in %d stable cuts (%.2f %%); %d of %d chattering cuts found (%.1f %%), median "
      "%.1f "
      "revolutions after the motion stopped repeating; frequency within 1 %% in %d of %d (%.1f %%)\n",
      request.signal.c_str(), alarms, stable, stable ? 100.0 * alarms / stable : 0.0, found, chattering,
      chattering ? 100.0 * found / chattering : 0.0,
      delays.empty() ? std::nan("") : delays[delays.size() / 2], near, found,
      found ? 100.0 * near / found : 0.0);
  std::printf(
      "energy outside the harmonics: at most %.3f in a stable cut, at least %.3f in a chattering one\n",
      energy_stable, energy_chatter);
  if (system.teeth % 2 == 0) std::printf("largest alternation of a stable cut %.3f\n", most_stable);
  if (!request.out.empty()) {
    std::ofstream csv(request.out);
    csv.precision(8);
    csv << "rpm,depth_mm,multiplier,chatters,onset_s,frequency_hz,found,detected_s,found_hz,alternation,"
           "energy\n";
    for (const stability::DetectionCut& c : cuts)
      csv << units::rpmFromRadPerSec(c.speed) << ',' << c.depth / units::MM << ',' << c.radius << ','
          << c.chatters << ',' << c.onset << ',' << c.frequency << ',' << c.found << ',' << c.detected << ','
          << c.found_frequency << ',' << c.alternation << ',' << c.energy << '\n';
    csv.close();
    if (!csv) throw Error(request.out + ": cannot be written");
  }
  return alarms <= 0.01 * stable && found >= 0.98 * chattering;
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Chatter detection over simulated cuts with noise, runout and sudden entry and exit. Exit code 0: at "
      "most 1 % "
      "false alarms and at least 98 % found, 3: not so."};
  line.option("model", request.model, "machine model file with tool, cutting and tool_tip").required();
  line.option("--entry-deg", request.entry_deg, "immersion angle at which a tooth enters [deg]").required();
  line.option("--exit-deg", request.exit_deg, "immersion angle at which a tooth leaves [deg]").required();
  line.option("--speeds", request.speeds, "LO:HI [rpm]").required();
  line.option("--max-depth-mm", request.max_depth_mm, "limits are looked for up to here [mm]").required();
  line.option("--cuts", request.cuts, "how many (300)");
  line.option("--teeth", request.teeth, "instead of the model's");
  line.option("--signal", request.signal, "force, vibration or sound (force)");
  line.option("--runout-um", request.runout_um, "offset of the tool's axis [um] (5)");
  line.option("--noise-n", request.noise_n, "of the force sensor, rms [N] (3)");
  line.option("--severity", request.severity, "least severity of a verdict [N or the signal's unit]");
  line.option("--seed", request.seed, "(1)");
  line.option("-o,--out", request.out, "CSV of all cuts");
  return runProgram(line, argc, argv, [&] { return run(request) ? 0 : 3; });
}
