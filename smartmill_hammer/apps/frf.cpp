// rosrun smartmill_hammer frf: FRF and modes from bags, hammer records and FRF files.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "../src/node/bag_replay.h"
#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_hammer/analysis/tap_records.h"
#include "smartmill_ros/parameter_options.h"

namespace smartmill {
namespace hammer {
namespace {

struct Options {
  std::vector<std::string> inputs;
  std::string out = "frf", format = "auto", model;
  NodeParameters parameters;
  double low = 500.0, high = 3500.0, peak_share = 0.02;
  int modes = 0, max_modes = 8, max_peaks = 20;
  bool mass_line = false, no_picture = false;
};

const std::map<std::string, TapFormat> FORMATS = {{"auto", TapFormat::automatic},
                                                  {"bag", TapFormat::bag},
                                                  {"csv", TapFormat::csv},
                                                  {"text", TapFormat::text},
                                                  {"frf", TapFormat::frf}};

/// A row's plus-minus, where it is known.
std::string pm(const char* format, double value, double std) {
  char text[80];
  std::snprintf(text, sizeof text, format, value, std);
  return text;
}

void printModes(const std::vector<ModeReading>& rows) {
  std::printf("  %-22s %-22s %-24s %s\n", "frequency [Hz]", "damping ratio [%]", "stiffness [N/um]",
              "Im receptance [um/N]");
  for (const ModeReading& row : rows) {
    const Mode& m = row.mode;
    const double stiffness = 1.0 / m.gain / units::N_PER_UM;
    std::printf("  %-22s %-22s %-24s %.4f\n", pm("%.2f +- %.2f", m.frequency, m.frequency_std).c_str(),
                pm("%.3f +- %.3f", 100.0 * m.damping_ratio, 100.0 * m.damping_ratio_std).c_str(),
                pm("%.3f +- %.3f", stiffness, std::abs(stiffness * m.gain_std / m.gain)).c_str(),
                row.receptance.imag() / units::UM);
  }
}

void write(const Options& options, const std::string& suffix, const std::string& title,
           const FrequencyResponse& receptance, const ModalModel& model, double low, double high) {
  std::filesystem::create_directories(options.out);
  const std::string stem = options.out + "/frf" + suffix;
  writeFrfCsv(receptance, model, stem + ".csv");
  writeModesCsv(model, options.out + "/modes" + suffix + ".csv");
  std::printf("  written: %s.csv, %s/modes%s.csv", stem.c_str(), options.out.c_str(), suffix.c_str());
  if (!options.no_picture) {
    const bool coherent = receptance.averages > 1 && !receptance.coherence.empty();
    plotFrf(stem + ".csv", stem + ".png", title, low, high, coherent);
    std::printf(", %s.png", stem.c_str());
  }
  std::printf("\n");
}

/// What the files hold: the receptance, and the response in which peaks are read.
struct Response {
  FrequencyResponse receptance, peaks_of;
  std::string title;
};

Response readResponse(const Options& options, TapFormat format) {
  if (format == TapFormat::frf) {
    if (options.inputs.size() != 1) throw Error(options.inputs[1] + ": one FRF file at a time");
    const FrequencyResponse read = readFrfText(options.inputs[0]);
    return {read, read, std::filesystem::path(options.inputs[0]).filename().string()};
  }
  std::vector<TapRecord> taps;
  for (const std::string& file : options.inputs) {
    std::cerr << "reading " << file << "\n";
    taps.push_back(format == TapFormat::csv ? readTapCsv(file) : readTapText(file));
  }
  const HammerParameters& parameters = options.parameters.measurement;
  const TapFrf frf = averageTaps(taps, {parameters.weak_force, parameters.second_hit_share, 0.0},
                                 parameters.exponential_time);
  for (const std::string& note : frf.notes) std::cerr << "frf: " << note << "\n";
  const int hits = frf.receptance.averages;
  return {frf.receptance, frf.measured, std::to_string(hits) + (hits == 1 ? " hit" : " hits")};
}

void printPeaks(const Options& options, const FrequencyResponse& response) {
  std::printf("peaks of %s, %g..%g Hz (prominence above %g of the largest):\n",
              response.unit == "m/N" ? "the receptance" : "the accelerance", options.low, options.high,
              options.peak_share);
  std::vector<double> peaks =
      findPeaks(response, options.low, options.high, options.peak_share);  // strongest first
  if (peaks.size() > static_cast<std::size_t>(options.max_peaks))
    peaks.resize(static_cast<std::size_t>(options.max_peaks));
  std::sort(peaks.begin(), peaks.end());
  for (const double f : peaks) {
    std::printf("  %9.2f Hz  |H| %11.5g %s\n", f, std::abs(response.at(f)), response.unit.c_str());
  }
}

// All modes at once, without the damping of the exponential window.
ModalFit fitTogether(const Options& options, const FrequencyResponse& receptance) {
  ModalFitOptions fit_options;
  fit_options.low = options.low;
  fit_options.high = options.high;
  fit_options.modes = options.modes;
  fit_options.max_modes = options.max_modes;
  fit_options.fit_mass_line = options.mass_line;
  fit_options.positive_gains = looksDirect(receptance, options.low, options.high);
  ModalFit fit = fitModes(receptance, fit_options);
  if (options.parameters.measurement.exponential_time > 0.0) {
    ImpactOptions window;
    window.exponential_time = options.parameters.measurement.exponential_time;
    ImpactAnalysis(window).removeWindowDamping(fit.model);
  }
  std::printf("modes fitted together (%serror of the fit %.1f %% of the receptance in the band):\n",
              fit_options.positive_gains ? "direct point, gains kept positive; " : "",
              100.0 * fit.relative_error);
  return fit;
}

void runTaps(const Options& options, TapFormat format) {
  const Response response = readResponse(options, format);
  const FrequencyResponse& receptance = response.receptance;
  std::printf("%s\n", response.title.c_str());
  printPeaks(options, response.peaks_of);
  std::cerr << "fitting modes\n";
  std::printf(
      "modes at the peaks of |Im| of the receptance, each fitted alone above its half-power height:\n");
  const std::vector<ModeReading> peak_modes = peakModes(
      receptance, options.low, options.high, options.peak_share, static_cast<std::size_t>(options.max_peaks));
  printModes(peak_modes);
  const ModalFit fit = fitTogether(options, receptance);
  printModes(readModes(fit.model, receptance));
  write(options, "", response.title, receptance, fit.model, options.low, options.high);
  ModalModel alone;
  for (const ModeReading& row : peak_modes) alone.modes.push_back(row.mode);
  writeModesCsv(alone, options.out + "/peak_modes.csv");
  std::printf("           %s/peak_modes.csv (modes fitted alone)\n", options.out.c_str());
}

void runBag(const Options& options) {
  if (options.inputs.size() != 1) throw Error(options.inputs[1] + ": one bag at a time");
  if (options.model.empty()) throw Error("--model: a bag needs the machine model that the session ran with");
  const std::vector<MeasureFrfResult> results =
      replayBag(options.inputs[0], options.model, options.parameters);
  if (results.empty()) throw Error(options.inputs[0] + ": holds no goal of hammer/measure_frf");
  int good = 0;
  for (const MeasureFrfResult& result : results) {
    std::printf("%s %s: %s\n", result.frf.tool.c_str(), result.frf.direction.c_str(), result.message.c_str());
    if (result.code != FrfCode::ok) continue;
    ++good;
    std::printf("  sensitivity %.4f +- %.4f um/V, flute at the hammer %.2f deg\n",
                result.sensitivity / units::UM, result.sensitivity_std / units::UM,
                units::degFromRad(result.flute_hammer));
    printModes(readModes(result.modes.model, result.frf.frf));
    write(options, "_" + result.frf.direction,
          "tool tip " + result.frf.direction + ", " + std::to_string(result.frf.frf.averages) + " hits",
          result.frf.frf, result.modes.model, options.parameters.measurement.fit_low,
          options.parameters.measurement.fit_high);
  }
  if (good == 0)
    throw Error(options.inputs[0] + ": no measurement came to its end; the last: " + results.back().message);
}

void run(const Options& options) {
  TapFormat format = FORMATS.at(options.format);
  if (format == TapFormat::automatic) {
    format = detectFormat(options.inputs.front());
    for (const std::string& file : options.inputs) {
      if (detectFormat(file) != format)
        throw Error(file + ": another kind of file than " + options.inputs.front());
    }
  }
  if (!(options.high > options.low))
    throw Error("--high: " + std::to_string(options.high) + " is not above --low");
  if (format == TapFormat::bag) {
    runBag(options);
  } else {
    runTaps(options, format);
  }
}

}  // namespace
}  // namespace hammer
}  // namespace smartmill

