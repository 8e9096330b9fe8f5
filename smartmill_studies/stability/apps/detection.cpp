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
#include "stability/detection_study.h"
#include "stability/study_request.h"
#include "study_case.h"

namespace {

using namespace smartmill;

struct Request : stability::StudyRequest {
  std::string signal = "force";
  double runout_um = 5.0, noise_n = 3.0, severity = -1.0;
  int cuts = 300, teeth = 0;
  StudyCase one;
};

MachineModel machineOf(const Request& request) {
  MachineModel model = request.machine();
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
  return model;
}

/// Counts over the cuts; errors are printed at once.
struct Tally {
  int stable = 0, alarms = 0, chattering = 0, found = 0, near = 0;
  double most_alternation = 0.0, energy_stable = 0.0, energy_chatter = 1.0;
  std::vector<double> delays;  // [revolutions]

  void add(const stability::DetectionCut& cut) { cut.chatters ? addChatter(cut) : addStable(cut); }

  void print(const std::string& signal) {
    std::sort(delays.begin(), delays.end());
    const auto percent = [](int part, int of) { return of ? 100.0 * part / of : 0.0; };
    std::printf(
        "%s: %d false alarms in %d stable cuts (%.2f %%); %d of %d chattering cuts found (%.1f %%), median "
        "%.1f revolutions after the onset; frequency within 1 %% in %d of %d (%.1f %%)\n",
        signal.c_str(), alarms, stable, percent(alarms, stable), found, chattering,
        percent(found, chattering), delays.empty() ? std::nan("") : delays[delays.size() / 2], near, found,
        percent(near, found));
    std::printf(
        "energy outside the harmonics: at most %.3f in a stable cut, at least %.3f in a chattering one\n",
        energy_stable, energy_chatter);
  }
  bool meetsTargets() const { return alarms <= 0.01 * stable && found >= 0.98 * chattering; }

