#include "gap/residual_components.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <utility>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/gap/dependence.h"
#include "smartmill_discrepancy/gap/significance.h"

namespace smartmill::discrepancy {
namespace {

std::vector<double> unwrapped(const std::vector<double>& angle, std::size_t from) {
  std::vector<double> out;
  double turns = 0.0;
  for (std::size_t i = from; i < angle.size(); ++i) {
    if (i > from && angle[i] < angle[i - 1] - 3.0) turns += units::TWO_PI;
    out.push_back(angle[i] + turns);
  }
  return out;
}

template <class Phase>
Line lineOf(const std::vector<double>& values, const Phase& phase) {
  LineSums sums;
  for (std::size_t i = 0; i < values.size(); ++i) sums.add(std::sin(phase(i)), std::cos(phase(i)), values[i]);
  return sums.solve();
}

template <class Phase>
void subtract(std::vector<double>& values, const Phase& phase, const Line& line) {
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] -= line.sine * std::sin(phase(i)) + line.cosine * std::cos(phase(i));
}

// Slope per sample about the middle, and reduction of squares.
std::pair<double, double> trendOf(const std::vector<double>& v) {
  const double n = static_cast<double>(v.size()), middle = 0.5 * (n - 1.0);
  double xy = 0.0;
  for (std::size_t i = 0; i < v.size(); ++i) xy += (static_cast<double>(i) - middle) * v[i];
  const double xx = n * (n * n - 1.0) / 12.0;
  return {xy / xx, xy * xy / xx};
}

// Exponential decay from the start of the record. @param time_constant [s]
double decayAt(double time_constant, const ChannelSegment& s, std::size_t i) {
  return std::exp(-static_cast<double>(i) / (s.rate * time_constant));
}

// Its size and reduction of squares.
std::pair<double, double> decayFit(double time_constant, const ChannelSegment& s) {
  const double share = decayAt(time_constant, s, 1);  // from one sample to the next
  double xy = 0.0, xx = 0.0, shape = 1.0;
  for (const double value : s.values) {
    xy += shape * value;
    xx += shape * shape;
    shape *= share;
  }
  return {xy / xx, xy * xy / xx};
}

void countOrders(const ChannelSegment& s, double highest, std::vector<Component>& halves,
                 std::vector<Component>& orders) {
  const std::vector<Line> lines = s.lines->wholes(s.values);
  const std::vector<Line> between = s.lines->halves(s.values);
  for (std::size_t k = 0; k < halves.size(); ++k) {
    halves[k].squares += between[k].squares;
    halves[k].freedom += 2;
  }
  for (std::size_t k = 0; k < orders.size(); ++k) {
    Component& o = orders[k];
    if (o.location_value * s.test->test.spindle_speed / units::TWO_PI > highest * s.rate) continue;
    o.squares += lines[k].squares;
    o.freedom += 2;
  }
}

// The strongest line at a fixed frequency over all segments with the highest rate; freedom 0: none.
Component strongestFrequency(const std::vector<ChannelSegment>& segments, std::size_t padded_size) {
  double rate = 0.0;
  std::size_t longest = 0, used = 0;
  for (const ChannelSegment& s : segments) {
    rate = std::max(rate, s.rate);
    longest = std::max(longest, s.values.size());
  }
  std::vector<double> sum(padded_size / 2 + 1, 0.0);
  for (const ChannelSegment& s : segments) {
    if (s.rate != rate || s.values.size() > padded_size) continue;
    std::vector<double> padded(s.values);
    const double m = mean(padded);
    for (double& v : padded) v -= m;
    padded.resize(padded_size, 0.0);
    const auto spectrum = fourier(padded);
    for (std::size_t k = 0; k < sum.size(); ++k)
      sum[k] += 2.0 * std::norm(spectrum[k]) / static_cast<double>(s.values.size());
    ++used;
  }
  if (used == 0) return {};
  // A line below one cycle per record is a trend.
  const auto first = static_cast<std::size_t>(padded_size / longest + 1);
  const auto top = static_cast<std::size_t>(
      std::max_element(sum.begin() + static_cast<std::ptrdiff_t>(first), sum.end() - 1) - sum.begin());
  double location_value = static_cast<double>(top);
  const double a = sum[top - 1], b = sum[top], c = sum[top + 1];
  if (2.0 * b - a - c > 0.0) location_value += 0.5 * (c - a) / (2.0 * b - a - c);
  return {ComponentKind::frequency, location_value * rate / static_cast<double>(padded_size), sum[top],
          2 * used, 0.5 * static_cast<double>(longest)};
}

// A component of one segment.
struct RemovedPart {
  double amplitude = 0.0, squares = 0.0, std_dev = 1.0;
};

// Removes a component from a segment; nothing if the segment cannot contain it.
std::optional<RemovedPart> removeFrom(const Component& c, ChannelSegment& s) {
  const double n = static_cast<double>(s.values.size());
  if (c.kind == ComponentKind::level) {
    const double level = mean(s.values);
    for (double& v : s.values) v -= level;
    return RemovedPart{level, n * level * level, 1.0 / std::sqrt(n)};
  }
  if (c.kind == ComponentKind::trend) {
    const auto [slope, squares] = trendOf(s.values);
    for (std::size_t i = 0; i < s.values.size(); ++i)
      s.values[i] -= slope * (static_cast<double>(i) - 0.5 * (n - 1.0));
    return RemovedPart{slope * s.rate, squares, s.rate * std::sqrt(12.0 / (n * n * n))};
  }
  if (c.kind == ComponentKind::decay) {
    const auto [size, squares] = decayFit(c.location_value, s);
    for (std::size_t i = 0; i < s.values.size(); ++i) s.values[i] -= size * decayAt(c.location_value, s, i);
    return RemovedPart{size, squares, std::sqrt(2.0 / (s.rate * c.location_value))};
  }
  if (c.kind == ComponentKind::order && s.angle.empty()) return {};
  const auto phase = [&](std::size_t i) {
    return c.kind == ComponentKind::order
               ? c.location_value * s.angle[i]
               : units::TWO_PI * c.location_value * static_cast<double>(i) / s.rate;
  };
  const Line line = lineOf(s.values, phase);
  subtract(s.values, phase, line);
  return RemovedPart{std::hypot(line.sine, line.cosine), line.squares, std::sqrt(2.0 / n)};
}

// Domain and location as reports name them.
Finding named(const Component& c, const std::string& channel) {
  Finding f;
  f.channel = channel;
  switch (c.kind) {
    case ComponentKind::level:
      f.domain = "level";
      break;
    case ComponentKind::trend:
      f.domain = "time";
      f.location["time_s"] = 0.0;
      break;
    case ComponentKind::decay:
      f.domain = "time";
      f.location["time_s"] = c.location_value;
      break;
    case ComponentKind::order:
      f.domain = "order";
      f.location["order"] = c.location_value;
      break;
    case ComponentKind::frequency:
      f.domain = "frequency";
      f.location["frequency_hz"] = c.location_value;
  }
  f.squares = c.squares;
  return f;
}

}  // namespace

