// rosrun smartmill_hammer frf: FRF and modes from bags, hammer records and FRF files.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include "../src/node/bag_replay.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_hammer/analysis/frf_files.h"
#include "smartmill_hammer/analysis/frf_pictures.h"
#include "smartmill_hammer/analysis/hits_needed.h"
#include "smartmill_hammer/analysis/tap_records.h"
#include "smartmill_hammer/analysis/tip_correction.h"
#include "smartmill_ros/parameter_options.h"

namespace smartmill {
namespace hammer {
namespace {

/// FRFs drawn of many.
constexpr std::size_t MOST_PICTURES = 12;

/// Struck above the tip: the tool between, for the direct FRF there. [mm], and a standard deviation of each.
struct TipOptions {
  double stickout = 0.0, stickout_std = 0.5, diameter = 0.0, fluted = 0.0, fluted_std = 1.0;
  double flute_ratio = 0.8, flute_ratio_std = 0.03, struck = 15.0, read = 0.0;
  std::string material = "carbide";
};

struct Options {
  std::vector<std::string> inputs;
  std::string out = "frf", format = "auto", model, average = "h1";
  NodeParameters parameters;
  ChannelNames channels;
  double low = 0.0, high = 0.0, weak_force = 0.0;
  int modes = 0, max_modes = 100;
  bool real_modes = false, binary = false, no_picture = false;
  TipOptions tip;
};

const std::map<std::string, TapFormat> FORMATS = {
    {"auto", TapFormat::automatic}, {"bag", TapFormat::bag},    {"csv", TapFormat::csv},
    {"text", TapFormat::text},      {"frf", TapFormat::frf},    {"dynoware", TapFormat::dynoware},
    {"uff", TapFormat::uff},        {"sound", TapFormat::sound}};
const std::map<std::string, FrfAverage> AVERAGES = {
    {"h1", FrfAverage::h1}, {"h2", FrfAverage::h2}, {"hv", FrfAverage::hv}};

void printModes(const std::vector<EstimatedMode>& modes, bool receptance) {
  std::printf("  %-24s %-24s %-26s %s\n", "frequency [Hz]", "damping ratio [%]",
              receptance ? "stiffness [N/um]" : "gain [1]", "phase [deg]  evidence");
  for (const EstimatedMode& m : modes) {
    const Gain gain = gainOf(m, 0);
    const double shown = receptance ? 1.0 / gain.value / units::N_PER_UM : gain.value;
    std::printf("  %-24s %-24s %-26s %8.1f  %10.1f\n",
                formatted("%.3f +- %.3f", m.frequency, m.frequency_std).c_str(),
                formatted("%.4f +- %.4f", 100.0 * m.damping_ratio, 100.0 * m.damping_ratio_std).c_str(),
                formatted("%.4g +- %.2g", shown, std::abs(shown * gain.std / gain.value)).c_str(),
                units::degFromRad(gain.phase), m.evidence);
  }
}

void printEstimate(const ModalEstimate& estimate, bool receptance) {
  if (estimate.conjugated) std::printf("phase rises through the resonances: turned before the fit\n");
  std::printf("%zu modes proven\n", estimate.modes.size());
  printModes(estimate.modes, receptance);
  if (estimate.doubts.empty()) return;
  std::printf("doubts, seen but not proven:\n");
  printModes(estimate.doubts, receptance);
}

/// How well the average is known over the asked band, and how many hits would have been enough.
void printUncertainty(const Options& options, const FrequencyResponse& frf) {
  const double high = options.high > 0.0 ? options.high : frf.frequency.back();
  const double asked = options.parameters.measurement.asked_std;
  const HitsNeeded needed = hitsNeeded(frf, options.low, high, asked > 0.0 ? asked : 1.0);
  std::printf("relative standard deviation over %.0f..%.0f Hz: %.2f %% by %d hits", options.low, high,
              100.0 * needed.relative_std, needed.hits);
  if (asked > 0.0) std::printf("; for %.2f %% %d are enough", 100.0 * asked, needed.needed);
  std::printf("\n");
}

/// @param suffix of a measurement among several
void write(const Options& options, const std::string& suffix, const std::vector<NamedFrf>& frfs,
           const ModalEstimate& estimate) {
  std::filesystem::create_directories(options.out);
  const std::string folder = options.out + "/";
  std::vector<std::string> names;
  for (std::size_t o = 0; o < frfs.size(); ++o) {
    const std::string stem = folder + "frf" + suffix + (o > 0 ? "_" + std::to_string(o + 1) : "");
    writeFrfCsv(frfs[o].frf, stem + ".csv");
    writeCutPro(frfs[o].frf, stem + ".frf");
    if (!options.no_picture && o < MOST_PICTURES)
      drawFrf(frfs[o].frf, estimate, o, frfs[o].name, stem + ".png");
    names.push_back(frfs[o].name);
  }
  writeFrfUff(frfs, folder + "frf" + suffix + ".uff", options.binary);
  writeModesYaml(estimate, frfs.front().frf.unit, names, folder + "modes" + suffix + ".yaml");
  if (!options.no_picture && !estimate.diagram.empty())
    drawStabilization(frfs, estimate, folder + "stabilization" + suffix + ".png");
  std::printf("written: %sfrf%s.csv, .frf, .uff, modes%s.yaml\n", folder.c_str(), suffix.c_str(),
              suffix.c_str());
}

struct Frfs {
  std::vector<NamedFrf> frfs;
  double ringing_length = 0.0;  // [s] of hits, see TapFrf
};

/// Hits become one FRF; FRFs stay as they are.
Frfs readFrfs(const Options& options, const std::vector<TapFormat>& formats) {
  double ringing_length = 0.0;
  std::vector<TapRecord> taps;
  std::vector<NamedFrf> frfs;
  for (std::size_t i = 0; i < options.inputs.size(); ++i) {
    std::cerr << "reading " << options.inputs[i] << "\n";
    TapFile file = readTapFile(options.inputs[i], formats[i], options.channels);
    std::move(file.taps.begin(), file.taps.end(), std::back_inserter(taps));
    std::move(file.frfs.begin(), file.frfs.end(), std::back_inserter(frfs));
  }
  if (!taps.empty() && !frfs.empty()) throw Error(frfs.front().name + ": an FRF among hits over time");
  std::filesystem::create_directories(options.out);
  std::vector<TapVerdict> verdicts;
  for (const NamedFrf& frf : frfs) verdicts.push_back({frf.name, ""});
  if (!taps.empty()) {
    const HammerParameters& p = options.parameters.measurement;
    const TapFrfOptions average{{options.weak_force, p.second_hit_share, 0.0, options.high},
                                p.exponential_time,
                                AVERAGES.at(options.average)};
    const TapFrf frf = averageTaps(taps, average);
    verdicts = frf.hits;
    ringing_length = frf.ringing_length;
    for (const TapVerdict& v : verdicts)
      std::printf("%s: %s\n", v.file.c_str(), v.accepted() ? "accepted" : ("refused: " + v.reason).c_str());
    const int hits = frf.receptance.averages;
    if (hits > 0) printUncertainty(options, frf.receptance);
    if (hits > 0) frfs.push_back({std::to_string(hits) + (hits == 1 ? " hit" : " hits"), frf.receptance});
    if (!options.no_picture) drawHits(taps, verdicts, options.out + "/hits.png");
  }
  writeHitsCsv(verdicts, options.out + "/hits.csv");
  if (frfs.empty()) throw Error("no hit is left; " + verdicts.back().file + ": " + verdicts.back().reason);
  return {frfs, ringing_length};
}

/// So many modes, those with the most evidence, whether proven or not.
void keep(ModalEstimate& estimate, std::size_t count) {
  std::vector<EstimatedMode> all = estimate.modes;
  all.insert(all.end(), estimate.doubts.begin(), estimate.doubts.end());
  std::sort(all.begin(), all.end(),
            [](const EstimatedMode& a, const EstimatedMode& b) { return a.evidence > b.evidence; });
  const auto end = all.begin() + static_cast<std::ptrdiff_t>(std::min(count, all.size()));
  estimate.modes.assign(all.begin(), end);
  estimate.doubts.assign(end, all.end());
  std::sort(estimate.modes.begin(), estimate.modes.end(),
            [](const EstimatedMode& a, const EstimatedMode& b) { return a.frequency < b.frequency; });
}

ToolBeam beamOf(const TipOptions& tip) {
  ToolBeam tool;
  tool.stickout = {tip.stickout * units::MM, tip.stickout_std * units::MM};
  tool.diameter = {tip.diameter * units::MM, 0.02 * units::MM};
  tool.fluted_length = {tip.fluted * units::MM, tip.fluted_std * units::MM};
  tool.flute_ratio = {tip.flute_ratio, tip.flute_ratio_std};
  setMaterial(tool, tip.material);
  return tool;
}

/// The direct FRF at the tip beside the measured one: frf_tip.csv, modes_tip.yaml.
void writeTip(const Options& options, const FrequencyResponse& frf, const ModalEstimate& estimate) {
  OffsetMeasurement at{options.tip.struck * units::MM, options.tip.read * units::MM, {}};
  for (const EstimatedMode& m : estimate.modes) {
    const Gain gain = gainOf(m, 0);
    at.modes.modes.push_back(
        {m.frequency, m.damping_ratio, gain.value, m.frequency_std, m.damping_ratio_std, gain.std});
  }
  at.modes.direct = estimate.flanks.front().upper.real();
  const double high = options.high > 0.0 ? options.high : std::min(5000.0, frf.frequency.back());
  const TipCorrection tip = correctToTip({at}, beamOf(options.tip), {}, high);
  std::printf("at the tip (struck %.1f mm above it, read %.1f mm):\n", options.tip.struck, options.tip.read);
  for (const TipMode& m : tip.modes) {
    std::printf("  %9.2f Hz  %-26s ", m.direct.frequency,
                formatted("%.4g +- %.2g N/um", 1.0 / m.direct.gain / units::N_PER_UM,
                          m.direct.gain_std / std::pow(m.direct.gain, 2) / units::N_PER_UM)
                    .c_str());
    std::printf("%s\n", m.seen ? formatted("gain x %.3f +- %.3f", m.factor, m.factor_std).c_str()
                               : "told by the beam alone");
  }
  writeFrfCsv(tipResponse(frf, tip), options.out + "/frf_tip.csv");
  writeModesYaml(estimateOf(tip.model()), frf.unit, {"tool tip"}, options.out + "/modes_tip.yaml");
}

void runFiles(const Options& options, const std::vector<TapFormat>& formats) {
  const auto [frfs, ringing_length] = readFrfs(options, formats);
  const bool receptance = frfs.front().frf.unit == "m/N";
  std::vector<FrequencyResponse> all;
  for (const NamedFrf& frf : frfs) all.push_back(frf.frf);
  ModalEstimateOptions search;
  search.low = options.low;
  search.high = options.high;
  search.max_modes = options.max_modes;
  search.real_modes = options.real_modes;
  int told = -1;
  search.progress = [&told](double share) {
    const int percent = static_cast<int>(10.0 * share) * 10;
    if (percent > told) std::cerr << "modes: " << (told = percent) << " %\n";
    return true;
  };
  ModalEstimate estimate;
  try {
    estimate = estimateModes(all, search);
  } catch (const Error& error) {
    throw Error(options.inputs.front() + ": " + error.what());
  }
  if (options.modes > 0) keep(estimate, static_cast<std::size_t>(options.modes));
  const double window = options.parameters.measurement.exponential_time;
  for (std::vector<EstimatedMode>* modes : {&estimate.modes, &estimate.doubts}) {
    // The exponential window's own damping.
    for (EstimatedMode& m : *modes)
      m.damping_ratio -= window > 0.0 ? 1.0 / (window * units::TWO_PI * m.frequency) : 0.0;
  }
  // Pictures show the FRF as it was measured, cut decay and all.
  ModalEstimate whole = estimate;
  removeCut(whole.modes, ringing_length);
  removeCut(whole.doubts, ringing_length);
  if (ringing_length > 0.0)
    std::printf(
        "the response rings on at the record's end: poles as they are, gains with the cut's share taken "
        "off\n");
  printEstimate(whole, receptance);
  write(options, "", frfs, estimate);
  if (ringing_length > 0.0)
    writeModesYaml(whole, frfs.front().frf.unit, {frfs.front().name}, options.out + "/modes.yaml");
  if (options.tip.stickout > 0.0) {
    if (!receptance || frfs.size() > 1) throw Error("--stickout-mm: one receptance is due");
    writeTip(options, frfs.front().frf, whole);
  }
}

/// A cross FRF and the direct one of the same blows, fitted together: one set of poles, gains of both.
void writeCross(const Options& options, const MeasureFrfResult& result, const NamedFrf& direct) {
  ModalEstimateOptions search;
  search.low = options.parameters.measurement.fit_low;
  search.high = options.parameters.measurement.fit_high;
  search.max_modes = options.max_modes;
  const NamedFrf cross{"tool tip " + result.cross.direction, result.cross.frf};
  const ModalEstimate both = estimateModes({cross.frf, direct.frf}, search);
  std::printf("  %s together with %s: ", result.cross.direction.c_str(), result.frf.direction.c_str());
  printEstimate(both, true);
  write(options, "_" + result.cross.direction, {cross, direct}, both);
}

void runBag(const Options& options) {
  if (options.inputs.size() != 1) throw Error(options.inputs[1] + ": one bag at a time");
  if (options.model.empty()) throw Error("--model: a bag needs the machine model that the session ran with");
  const std::vector<MeasureFrfResult> results =
      replayBag(options.inputs[0], options.model, options.parameters);
  if (results.empty()) throw Error(options.inputs[0] + ": holds no goal of hammer/measure_frf");
  int good = 0;
  std::vector<TapVerdict> verdicts;
  for (const MeasureFrfResult& result : results) {
    std::printf("%s %s: %s\n", result.frf.tool.c_str(), result.frf.direction.c_str(), result.message.c_str());
    const bool ok = result.code == FrfCode::ok;
    verdicts.push_back({options.inputs[0] + ":" + result.frf.direction, ok ? "" : result.message});
    if (!ok) continue;
    std::printf("  sensitivity %.4f +- %.4f um/V, flute at the hammer %.2f deg\n",
                result.sensitivity / units::UM, result.sensitivity_std / units::UM,
                units::degFromRad(result.flute_hammer));
    const ModalEstimate estimate = estimateOf(result.modes.model);
    printModes(estimate.modes, true);
    const NamedFrf frf{
        "tool tip " + result.frf.direction + ", " + std::to_string(result.frf.frf.averages) + " hits",
        result.frf.frf};
    write(options, "_" + result.frf.direction, {frf}, estimate);
    if (++good == 1) write(options, "", {frf}, estimate);
    if (result.cross.frf.size() > 0) writeCross(options, result, frf);
  }
  std::filesystem::create_directories(options.out);
  writeHitsCsv(verdicts, options.out + "/hits.csv");
  if (good == 0)
    throw Error(options.inputs[0] + ": no measurement came to its end; the last: " + results.back().message);
}

void addChannels(const CommandOptions& line, ChannelNames& channels) {
  line.option("--force-channel", channels.force, "column or channel of the hammer, where it is not named so");
  line.option("--response-channel", channels.response, "column or channel of the response");
  line.option("--sound-channels", channels.sound,
              "of WAV, FLAC or AIFF: NUMBER:NAME=SCALE,..., what full scale is in SI units, e.g. "
              "1:hammer=2000,2:acceleration=500");
}

void run(const Options& options) {
  std::vector<TapFormat> formats;
  for (const std::string& file : options.inputs) {
    const TapFormat given = FORMATS.at(options.format);
    formats.push_back(given == TapFormat::automatic ? detectFormat(file) : given);
    if ((formats.back() == TapFormat::bag) != (formats.front() == TapFormat::bag))
      throw Error(file + ": another kind of file than " + options.inputs.front());
  }
  if (options.high > 0.0 && !(options.high > options.low))
    throw Error("--high: " + std::to_string(options.high) + " is not above --low");
  if (formats.front() == TapFormat::bag) {
    runBag(options);
  } else {
    runFiles(options, formats);
  }
}

}  // namespace
}  // namespace hammer
}  // namespace smartmill

