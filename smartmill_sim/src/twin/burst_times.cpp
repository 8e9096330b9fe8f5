#include "smartmill_sim/twin/burst_times.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/signal/statistics.h"

namespace smartmill::sim {
namespace {

// Residual of a record, folded at a period.
struct Folded {
  std::vector<double> sum, count;
};

Folded fold(const std::vector<double>& residual, double rate, double period, std::size_t bins) {
  Folded folded{std::vector<double>(bins, 0.0), std::vector<double>(bins, 0.0)};
  const double scale = static_cast<double>(bins) / period;
  for (std::size_t i = 0; i < residual.size(); ++i) {
    const double at = std::fmod(static_cast<double>(i) / rate, period) * scale;
    const std::size_t bin = std::min(static_cast<std::size_t>(at), bins - 1);
    folded.sum[bin] += residual[i];
    folded.count[bin] += 1.0;
  }
  return folded;
}

// Begin [s] of the bursts that reduce the sum of squares of the residual most.
double bestBegin(const std::vector<double>& residual, double rate, const BurstTrain& train,
                 const BurstSearch& search) {
  const auto bins = static_cast<std::size_t>(
      std::clamp(std::ceil(search.bins_per_cycle * train.frequency * train.period), 16.0, search.most_bins));
  const double width = train.period / static_cast<double>(bins);
  const Folded folded = fold(residual, rate, train.period, bins);
  std::vector<double> shape;
  for (double t = 0.5 * width; t < std::min(search.decays * train.decay, train.period); t += width)
    shape.push_back(train.shape(t));
  std::vector<double> gain(bins, 0.0);
  for (std::size_t first = 0; first < bins; ++first) {
    double product = 0.0, squares = 1e-300;
    for (std::size_t k = 0; k < shape.size(); ++k) {
      const std::size_t bin = first + k < bins ? first + k : first + k - bins;
      product += shape[k] * folded.sum[bin];
      squares += shape[k] * shape[k] * folded.count[bin];
    }
    gain[first] = product > 0.0 ? product * product / squares : 0.0;
  }
  const auto best = static_cast<std::size_t>(std::max_element(gain.begin(), gain.end()) - gain.begin());
  const double before = gain[best > 0 ? best - 1 : bins - 1], at = gain[best],
               after = gain[best + 1 < bins ? best + 1 : 0];
  const double bend = 2.0 * at - before - after;
  const double share = bend > 0.0 ? std::clamp(0.5 * (after - before) / bend, -0.5, 0.5) : 0.0;
  return (static_cast<double>(best) + share) * width;
}

}  // namespace

void findBursts(const Record* recorded, const ChannelRows& raw, double rate, const SignalStage& signals,
                std::mt19937_64& random, const BurstSearch& search) {
  for (BurstTrain* train : signals.bursts()) {
    const std::size_t c = train->channel;
    if (!recorded) {
      train->first = std::uniform_real_distribution<double>(0.0, train->period)(random);
    } else if (raw[c] && recorded->has(channelName(c))) {
      const double amplitude = train->amplitude;
      train->amplitude = 0.0;
      std::vector<double> residual = recorded->column(channelName(c));
      for (std::size_t i = 0; i < residual.size(); ++i) {
        ChannelValues values{};
        values[c] = (*raw[c])[i];
        signals.apply(static_cast<double>(i) / rate, values);
        residual[i] -= values[c];
      }
      const double level = mean(residual);
      for (double& v : residual) v -= level;
      train->first = bestBegin(residual, rate, *train, search);
      train->amplitude = amplitude;
    }
  }
}

}  // namespace smartmill::sim
