#include "commands/frf_inputs.h"

#include <cstdio>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <map>

#include "smartmill_core/error.h"
#include "smartmill_hammer/analysis/frf_pictures.h"

namespace smartmill::hammer {
namespace {

const std::map<std::string, TapFormat> FORMATS = {
    {"auto", TapFormat::automatic}, {"bag", TapFormat::bag},    {"csv", TapFormat::csv},
    {"text", TapFormat::text},      {"frf", TapFormat::frf},    {"dynoware", TapFormat::dynoware},
    {"uff", TapFormat::uff},        {"sound", TapFormat::sound}};
const std::map<std::string, FrfAverage> AVERAGES = {
    {"h1", FrfAverage::h1}, {"h2", FrfAverage::h2}, {"hv", FrfAverage::hv}};

}  // namespace

std::vector<TapFormat> formatsOf(const FrfOptions& options) {
  std::vector<TapFormat> formats;
  for (const std::string& file : options.inputs) {
    const TapFormat given = FORMATS.at(options.format);
    formats.push_back(given == TapFormat::automatic ? detectFormat(file) : given);
    if ((formats.back() == TapFormat::bag) != (formats.front() == TapFormat::bag))
      throw Error(file + ": expected the same kind of file as " + options.inputs.front());
  }
  return formats;
}

Frfs readFrfs(const FrfOptions& options, const std::vector<TapFormat>& formats) {
  double truncated_length = 0.0;
  std::vector<TapRecord> taps;
  std::vector<NamedFrf> frfs;
  for (std::size_t i = 0; i < options.inputs.size(); ++i) {
    std::cerr << "reading " << options.inputs[i] << "\n";
    TapFile file = readTapFile(options.inputs[i], formats[i], options.channels);
    std::move(file.taps.begin(), file.taps.end(), std::back_inserter(taps));
    std::move(file.frfs.begin(), file.frfs.end(), std::back_inserter(frfs));
  }
  if (!taps.empty() && !frfs.empty())
    throw Error(frfs.front().name + ": an FRF cannot be combined with hits over time");
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
    truncated_length = frf.truncated_length;
    for (const TapVerdict& v : verdicts)
      std::printf("%s: %s\n", v.file.c_str(), v.accepted() ? "accepted" : ("rejected: " + v.reason).c_str());
    const int hits = frf.receptance.averages;
    if (hits > 0) printUncertainty(options, frf.receptance);
    if (hits > 0) frfs.push_back({std::to_string(hits) + (hits == 1 ? " hit" : " hits"), frf.receptance});
    if (!options.no_picture) drawHits(taps, verdicts, options.out + "/hits.png");
  }
  writeHitsCsv(verdicts, options.out + "/hits.csv");
  if (frfs.empty())
    throw Error("no hit was accepted; " + verdicts.back().file + ": " + verdicts.back().reason);
  return {frfs, truncated_length};
}

}  // namespace smartmill::hammer