int main(int argc, char** argv) {
  using smartmill::hammer::FORMATS;
  smartmill::hammer::Options o;
  smartmill::CommandLine line(
      "Frequency response and modes from hammer tests: hits of one point (CSV with time[s],hammer[N] and "
      "acceleration[m/s2], "
      "displacement[m] or a force; DynoWare; universal file 58; three columns without header), measured FRFs "
      "(universal file 58, "
      "frf.csv, three columns Hz, Re, Im), fitted together with common poles, or a recorded session (bag).");
  line.option("input", o.inputs,
              "files; hammer records are averaged as hits of one point, FRFs are fitted together")
      .required();
  line.option("-o,--out", o.out, "folder for frf.csv, frf.frf, frf.uff, modes.yaml, hits.csv and pictures")
      .showDefault();
  line.option("--format", o.format, "auto (by content), bag, csv, dynoware, frf, sound, text or uff")
      .oneOf({"auto", "bag", "csv", "dynoware", "frf", "sound", "text", "uff"})
      .showDefault();
  line.option("--low", o.low, "modes from here [Hz] (bags: fit_low of --params)").notNegative();
  line.option("--high", o.high, "to here [Hz], up to where hits must have force; 0: the whole record")
      .notNegative();
  line.option("--modes", o.modes, "so many, those with the most evidence; 0: as many as are proven")
      .within(0, 200);
  line.option("--max-modes", o.max_modes, "at most, when the data decide").within(1, 200).showDefault();
  line.flag("--real-modes", o.real_modes, "proportional damping: gains without phase");
  line.option("--average", o.average, "of hits: h1, h2 or hv").oneOf({"h1", "h2", "hv"}).showDefault();
  line.option("--weak-force", o.weak_force, "[N] a lower peak is no hit; 0: told by the noise").notNegative();
  smartmill::hammer::addChannels(line, o.channels);
  line.option("--stickout-mm", o.tip.stickout,
              "tool out of the holder: the direct FRF at the tip, of one struck above it")
      .notNegative();
  line.option("--stickout-std-mm", o.tip.stickout_std, "standard deviation").notNegative().showDefault();
  line.option("--diameter-mm", o.tip.diameter, "of the shank").notNegative();
  line.option("--fluted-mm", o.tip.fluted, "fluted length from the tip").notNegative();
  line.option("--fluted-std-mm", o.tip.fluted_std, "standard deviation").notNegative().showDefault();
  line.option("--flute-ratio", o.tip.flute_ratio,
              "diameter of a round bar as stiff as the fluted part, over the shank's")
      .within(0.1, 1.0)
      .showDefault();
  line.option("--flute-ratio-std", o.tip.flute_ratio_std, "standard deviation").notNegative().showDefault();
  line.option("--material", o.tip.material, "of the tool: carbide or steel")
      .oneOf({"carbide", "steel"})
      .showDefault();
  line.option("--struck-mm", o.tip.struck, "above the tip").notNegative().showDefault();
  line.option("--read-mm", o.tip.read, "above the tip").notNegative().showDefault();
  line.flag("--binary", o.binary, "frf.uff with binary values (58b)");
  line.option("--model", o.model, "machine model (bags)");
  const smartmill::ParameterTable table = smartmill::tableOf(o.parameters);
  smartmill::ParameterOptions parameters(line, table, "launch/config/hammer.yaml");
  parameters.add("--second-hit-share", "second_hit_share");
  parameters.add("--exponential-time", "exponential_time");
  parameters.add("--asked-std", "asked_std");
  line.flag("--no-picture", o.no_picture, "no PNG");
  return runProgram(line, argc, argv, [&] {
    parameters.apply();
    o.parameters.validate();
    smartmill::hammer::run(o);
  });
}