int main(int argc, char** argv) {
  using smartmill::hammer::FORMATS;
  smartmill::hammer::Options o;
  smartmill::CommandLine line(
      "Frequency response and modes from hammer tests: a recorded session (bag), hammer records of one point "
      "(CSV with "
      "time[s],hammer[N],acceleration[m/s2] or displacement[m]; or three columns without header), or a "
      "measured receptance "
      "(three columns Hz, Re, Im in m/N).");
  line.option("input", o.inputs, "files; several hammer records are averaged as hits of one point")
      .required();
  line.option("-o,--out", o.out, "folder for frf.csv, modes.csv and frf.png").showDefault();
  line.option("--format", o.format, "auto (by content), bag, csv, text or frf")
      .oneOf({"auto", "bag", "csv", "text", "frf"})
      .showDefault();
  line.option("--low", o.low, "fit from here [Hz] (bags: fit_low of --params)").showDefault();
  line.option("--high", o.high, "to here [Hz]").showDefault();
  line.option("--modes", o.modes, "modes to fit; 0: as many as the data prove").within(0, 20);
  line.option("--max-modes", o.max_modes, "at most, when the data decide").within(1, 20).showDefault();
  line.flag("--mass-line", o.mass_line, "free structure: fit a rigid-body mass line too");
  line.option("--peak-share", o.peak_share, "least prominence of a listed peak, of the largest")
      .showDefault();
  line.option("--max-peaks", o.max_peaks, "strongest peaks kept").within(1, 1000).showDefault();
  line.option("--model", o.model, "machine model (bags)");
  const smartmill::ParameterTable table = smartmill::tableOf(o.parameters);
  smartmill::ParameterOptions parameters(line, table, "launch/config/hammer.yaml");
  parameters.add("--weak-force", "weak_force");
  parameters.add("--second-hit-share", "second_hit_share");
  parameters.add("--exponential-time", "exponential_time");
  line.flag("--no-picture", o.no_picture, "no PNG");
  return runProgram(line, argc, argv, [&] {
    parameters.apply();
    o.parameters.validate();
    smartmill::hammer::run(o);
  });
}
