#include "stability/detection_study.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "smartmill_core/error.h"
#include "smartmill_stability_testing/cut_streams.h"
#include "stability/twin_agreement.h"

namespace smartmill::stability {
namespace {

constexpr int SAMPLES = 180, REVOLUTIONS = 150, AIR = 10, LATE = 60;
constexpr std::size_t BLOCK = 256;
constexpr double FEED = 0.1e-3;  // [m] per tooth
constexpr double STILL = 0.05;   // [1] of the feed per tooth: changes of the motion below it are ignored

/// Up to three channels of a record as from the sensor of the detector.
std::vector<std::vector<double>> signalOf(const Record& record, const std::string& kind, double rate) {
  if (kind == "force") return {record.column("fx"), record.column("fy"), record.column("fz")};
  std::vector<std::vector<double>> acceleration;
  for (const char* axis : {"tool_x", "tool_y"}) {
    const std::vector<double>& u = record.column(axis);
    std::vector<double> a(u.size(), 0.0);
    for (std::size_t i = 1; i + 1 < u.size(); ++i) a[i] = (u[i + 1] - 2.0 * u[i] + u[i - 1]) * rate * rate;
    acceleration.push_back(a);
  }
  if (kind == "vibration") return acceleration;
  if (kind != "sound") throw Error("signal " + kind + ": expected force, vibration or sound");
  // A rigid vibrating body radiates pressure in proportion to its acceleration; the microphone records both
  // axes.
  std::vector<double> pressure(acceleration[0].size());
  for (std::size_t i = 0; i < pressure.size(); ++i)
    pressure[i] = 1e-3 * (acceleration[0][i] + 0.6 * acceleration[1][i]);
  return {pressure};
}

/// The last revolutions of a record, complete periods.
std::vector<std::vector<double>> lateOf(std::vector<std::vector<double>> signal, std::size_t period) {
  const std::size_t count = LATE * static_cast<std::size_t>(SAMPLES) / period * period;
  for (std::vector<double>& channel : signal)
    channel.erase(channel.begin(), channel.end() - static_cast<std::ptrdiff_t>(count));
  return signal;
}

/// Noise RMS of each channel; that of the force is already in the record.
std::vector<double> noiseOf(const std::vector<std::vector<double>>& signal, const DetectionOptions& options) {
  std::vector<double> sigma;
  for (const std::vector<double>& channel : signal) {
    double squares = 0.0;
    for (const double v : channel) squares += v * v / static_cast<double>(channel.size());
    sigma.push_back(options.signal == "force" ? 0.0 : options.signal_noise * std::sqrt(squares));
  }
  return sigma;
}

/// Runs the detector over the record.
std::vector<ChatterState> verdicts(const std::vector<std::vector<double>>& signal, const DetectionCut& cut,
                                   const MachineModel& model, const DetectionOptions& options, double rate,
                                   unsigned seed) {
  std::vector<ChatterState> states;
  ChatterDetector detector(options.detector, [&](const ChatterState& state) { states.push_back(state); });
  const std::size_t cutting = signal[0].size();
  CutStreams streams(detector, cut.speed, *model.tool);
  const std::vector<double> sigma = noiseOf(signal, options);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  SampleBlock block;
  block.sample_rate = rate;
  for (std::size_t c = 0; c < signal.size(); ++c) {
    block.channels.push_back("channel_" + std::to_string(c));
    block.units.emplace_back("1");
  }
  // Then the tool leaves the stock and the sensors contain only noise.
  const std::size_t total = cutting + static_cast<std::size_t>(AIR * SAMPLES);
  for (std::size_t i = 0; i < total; ++i) {
    const double t = static_cast<double>(i) / rate;
    streams.at(t, t >= AIR * units::TWO_PI / cut.speed && i < cutting);
    for (std::size_t c = 0; c < signal.size(); ++c)
      block.samples.push_back((i < cutting ? signal[c][i] : 0.0) + sigma[c] * normal(random));
    if (block.size() == BLOCK) {
      block.stamp = static_cast<double>(i + 1 - BLOCK) / rate;
      detector.handle(signalBlock(block));
      block.first_index += BLOCK;
      block.samples.clear();
    }
  }
  return states;
}

/// Cuts clearly below and clearly above their limit, alternating.
std::vector<DetectionCut> drawCuts(const RegenerativeSystem& system, const DetectionOptions& options) {
  const auto solver = makeFloquetSolver(Method::collocation, system);
  std::mt19937_64 random(options.seed);
  std::uniform_real_distribution<double> unit;
  std::vector<DetectionCut> cuts;
  for (int tries = 0; static_cast<int>(cuts.size()) < options.cuts; ++tries) {
    if (tries > 100 * options.cuts + 1000) throw Error("detection study: no cuts near the limit found");
    DetectionCut cut;
    cut.speed = options.speed_low + (options.speed_high - options.speed_low) * unit(random);
    const double limit = solver->limit(cut.speed, options.max_depth).depth;
    const double share = unit(random);
    if (!std::isfinite(limit)) continue;
    const bool below = (cuts.size() + static_cast<std::size_t>(options.first)) % 2 == 1;
    cut.depth = limit * (below ? 0.4 + 0.5 * share : 1.2 + 0.8 * share);
    const auto at = solver->at(cut.speed);
    cut.radius = at->multiplier(cut.depth).radius();
    // A pocket may follow the first loss of stability: only clear cases are used.
    const bool clear = (at->multiplier(1.1 * cut.depth).radius() > 1.0) == cut.chattersBySolver() &&
                       (at->multiplier(0.9 * cut.depth).radius() > 1.0) == cut.chattersBySolver();
    if (clear) cuts.push_back(cut);
  }
  return cuts;
}

/// True motion, from a record without noise and effects. @param period in samples
void observe(const Record& record, int samples, int period, const std::string& signal, DetectionCut& cut) {
  const double rate = samples * cut.speed / units::TWO_PI;
  cut.chatters = repeatsNoMore(record, samples, period, FEED);
  cut.onset = std::numeric_limits<double>::quiet_NaN();
  const int turns = static_cast<int>(record.size()) / samples;
  for (int turn = AIR + 1; turn < turns; ++turn) {
    double change = 0.0;
    for (const char* axis : {"tool_x", "tool_y"}) {
      const std::vector<double>& u = record.column(axis);
      for (int k = turn * samples; k < (turn + 1) * samples; ++k)
        change += std::pow(u[static_cast<std::size_t>(k)] - u[static_cast<std::size_t>(k - period)], 2);
    }
    if (change < samples * std::pow(STILL * FEED, 2)) {
      cut.onset = std::numeric_limits<double>::quiet_NaN();
    } else if (std::isnan(cut.onset)) {
      cut.onset = turn * units::TWO_PI / cut.speed;
    }
  }
  const auto turn = static_cast<std::size_t>(period);
  cut.frequency = strongestLine(lateOf(signalOf(record, signal, rate), turn), turn, rate);
}

/// Result of the detector.
void take(const std::vector<ChatterState>& states, DetectionCut& cut) {
  for (const ChatterState& s : states) {
    if (!s.valid) continue;
    cut.alternation = std::max(cut.alternation, s.alternation);
    cut.energy = std::max(cut.energy, s.energy_ratio);
  }
  const auto detections = episodes(states);
  if (detections.empty()) return;
  cut.found = true;
  cut.detected = detections.front().detected;
  cut.found_frequency = detections.back().frequency;
}

}  // namespace

std::vector<DetectionCut> detectionStudy(const MachineModel& model, const RegenerativeSystem& system,
                                         const DetectionOptions& options,
                                         const std::function<void(double)>& progress) {
  options.validate();
  if (options.cuts < 1) throw Error("cuts: expected at least 1");
  if (!(options.signal_noise >= 0.0)) throw Error("signal noise: expected at least 0");
  std::vector<DetectionCut> cuts = drawCuts(system, options);
  const int samples = wholeTeeth(SAMPLES, system.teeth);
  std::vector<TwinCut> plan;
  for (const DetectionCut& cut : cuts)
    plan.push_back({cut.speed, {system.entry, system.exit, cut.depth, FEED}, samples, REVOLUTIONS, AIR});
  const auto half = [&progress](double done) {
    return [&progress, done](double share) {
      if (progress) progress(done + 0.5 * share);
    };
  };
  // First without noise and effects. Runout repeats every revolution, as does a flip with an even number of
  // teeth; with equal teeth sampling by the tooth period reveals the flip.
  MachineModel plain = model;
  plain.effects.clear();
  const int period = system.evenPitch() ? samples / system.teeth : samples;
  runTwinCuts(
      {plain}, plan, {{"tool_x", "tool_y", "fx", "fy", "fz"}},
      [&](std::size_t i, const Record& record) { observe(record, samples, period, options.signal, cuts[i]); },
      half(0.0));
  const bool force = options.signal == "force";
  TwinRequest request;
  request.columns =
      force ? std::vector<std::string>{"fx", "fy", "fz"} : std::vector<std::string>{"tool_x", "tool_y"};
  request.noise = force;
  request.seed = options.seed + 7u;
  runTwinCuts(
      {model}, plan, request,
      [&](std::size_t i, const Record& record) {
        const double rate = samples * cuts[i].speed / units::TWO_PI;
        take(verdicts(signalOf(record, options.signal, rate), cuts[i], model, options, rate,
                      options.seed + 100u + static_cast<unsigned>(i)),
             cuts[i]);
      },
      half(0.5));
  return cuts;
}

}  // namespace smartmill::stability