std::vector<ChannelSegment> segmentsOf(const TwinRunner& runner, const std::vector<double>& residual,
                                       const std::string& channel, const ComponentOptions& options) {
  std::vector<ChannelSegment> segments;
  for (const ChannelSpan& span : runner.spans()) {
    if (span.channel != channel || span.slow || !span.in_gap) continue;
    const TestData& test = runner.data().tests[span.test];
    const std::size_t from = test.test.kind == TestKind::cut ? test.first_cut : 0;
    if (span.size < from + options.min_samples) continue;
    ChannelSegment s{&test, &span, {}, {}, test.test.sample_rate, {}};
    s.values.assign(residual.begin() + static_cast<std::ptrdiff_t>(span.offset + from),
                    residual.begin() + static_cast<std::ptrdiff_t>(span.offset + span.size));
    if (test.test.kind != TestKind::tap && test.record.has("spindle_angle"))
      s.angle = unwrapped(test.record.column("spindle_angle"), from);
    if (!s.angle.empty()) s.lines.emplace(s.angle, options.orders, options.half_orders);
    segments.push_back(std::move(s));
  }
  return segments;
}

std::vector<Component> componentsOf(const std::vector<ChannelSegment>& segments,
                                    const ComponentOptions& options) {
  Component level{ComponentKind::level, 0.0, 0.0, 0, 1.0}, trend{ComponentKind::trend, 0.0, 0.0, 0, 1.0};
  std::vector<Component> orders, halves, decay;
  for (std::size_t k = 0; k < options.half_orders; ++k)
    halves.push_back({ComponentKind::order, static_cast<double>(k) + 0.5, 0.0, 0, 1.0});
  for (const double t : options.decays) decay.push_back({ComponentKind::decay, t, 0.0, 0, 2.0});
  for (std::size_t k = 1; k <= options.orders; ++k)
    orders.push_back({ComponentKind::order, static_cast<double>(k), 0.0, 0, 1.0});
  for (const ChannelSegment& s : segments) {
    const double n = static_cast<double>(s.values.size()), m = mean(s.values);
    level.squares += n * m * m;
    ++level.freedom;
    trend.squares += trendOf(s.values).second;
    ++trend.freedom;
    for (Component& c : decay) {
      c.squares += decayFit(c.location_value, s).second;
      ++c.freedom;
    }
    if (!s.angle.empty()) countOrders(s, options.highest_order, halves, orders);
  }
  std::vector<Component> all{level, trend};
  all.insert(all.end(), decay.begin(), decay.end());
  all.insert(all.end(), halves.begin(), halves.end());
  all.insert(all.end(), orders.begin(), orders.end());
  const Component frequency = strongestFrequency(segments, options.spectrum);
  if (frequency.freedom > 0) all.push_back(frequency);
  return all;
}

Finding removeComponent(const Component& c, const std::string& channel,
                        std::vector<ChannelSegment>& segments) {
  Finding f = named(c, channel);
  std::vector<TestAmplitude> amplitudes;
  for (ChannelSegment& s : segments) {
    const std::optional<RemovedPart> removed = removeFrom(c, s);
    if (!removed) continue;
    amplitudes.push_back({s.test, removed->amplitude, removed->std_dev});
    if (chiSquareTail(removed->squares, 2) < SIGNIFICANT) f.tests.push_back(s.test->test.name);
    f.amplitude = std::max(f.amplitude, std::abs(removed->amplitude) * s.span->noise);
  }
  f.depends_on = dependentConditions(amplitudes);
  return f;
}

}  // namespace smartmill::discrepancy
