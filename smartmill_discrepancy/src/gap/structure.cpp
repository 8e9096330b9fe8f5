#include "smartmill_discrepancy/gap/structure.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <utility>

#include "gap/residual_components.h"
#include "smartmill_discrepancy/gap/dependence.h"
#include "smartmill_discrepancy/gap/significance.h"

namespace smartmill::discrepancy {
namespace {

double excess(const Component& c) {
  return (c.squares - static_cast<double>(c.freedom)) /
         std::sqrt(2.0 * static_cast<double>(std::max<std::size_t>(c.freedom, 1)));
}

// One channel of a campaign.
struct Channel {
  std::vector<ChannelSegment> segments;
  double samples = 0.0;
  double floor = 0.0;  // squares by which two accurate simulations may differ
};

Channel channelOf(const TwinRunner& runner, const std::vector<double>& residual, const std::string& name,
                  const StructureOptions& options) {
  Channel channel;
  channel.segments = segmentsOf(runner, residual, name, options.components);
  for (const ChannelSegment& s : channel.segments) {
    channel.samples += static_cast<double>(s.values.size());
    for (std::size_t i = s.span->offset; i < s.span->offset + s.span->size; ++i) {
      const double accuracy = options.twin_accuracy * runner.measured()[i];
      channel.floor += accuracy * accuracy;
    }
  }
  return channel;
}

// Decomposes a channel. @return p-values of the last trials, which found nothing
std::vector<double> decompose(const std::string& name, Channel channel, const StructureOptions& options,
                              double all_excess, std::vector<Finding>& found) {
  for (int step = 0; step < options.most; ++step) {
    const std::vector<Component> all = componentsOf(channel.segments, options.components);
    std::vector<double> p_values;
    const Component* best = nullptr;
    for (const Component& c : all) {
      p_values.push_back(
          std::min(1.0, c.freedom ? c.trials * chiSquareTail(c.squares, c.freedom + c.freedom % 2) : 1.0));
      if (c.freedom > 0 && (!best || excess(c) > excess(*best))) best = &c;
    }
    const double p = p_values[static_cast<std::size_t>(best - all.data())];
    if (p > options.p_value || best->squares < options.min_share * channel.samples + channel.floor)
      return p_values;
    Finding f = removeComponent(*best, name, channel.segments);
    f.p_value = p;
    f.share_of_gap = (best->squares - static_cast<double>(best->freedom)) / all_excess;
    found.push_back(std::move(f));
  }
  return {};
}

// Corrects the p-values for all trials and keeps the significant findings, the largest first.
void keepSignificant(const std::vector<double>& null_p_values, const StructureOptions& options,
                     std::vector<Finding>& found) {
  std::vector<double> p_values = null_p_values;
  for (const Finding& f : found) p_values.push_back(f.p_value);
  const std::vector<double> rates = falseDiscoveryRates(p_values);
  for (std::size_t k = 0; k < found.size(); ++k) found[k].p_value = rates[null_p_values.size() + k];
  found.erase(std::remove_if(found.begin(), found.end(),
                             [&](const Finding& f) { return f.p_value > options.p_value; }),
              found.end());
  std::stable_sort(found.begin(), found.end(),
                   [](const Finding& a, const Finding& b) { return a.share_of_gap > b.share_of_gap; });
  const std::size_t most = 2 * static_cast<std::size_t>(options.most);
  if (found.size() > most) found.resize(most);
}

// Level of a channel of slow means, over all tests.
void checkSlowMeans(const TwinRunner& runner, const std::vector<double>& residual, const std::string& name,
                    const StructureOptions& options, double all_excess, std::vector<Finding>& found,
                    std::vector<double>& null_p_values) {
  Finding f;
  f.channel = name;
  f.domain = "level";
  std::vector<TestAmplitude> amplitudes;
  std::size_t count = 0;
  double floor = 0.0;
  for (const ChannelSpan& b : runner.spans()) {
    if (b.channel != name || !b.slow || !b.in_gap) continue;
    const TestData& test = runner.data().tests[b.test];
    double sum = 0.0, squares = 0.0;
    for (std::size_t i = b.offset; i < b.offset + b.size; ++i) {
      sum += residual[i];
      squares += residual[i] * residual[i];
      floor += std::pow(options.twin_accuracy * runner.measured()[i], 2);
    }
    const auto n = static_cast<double>(b.size);
    amplitudes.push_back({&test, sum / n, 1.0 / std::sqrt(n)});
    if (chiSquareTail(squares, b.size + b.size % 2) < SIGNIFICANT) f.tests.push_back(test.test.name);
    f.amplitude = std::max(f.amplitude, std::abs(sum / n) * b.noise);
    f.squares += squares;
    count += b.size;
  }
  if (count == 0) return;
  f.p_value = chiSquareTail(f.squares, count + count % 2);
  if (f.p_value > options.p_value ||
      f.squares < options.min_slow_squares * static_cast<double>(count) + floor) {
    null_p_values.push_back(f.p_value);
    return;
  }
  f.share_of_gap = (f.squares - static_cast<double>(count)) / all_excess;
  f.depends_on = dependentConditions(amplitudes);
  found.push_back(std::move(f));
}

}  // namespace

std::vector<Finding> findStructure(const TwinRunner& runner, const std::vector<double>& residual,
                                   const StructureOptions& options) {
  double all_excess = options.squares_of_gap;
  if (all_excess <= 0.0) {
    double squares = 0.0;
    for (const double r : residual) squares += r * r;
    all_excess = std::max(squares - static_cast<double>(residual.size()), 1.0);
  }
  std::set<std::string> channels;
  for (const ChannelSpan& b : runner.spans()) channels.insert(b.channel);
  struct ChannelFindings {
    std::vector<Finding> found;
    std::vector<double> null_p_values;  // p-values of trials without finding, for the false discovery rate
  };
  const std::vector<std::string> names(channels.begin(), channels.end());
  std::vector<ChannelFindings> of_channels(names.size());
  runParallel(names.size(), runner.threads(), [&](std::size_t k) {
    ChannelFindings& of = of_channels[k];
    Channel channel = channelOf(runner, residual, names[k], options);
    checkSlowMeans(runner, residual, names[k], options, all_excess, of.found, of.null_p_values);
    if (channel.segments.empty()) return;
    const std::vector<double> last = decompose(names[k], std::move(channel), options, all_excess, of.found);
    of.null_p_values.insert(of.null_p_values.end(), last.begin(), last.end());
  });
  std::vector<Finding> found;
  std::vector<double> null_p_values;
  for (const ChannelFindings& of : of_channels) {
    found.insert(found.end(), of.found.begin(), of.found.end());
    null_p_values.insert(null_p_values.end(), of.null_p_values.begin(), of.null_p_values.end());
  }
  keepSignificant(null_p_values, options, found);
  return found;
}

}  // namespace smartmill::discrepancy
