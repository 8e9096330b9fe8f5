#include "stability/detection_study.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/fourier.h"
#include "stability/twin_agreement.h"

namespace smartmill::stability {
namespace {

constexpr int SAMPLES = 180, REVOLUTIONS = 150, AIR = 10, LATE = 60;
constexpr std::size_t BLOCK = 256;
constexpr double STILL = 0.05;  // [1] of the feed per tooth: change of the motion that is none

/// Up to three channels of a record as the detector's sensor gives them.
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
  if (kind != "sound") throw Error("signal " + kind + ": force, vibration or sound is due");
  // A body that shakes as a whole radiates pressure in step with its acceleration; the microphone hears both
  // axes.
  std::vector<double> pressure(acceleration[0].size());
  for (std::size_t i = 0; i < pressure.size(); ++i)
    pressure[i] = 1e-3 * (acceleration[0][i] + 0.6 * acceleration[1][i]);
  return {pressure};
}

/// Strongest line beside what repeats with a revolution (period in samples), over the last turns of the cut.
double strongestLine(const std::vector<std::vector<double>>& signal, std::size_t end, std::size_t period,
                     double rate) {
  std::vector<double> power;
  const std::size_t count = LATE * static_cast<std::size_t>(SAMPLES) / period * period;
  for (const std::vector<double>& whole : signal) {
    std::vector<double> part(whole.begin() + static_cast<std::ptrdiff_t>(end - count),
                             whole.begin() + static_cast<std::ptrdiff_t>(end));
    const double turns = static_cast<double>(count / period);
    for (std::size_t b = 0; b < period; ++b) {
      double mean = 0.0;
      for (std::size_t k = b; k < count; k += period) mean += part[k] / turns;
      for (std::size_t k = b; k < count; k += period) part[k] -= mean;
    }
    const auto spectrum = fourier(part);
    power.resize(count / 2 + 1, 0.0);
    for (std::size_t k = 0; k < power.size(); ++k) power[k] += std::norm(spectrum[k]);
  }
  const auto peak = std::max_element(power.begin() + 1, power.end()) - power.begin();
  return static_cast<double>(peak) * rate / static_cast<double>(count);
}

/// The record through the detector, as the streams of a machine.
std::vector<ChatterState> verdicts(const std::vector<std::vector<double>>& signal, const DetectionCut& cut,
                                   const MachineModel& model, const DetectionOptions& options, double rate,
                                   unsigned seed) {
  std::vector<ChatterState> states;
  ChatterDetector detector(options.detector, [&](const ChatterState& state) { states.push_back(state); });
  CuttingCondition condition;
  condition.kind = CuttingCondition::Kind::cut;
  condition.name = "cut";
  condition.tool = *model.tool;
  condition.steady_from = {{0.0, 0.0, 0.0}};
  condition.steady_to = {{1.0, 0.0, 0.0}};
  detector.handle(condition);
  const double turn = units::TWO_PI / cut.speed;
  const std::size_t cutting = signal[0].size();
  // The tool leaves the stock at once and the sensors see their noise alone.
  const std::size_t total = cutting + static_cast<std::size_t>(AIR * SAMPLES);
  std::vector<double> sigma;
  for (std::size_t c = 0; c < signal.size(); ++c) {
    double squares = 0.0;
    for (const double v : signal[c]) squares += v * v / static_cast<double>(cutting);
    const bool force = options.signal == "force";
    // The force's noise is in the record already.
    sigma.push_back(force ? 0.0 : options.signal_noise * std::sqrt(squares));
  }
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  SampleBlock block;
  block.sample_rate = rate;
  for (std::size_t c = 0; c < signal.size(); ++c) {
    block.channels.push_back("channel_" + std::to_string(c));
    block.units.emplace_back("1");
  }
  double angle_due = 0.0, state_due = 0.0;
  for (std::size_t i = 0; i < total; ++i) {
    const double t = static_cast<double>(i) / rate;
    if (t >= angle_due) {
      detector.handle(SpindleAngle{t, std::fmod(cut.speed * t, units::TWO_PI), cut.speed});
      angle_due += 0.005;
    }
    if (t >= state_due) {
      CncState state;
      state.stamp = t;
      state.connected = true;
      state.axes = {"X", "Y", "Z"};
      const bool in = t >= AIR * turn && i < cutting;
      state.position = {in ? 0.5 : 2.0, 0.0, 0.0};
      state.distance_to_go = {0.0, 0.0, 0.0};
      state.feed = 0.02;
      detector.handle(state);
      state_due += 0.02;
    }
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

}  // namespace

std::vector<DetectionCut> detectionStudy(const MachineModel& model, const RegenerativeSystem& system,
                                         const DetectionOptions& options,
                                         const std::function<void(double)>& progress) {
  if (!(options.speed_low > 0.0) || !(options.speed_high > options.speed_low))
    throw Error("speeds: 0 < low < high is due");
  if (options.cuts < 1) throw Error("cuts: at least 1 is due");
  if (!(options.signal_noise >= 0.0)) throw Error("signal noise: at least 0 is due");
  const auto solver = makeFloquetSolver(Method::collocation, system);
  std::mt19937_64 random(options.seed);
  std::uniform_real_distribution<double> unit;
  std::vector<DetectionCut> cuts;
  std::vector<TwinCut> plan;
  const int samples = (SAMPLES + system.teeth - 1) / system.teeth * system.teeth;
  constexpr double FEED = 0.1e-3;
  for (int tries = 0; static_cast<int>(cuts.size()) < options.cuts; ++tries) {
    if (tries > 100 * options.cuts + 1000) throw Error("detection study: no cuts beside the limit are found");
    DetectionCut cut;
    cut.speed = options.speed_low + (options.speed_high - options.speed_low) * unit(random);
    const double limit = solver->limit(cut.speed, options.max_depth).depth;
    const double share = unit(random);
    if (!std::isfinite(limit)) continue;
    cut.depth = limit * (cuts.size() % 2 ? 0.4 + 0.5 * share : 1.2 + 0.8 * share);
    const auto at = solver->at(cut.speed);
    cut.radius = at->multiplier(cut.depth).radius();
    // Beyond a first loss a pocket may follow; ask for clear cases.
    if ((at->multiplier(1.1 * cut.depth).radius() > 1.0) != (cut.radius > 1.0) ||
        (at->multiplier(0.9 * cut.depth).radius() > 1.0) != (cut.radius > 1.0))
      continue;
    cuts.push_back(cut);
    TwinCut run;
    run.speed = cut.speed;
    run.engagement = Engagement{system.entry, system.exit, cut.depth, FEED};
    run.samples = samples;
    run.revolutions = REVOLUTIONS;
    run.air = AIR;
    plan.push_back(run);
  }
  // First without noise and effects: the truth about the motion. Runout repeats every revolution, and a flip
  // of an even number of teeth does so too; with teeth that are alike the tooth's period shows it.
  MachineModel plain = model;
  plain.effects.clear();
  runTwinCuts(
      {plain}, plan, {{"tool_x", "tool_y", "fx", "fy", "fz"}},
      [&](std::size_t i, const Record& record) {
        DetectionCut& cut = cuts[i];
        const double rate = samples * cut.speed / units::TWO_PI;
        const int period = system.evenPitch() ? samples / system.teeth : samples;
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
        cut.frequency = strongestLine(signalOf(record, options.signal, rate), record.size(),
                                      static_cast<std::size_t>(period), rate);
      },
      [&](double share) {
        if (progress) progress(0.5 * share);
      });
  const bool force = options.signal == "force";
  TwinRequest request;
  request.columns =
      force ? std::vector<std::string>{"fx", "fy", "fz"} : std::vector<std::string>{"tool_x", "tool_y"};
  request.noise = force;
  request.seed = options.seed + 7u;
  runTwinCuts(
      {model}, plan, request,
      [&](std::size_t i, const Record& record) {
        DetectionCut& cut = cuts[i];
        const double rate = samples * cut.speed / units::TWO_PI;
        const auto states = verdicts(signalOf(record, options.signal, rate), cut, model, options, rate,
                                     options.seed + 100u + static_cast<unsigned>(i));
        for (const ChatterState& s : states) {
          if (s.valid) {
            cut.alternation = std::max(cut.alternation, s.alternation);
            cut.energy = std::max(cut.energy, s.energy_ratio);
          }
        }
        const auto seen = episodes(states);
        if (seen.empty()) return;
        cut.found = true;
        cut.detected = seen.front().detected;
        cut.found_frequency = seen.back().frequency;
      },
      [&](double share) {
        if (progress) progress(0.5 + 0.5 * share);
      });
  return cuts;
}

}  // namespace smartmill::stability
