#include <algorithm>
#include <cmath>

#include "explain/forms/form_family.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/modal/modal_filter.h"

namespace smartmill::discrepancy {
namespace {

struct ResonanceOptions {
  double lowest = LOWEST_MODE;   ///< [Hz]
  double highest = USABLE_BAND;  ///< [1] of the largest sample rate
  double resolved = 0.45;        ///< [1] of the sample rate of a record that takes part
  double ratio = 1.05;           ///< [1] of neighbouring frequencies, within the half-power width
  double damping_ratio = TYPICAL_DAMPING;
  double min_gain = 100.0;  ///< [squares] with less the fit could not reach SearchOptions::min_gain
};

// Model and residual of a force channel of one test, over the noise.
struct ForceResidual {
  double rate = 0.0, noise = 1.0;
  std::vector<double> model, residual;
};

std::map<std::string, std::map<std::size_t, ForceResidual>> forceResiduals(
    const TwinRunner& runner, const std::vector<double>& residual) {
  std::map<std::string, std::map<std::size_t, ForceResidual>> forces;
  for (const ChannelSpan& b : runner.spans()) {
    if (std::find(FORCES.begin(), FORCES.end(), b.channel) == FORCES.end() || b.slow || !b.in_gap) continue;
    ForceResidual& s = forces[b.channel][b.test];
    s.rate = runner.data().tests[b.test].test.sample_rate;
    s.noise = b.noise;
    for (std::size_t i = b.offset; i < b.offset + b.size; ++i) {
      s.model.push_back(runner.measured()[i] - residual[i]);
      s.residual.push_back(residual[i]);
    }
  }
  return forces;
}

struct Resonance {
  double frequency = 0.0, gain = 0.0,
         squares = 0.0;  // [Hz], of the path, reduction of the residual's squares
};

// Reduction by one mode between two channels.
Resonance resonanceAt(double frequency, const std::map<std::size_t, ForceResidual>& to,
                      const std::map<std::size_t, ForceResidual>& from, bool same_channel,
                      const ResonanceOptions& options) {
  ModalModel path;
  path.modes.resize(1);
  path.modes.front().frequency = frequency;
  path.modes.front().damping_ratio = options.damping_ratio;
  path.modes.front().gain = 1.0;
  double product = 0.0, squares = 1e-300;
  for (const auto& [test, source] : from) {
    const auto target = to.find(test);
    if (target == to.end() || frequency > options.resolved * source.rate) continue;
    ModalFilter mode(path, source.rate, Hold::first_order);
    const double scale = source.noise / target->second.noise;
    for (std::size_t i = 0; i < source.model.size(); ++i) {
      const double x = source.model[i], column = scale * (mode.step(x) - (same_channel ? x : 0.0));
      product += column * target->second.residual[i];
      squares += column * column;
    }
  }
  return {frequency, product / squares, product * product / squares};
}

// Best resonance among the frequencies that a sample rate resolves.
Resonance bestResonance(const TwinRunner& runner, double rate, const std::map<std::size_t, ForceResidual>& to,
                        const std::map<std::size_t, ForceResidual>& from, bool same_channel,
                        const ResonanceOptions& options) {
  std::vector<double> frequencies;
  for (double f = options.lowest; f < options.highest * rate; f *= options.ratio) frequencies.push_back(f);
  std::vector<Resonance> candidates(frequencies.size());
  runParallel(frequencies.size(), runner.threads(), [&](std::size_t k) {
    candidates[k] = resonanceAt(frequencies[k], to, from, same_channel, options);
  });
  return *std::max_element(candidates.begin(), candidates.end(),
                           [](const Resonance& a, const Resonance& b) { return a.squares < b.squares; });
}

/// Resonances between two force channels at their best frequency.
class Resonances : public FormFamily {
 public:
  void locate(const FormContext& context, std::vector<Hypothesis>* located) const override {
    const TwinRunner& runner = context.runner;
    const auto forces = forceResiduals(runner, context.now.residual);
    double rate = 0.0;
    for (const TestData& t : runner.data().tests) rate = std::max(rate, t.test.sample_rate);
    for (const auto& [to, target] : forces) {
      for (const auto& [from, source] : forces) {
        const std::string variant = to + " from " + from;
        for (const Hypothesis& h : context.forms) {
          if (!isForm(h, "resonance", variant)) continue;
          const Resonance best = bestResonance(runner, rate, target, source, to == from, options_);
          if (best.squares < options_.min_gain) continue;
          Hypothesis at = h;
          const double f = std::log(best.frequency), d = std::log(options_.damping_ratio);
          at.probe({f, d, 0.0}, {{f, d, std::clamp(best.gain, -1.0, 1.0)}});
          located->push_back(at.named(variant + formatted(", %.4g Hz", best.frequency)));
        }
      }
    }
  }

 private:
  ResonanceOptions options_;
};

}  // namespace

std::unique_ptr<FormFamily> makeResonances() {
  return std::make_unique<Resonances>();
}

}  // namespace smartmill::discrepancy
