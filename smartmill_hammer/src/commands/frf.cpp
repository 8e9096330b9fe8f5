#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "commands/frf_inputs.h"
#include "commands/frf_results.h"
#include "recordings/bag_replay.h"
#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_options.h"
#include "smartmill_core/units.h"
#include "smartmill_hammer/commands.h"

namespace smartmill::hammer {
namespace {

/// Keeps the modes with the most evidence, proven or not.
void keepStrongest(ModalEstimate& estimate, std::size_t count) {
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

void runFiles(const FrfOptions& options, const std::vector<TapFormat>& formats) {
  const auto [frfs, truncated_length] = readFrfs(options, formats);
  const bool receptance = frfs.front().frf.unit == "m/N";
  std::vector<FrequencyResponse> all;
  for (const NamedFrf& frf : frfs) all.push_back(frf.frf);
  ModalEstimateOptions search;
  search.low = options.low;
  search.high = options.high;
  search.max_modes = options.max_modes;
  search.real_modes = options.real_modes;
  int reported = -1;
  search.progress = [&reported](double share) {
    const int percent = static_cast<int>(10.0 * share) * 10;
    if (percent > reported) std::cerr << "modes: " << (reported = percent) << " %\n";
    return true;
  };
  ModalEstimate estimate;
  try {
    estimate = estimateModes(all, search);
  } catch (const Error& error) {
    throw Error(options.inputs.front() + ": " + error.what());
  }
  if (options.modes > 0) keepStrongest(estimate, static_cast<std::size_t>(options.modes));
  const double window = options.parameters.measurement.exponential_time;
  for (std::vector<EstimatedMode>* modes : {&estimate.modes, &estimate.doubts}) {
    // The damping of the exponential window.
    for (EstimatedMode& m : *modes)
      m.damping_ratio -= window > 0.0 ? 1.0 / (window * units::TWO_PI * m.frequency) : 0.0;
  }
  // Plots show the FRF as measured, with the truncated decay.
  ModalEstimate whole = estimate;
  correctTruncation(whole.modes, truncated_length);
  correctTruncation(whole.doubts, truncated_length);
  if (truncated_length > 0.0)
    std::printf(
        "the response has not decayed at the end of the record: the gains are corrected for the "
        "truncation\n");
  printEstimate(whole, receptance);
  writeResults(options, "", frfs, estimate);
  if (truncated_length > 0.0)
    writeModesYaml(whole, frfs.front().frf.unit, {frfs.front().name}, options.out + "/modes.yaml");
  if (options.tip.stickout > 0.0) {
    if (!receptance || frfs.size() > 1) throw Error("--stickout-mm: expected a single receptance");
    writeTip(options, frfs.front().frf, whole);
  }
}

/// A cross FRF and the direct one of the same hits, fitted together with common poles.
void writeCross(const FrfOptions& options, const MeasureFrfResult& result, const NamedFrf& direct) {
  ModalEstimateOptions search;
  search.low = options.parameters.measurement.fit_low;
  search.high = options.parameters.measurement.fit_high;
  search.max_modes = options.max_modes;
  const NamedFrf cross{"tool tip " + result.cross.direction, result.cross.frf};
  const ModalEstimate both = estimateModes({cross.frf, direct.frf}, search);
  std::printf("  %s together with %s: ", result.cross.direction.c_str(), result.frf.direction.c_str());
  printEstimate(both, true);
  writeResults(options, "_" + result.cross.direction, {cross, direct}, both);
}

void runBag(const FrfOptions& options) {
  if (options.inputs.size() != 1) throw Error(options.inputs[1] + ": expected a single bag");
  if (options.model.empty()) throw Error("--model: expected the machine model of the recorded session");
  const std::vector<MeasureFrfResult> results =
      replayBag(options.inputs[0], options.model, options.parameters);
  if (results.empty()) throw Error(options.inputs[0] + ": no goal of hammer/measure_frf found");
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
    writeResults(options, "_" + result.frf.direction, {frf}, estimate);
    if (++good == 1) writeResults(options, "", {frf}, estimate);
    if (result.cross.frf.size() > 0) writeCross(options, result, frf);
  }
  std::filesystem::create_directories(options.out);
  writeHitsCsv(verdicts, options.out + "/hits.csv");
  if (good == 0)
    throw Error(options.inputs[0] + ": no measurement was completed; the last: " + results.back().message);
}

void run(const FrfOptions& options) {
  options.parameters.validate();
  const std::vector<TapFormat> formats = formatsOf(options);
  if (options.high > 0.0 && !(options.high > options.low))
    throw Error("--high: " + std::to_string(options.high) + " is not above --low");
  if (formats.front() == TapFormat::bag) {
    runBag(options);
  } else {
    runFiles(options, formats);
  }
}

void addChannels(const CommandOptions& line, ChannelNames& channels) {
  line.option("--force-channel", channels.force, "column or channel of the hammer, if not named hammer");
  line.option("--response-channel", channels.response, "column or channel of the response");
  line.option("--sound-channels", channels.sound,
              "WAV, FLAC or AIFF: NUMBER:NAME=SCALE,..., full scale in SI units, e.g. "
              "1:hammer=2000,2:acceleration=500");
}

void addTip(const CommandOptions& line, TipOptions& tip) {
  line.option("--stickout-mm", tip.stickout,
              "length of the tool out of the holder: computes the direct FRF at the tip of a tool struck "
              "above it")
      .notNegative();
  line.option("--stickout-std-mm", tip.stickout_std, "its standard deviation").notNegative().showDefault();
  line.option("--diameter-mm", tip.diameter, "diameter of the shank").notNegative();
  line.option("--fluted-mm", tip.fluted, "fluted length from the tip").notNegative();
  line.option("--fluted-std-mm", tip.fluted_std, "its standard deviation").notNegative().showDefault();
  line.option("--flute-ratio", tip.flute_ratio,
              "diameter of a round bar as stiff as the fluted part, over the shank's")
      .within(0.1, 1.0)
      .showDefault();
  line.option("--flute-ratio-std", tip.flute_ratio_std, "its standard deviation").notNegative().showDefault();
  line.option("--material", tip.material, "material of the tool").oneOf({"carbide", "steel"}).showDefault();
  line.option("--struck-mm", tip.struck, "height of the struck point above the tip")
      .notNegative()
      .showDefault();
  line.option("--read-mm", tip.read, "height of the response above the tip").notNegative().showDefault();
}

void addOptions(CommandLine& line, FrfOptions& o) {
  line.option("INPUT", o.inputs,
              "files; hammer records are averaged as hits of one point, FRFs are fitted with common poles")
      .required();
  line.option("-o,--out", o.out, "folder for frf.csv, frf.frf, frf.uff, modes.yaml, hits.csv and pictures")
      .showDefault();
  line.option("--format", o.format, "auto (by content), bag, csv, dynoware, frf, sound, text or uff")
      .oneOf({"auto", "bag", "csv", "dynoware", "frf", "sound", "text", "uff"})
      .showDefault();
  line.option("--low", o.low, "lower end of the band of modes [Hz] (bags: fit_low of --params)")
      .notNegative();
  line.option("--high", o.high,
              "upper end [Hz], up to which the force of a hit must have power; 0: the whole record")
      .notNegative();
  line.option("--modes", o.modes, "number of modes, those with the most evidence; 0: all proven ones")
      .within(0, 200);
  line.option("--max-modes", o.max_modes, "largest number of proven modes").within(1, 200).showDefault();
  line.flag("--real-modes", o.real_modes, "proportional damping: gains without phase");
  line.option("--average", o.average, "average of hits").oneOf({"h1", "h2", "hv"}).showDefault();
  line.option("--weak-force", o.weak_force, "[N] hits with a lower peak are rejected; 0: from the noise")
      .notNegative();
  addChannels(line, o.channels);
  addTip(line, o.tip);
  line.flag("--binary", o.binary, "frf.uff with binary values (58b)");
  line.option("--model", o.model, "machine model (bags)");
  ParameterOptions parameters(line, tableOf(o.parameters), "launch/config/hammer.yaml");
  parameters.add("--second-hit-share", "second_hit_share");
  parameters.add("--exponential-time", "exponential_time");
  parameters.add("--asked-std", "asked_std");
  line.flag("--no-picture", o.no_picture, "no PNG files");
}

}  // namespace

smartmill::Command frfCommand() {
  smartmill::Command command("frf", "estimates FRF and modes from hammer tests");
  command.description =
      "Frequency response and modes from hammer tests: hits of one point (CSV with time[s],hammer[N] and "
      "acceleration[m/s2], displacement[m] or a force; DynoWare; universal file 58; three columns without "
      "header), measured FRFs (universal file 58, frf.csv, three columns Hz, Re, Im), fitted together with "
      "common poles, or a recorded session (bag).";
  command.examples = {{"hit1.csv hit2.csv hit3.csv -o frf", "averages three hits and fits the proven modes"},
                      {"point1.uff point2.uff --high 3000 -o frf", "fits FRFs with common poles up to 3 kHz"},
                      {"session.bag --model mill.yaml -o frf", "the measurements of a recorded session"}};
  command.files = {{"OUT/frf.csv, frf.frf, frf.uff", "the averaged FRF"},
                   {"OUT/modes.yaml", "modes with standard deviations"},
                   {"OUT/hits.csv", "the verdict on every hit"},
                   {"launch/config/hammer.yaml", "the node's parameters, for --params"}};
  command.setBody(run, addOptions);
  return command;
}

}  // namespace smartmill::hammer
