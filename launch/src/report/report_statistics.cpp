#include "smartmill_launch/report/report_statistics.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/revolution_window.h"
#include "smartmill_core/signal/statistics.h"

namespace smartmill::report {

double Figure::percent() const {
  return 100.0 * (estimate - truth) / std::abs(truth);
}

double Figure::sigmas() const {
  return (estimate - truth) / std_dev;
}

std::optional<bool> Figure::met() const {
  if (std::isnan(target.percent) || std::isnan(truth)) return std::nullopt;
  const double difference = std::abs(percent());
  return target.at_least ? difference >= target.percent : difference <= target.percent;
}

std::pair<double, double> stiffnessOf(const Mode& mode) {
  return {1.0 / mode.gain, mode.gain_std / (mode.gain * mode.gain)};
}

std::vector<std::optional<std::size_t>> matchModes(const std::vector<Mode>& measured,
                                                   const std::vector<Mode>& truth) {
  std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;
  for (std::size_t i = 0; i < measured.size(); ++i) {
    for (std::size_t j = 0; j < truth.size(); ++j) {
      const double octaves = std::abs(std::log2(measured[i].frequency / truth[j].frequency));
      if (octaves <= 1.0) pairs.emplace_back(octaves, i, j);
    }
  }
  std::sort(pairs.begin(), pairs.end());
  std::vector<std::optional<std::size_t>> match(measured.size());
  std::vector<bool> taken(truth.size(), false);
  for (const auto& [octaves, i, j] : pairs) {
    if (match[i] || taken[j]) continue;
    match[i] = j;
    taken[j] = true;
  }
  return match;
}

// ---------------------------------------------------------------------------------------------- force

void ForceTrack::add(const ForceBlock& block) {
  if (block.force[0].empty()) return;
  sample_rate_ = block.sample_rate;
  blocks_[block.first_index] = block;
}

std::vector<double> ForceTrack::axisWithGaps(std::size_t axis, std::uint64_t from, std::uint64_t to) const {
  std::vector<double> values(to - from, NOT_A_NUMBER);
  auto block = blocks_.upper_bound(from);
  if (block != blocks_.begin()) --block;
  for (; block != blocks_.end() && block->first < to; ++block) {
    const std::vector<double>& source = block->second.force[axis];
    for (std::uint64_t i = 0; i < source.size(); ++i) {
      const std::uint64_t index = block->first + i;
      if (index >= from && index < to) values[index - from] = source[i];
    }
  }
  return values;
}

std::vector<double> ForceTrack::axisAt(std::size_t axis, const std::vector<double>& times) const {
  std::vector<double> values(times.size(), NOT_A_NUMBER);
  auto block = blocks_.begin();
  for (std::size_t i = 0; i < times.size() && block != blocks_.end(); ++i) {
    for (auto next = std::next(block);
         next != blocks_.end() && next->second.stamp - 0.5 / sample_rate_ <= times[i]; ++next) {
      block = next;
    }
    const std::vector<double>& source = block->second.force[axis];
    const long sample = std::lround((times[i] - block->second.stamp) * sample_rate_);
    if (sample >= 0 && sample < static_cast<long>(source.size()))
      values[i] = source[static_cast<std::size_t>(sample)];
  }
  return values;
}

std::vector<double> ForceTrack::axis(std::size_t axis, std::uint64_t from, std::uint64_t to) const {
  const auto [first, last] = covered(from, to);
  if (first != from || last != to) {
    throw Error("force samples between " + std::to_string(from) + " and " + std::to_string(to) +
                " are missing");
  }
  return axisWithGaps(axis, from, to);
}

std::uint64_t ForceTrack::indexAt(double stamp) const {
  if (empty()) throw Error("the recording contains no force");
  const ForceBlock* nearest = &blocks_.begin()->second;
  for (const auto& [index, block] : blocks_) {
    if (block.stamp <= stamp) nearest = &block;
  }
  // Stamps are rounded by a few thousandths of a sample.
  const double samples = std::ceil((stamp - nearest->stamp) * sample_rate_ - 0.05);
  return nearest->first_index + static_cast<std::uint64_t>(std::max(samples, 0.0));
}

std::pair<std::uint64_t, std::uint64_t> ForceTrack::covered(std::uint64_t from, std::uint64_t to,
                                                            bool compensated) const {
  std::pair<std::uint64_t, std::uint64_t> best{from, from}, run{from, from};
  for (const auto& [index, block] : blocks_) {
    const std::uint64_t begin = std::max(index, from);
    const std::uint64_t end = std::min<std::uint64_t>(index + block.force[0].size(), to);
    if (begin >= end || (compensated && !block.isCompensated())) continue;
    run = begin == run.second ? std::make_pair(run.first, end) : std::make_pair(begin, end);
    if (run.second - run.first > best.second - best.first) best = run;
  }
  return best;
}

double middleRange(const std::vector<double>& values) {
  return percentile(values, 0.9) - percentile(values, 0.1);
}

double nonperiodicShare(const std::vector<double>& values, double samples_per_revolution, int revolutions) {
  const double window = samples_per_revolution * revolutions;
  if (!(window > 0.0)) return NOT_A_NUMBER;
  double all = 0.0, nonperiodic = 0.0;
  for (double start = 1.0; start + window + 2.0 < static_cast<double>(values.size()); start += window) {
    RevolutionWindow content(static_cast<std::size_t>(std::ceil(samples_per_revolution)),
                             static_cast<std::size_t>(revolutions), 0);
    content.add(values, start, samples_per_revolution);
    nonperiodic += content.remainder();
    all += content.total();
  }
  return all > 0.0 ? nonperiodic / all : NOT_A_NUMBER;
}

// ---------------------------------------------------------------------------------------------- chart

std::vector<Pocket> pockets(const std::vector<double>& speeds, const std::vector<double>& depths,
                            double factor, double ceiling) {
  if (speeds.size() != depths.size())
    throw Error("stability chart: " + std::to_string(speeds.size()) + " speeds and " +
                std::to_string(depths.size()) + " depths, expected equal numbers");
  // [1] of the maximum depth: a point has no weight below LOW, all of it above HIGH, a share between them, so
  // that the speed does not jump where a second peak is nearly as high.
  constexpr double LOW = 0.85, HIGH = 0.95;
  const auto depth = [&](std::size_t i) { return std::min(depths[i], ceiling); };
  std::vector<Pocket> found;
  bool rising = false;  // the start of the chart is no pocket
  std::size_t extreme = 0, valley = 0;
  for (std::size_t i = 1; i < depths.size(); ++i) {
    if (rising ? depth(i) > depth(extreme) : depth(i) < depth(extreme)) extreme = i;
    const bool reversed = rising ? depth(i) * factor < depth(extreme) : depth(i) > depth(extreme) * factor;
    if (!reversed) continue;
    if (rising) {
      double weights = 0.0, sum = 0.0;
      for (std::size_t k = valley; k <= i; ++k) {
        const double weight = std::clamp((depth(k) / depth(extreme) - LOW) / (HIGH - LOW), 0.0, 1.0);
        weights += weight;
        sum += weight * speeds[k];
      }
      found.push_back({sum / weights, depth(extreme)});
    } else {
      valley = extreme;
    }
    rising = !rising;
    extreme = i;
  }
  return found;
}

double interpolate(const std::vector<double>& x, const std::vector<double>& y, double at) {
  if (x.size() != y.size())
    throw Error("curve: " + std::to_string(x.size()) + " values of x and " + std::to_string(y.size()) +
                " of y, expected equal numbers");
  const auto above = std::lower_bound(x.begin(), x.end(), at);
  if (above == x.end()) return NOT_A_NUMBER;
  const auto i = static_cast<std::size_t>(above - x.begin());
  if (*above == at) return y[i];
  if (i == 0) return NOT_A_NUMBER;
  return y[i - 1] + (y[i] - y[i - 1]) * (at - x[i - 1]) / (x[i] - x[i - 1]);
}

}  // namespace smartmill::report