 private:
  static void say(const char* what, const stability::DetectionCut& cut) {
    std::printf("%s: %.1f rpm, %.4f mm, multiplier %.4f, ", what, units::rpmFromRadPerSec(cut.speed),
                cut.depth / units::MM, cut.radius);
  }
  void addStable(const stability::DetectionCut& cut) {
    ++stable;
    most_alternation = std::max(most_alternation, cut.alternation);
    energy_stable = std::max(energy_stable, cut.energy);
    if (!cut.found) return;
    ++alarms;
    say("false alarm", cut);
    std::printf("%.1f Hz\n", cut.found_frequency);
  }
  void addChatter(const stability::DetectionCut& cut) {
    ++chattering;
    energy_chatter = std::min(energy_chatter, std::max(cut.energy, cut.alternation));
    if (!cut.found) {
      say("missed", cut);
      std::printf("%.1f Hz, alternation %.3f, energy %.3f\n", cut.frequency, cut.alternation, cut.energy);
      return;
    }
    ++found;
    if (std::isfinite(cut.onset)) delays.push_back((cut.detected - cut.onset) * cut.speed / units::TWO_PI);
    const bool right = std::abs(cut.found_frequency - cut.frequency) < 0.01 * cut.frequency;
    near += right;
    if (right) return;
    say("wrong frequency", cut);
    std::printf("%.1f Hz, the noiseless record %.1f Hz\n", cut.found_frequency, cut.frequency);
  }
};

void write(const std::vector<stability::DetectionCut>& cuts, const std::string& file) {
  std::ofstream csv(file);
  csv.precision(8);
  csv << "rpm,depth_mm,multiplier,chatters,onset_s,frequency_hz,found,detected_s,found_hz,alternation,"
         "energy\n";
  for (const stability::DetectionCut& c : cuts)
    csv << units::rpmFromRadPerSec(c.speed) << ',' << c.depth / units::MM << ',' << c.radius << ','
        << c.chatters << ',' << c.onset << ',' << c.frequency << ',' << c.found << ',' << c.detected << ','
        << c.found_frequency << ',' << c.alternation << ',' << c.energy << '\n';
  csv.close();
  if (!csv) throw Error(file + ": cannot be written");
}

nlohmann::json lineOf(int number, const stability::DetectionCut& c) {
  return {{"case", number},
          {"speed_rpm", units::rpmFromRadPerSec(c.speed)},
          {"depth_mm", c.depth / units::MM},
          {"multiplier", c.radius},
          {"chatters", c.chatters},
          {"onset_s", c.onset},
          {"frequency_hz", c.frequency},
          {"found", c.found},
          {"detected_s", c.detected},
          {"found_hz", c.found_frequency},
          {"alternation", c.alternation},
          {"energy", c.energy}};
}

stability::DetectionCut cutOf(const nlohmann::json& line) {
  stability::DetectionCut c;
  c.speed = units::radPerSecFromRpm(line.at("speed_rpm"));
  c.depth = line.at("depth_mm").get<double>() * units::MM;
  c.radius = line.at("multiplier");
  c.chatters = line.at("chatters");
  c.onset = numberOf(line, "onset_s");
  c.frequency = numberOf(line, "frequency_hz");
  c.found = line.at("found");
  c.detected = line.at("detected_s");
  c.found_frequency = numberOf(line, "found_hz");
  c.alternation = line.at("alternation");
  c.energy = line.at("energy");
  return c;
}

/// @return whether the targets are met.
bool report(const Request& request, const std::vector<stability::DetectionCut>& cuts, int teeth) {
  Tally tally;
  for (const stability::DetectionCut& cut : cuts) tally.add(cut);
  tally.print(request.signal);
  if (teeth % 2 == 0) std::printf("largest alternation of a stable cut %.3f\n", tally.most_alternation);
  if (!request.out.empty()) write(cuts, request.out);
  return tally.meetsTargets();
}

/// @return whether the targets are met.
bool run(const Request& request) {
  const MachineModel model = machineOf(request);
  const stability::RegenerativeSystem system = request.system(model);
  request.one.check(request.cuts);
  if (request.one.scores()) {
    std::vector<stability::DetectionCut> cuts;
    for (const nlohmann::json& line : readJsonLines(request.one.lines)) cuts.push_back(cutOf(line));
    return report(request, cuts, system.teeth);
  }
  stability::DetectionOptions options{request.range()};
  options.cuts = request.cuts;
  options.signal = request.signal;
  if (request.signal != "force") options.detector.least_severity = 0.0;
  if (request.severity >= 0.0) options.detector.least_severity = request.severity;
  if (request.one.one()) {
    options.cuts = 1;
    options.first = request.one.number;
    options.seed = static_cast<unsigned>(seedOfCase(options.seed, request.one.number));
    request.one.print(lineOf(request.one.number, detectionStudy(model, system, options).front()));
    return true;
  }
  const auto cuts = detectionStudy(model, system, options,
                                   [](double share) { std::fprintf(stderr, "\r%3.0f %%", 100.0 * share); });
  std::fprintf(stderr, "\n");
  return report(request, cuts, system.teeth);
}

}  // namespace

int main(int argc, char** argv) {
  Request request;
  CommandLine line{
      "Chatter detection over simulated cuts with noise, runout and sudden entry and exit. Exit code 0: at "
      "most 1 % false alarms and at least 98 % found, else 3."};
  request.addTo(line);
  request.one.addTo(line, "--cuts,--cases", request.cuts, "number of cuts");
  request.one.addScore(line);
  line.option("--teeth", request.teeth, "instead of the model's");
  line.option("--signal", request.signal, "force, vibration or sound (force)");
  line.option("--runout-um", request.runout_um, "offset of the tool's axis [um] (5)");
  line.option("--noise-n", request.noise_n, "of the force sensor, rms [N] (3)");
  line.option("--severity", request.severity, "least severity of a detection [N or unit of the signal]");
  line.option("-o,--out", request.out, "CSV of all cuts");
  return runProgram(line, argc, argv, [&] { return run(request) ? 0 : 3; });
}
