#include "smartmill_discrepancy/gap/structure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numeric>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "gap/orders.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/gap/dependence.h"
#include "smartmill_discrepancy/gap/significance.h"

namespace smartmill::discrepancy {
namespace {

constexpr std::size_t ORDERS = 36;
constexpr std::size_t HALF_ORDERS = 4;  // 0.5, 1.5, ..
constexpr std::size_t PADDED = 1 << 16;

// Reduction of squares by a sine with free phase, and its amplitudes.
struct Line {
  double squares = 0.0, sine = 0.0, cosine = 0.0;
};

// Least squares of a sine and a cosine.
struct LineSums {
  double ss = 0.0, cc = 0.0, sc = 0.0, s = 0.0, c = 0.0;
  void add(double sine, double cosine, double value) {
    ss += sine * sine;
    cc += cosine * cosine;
    sc += sine * cosine;
    s += sine * value;
    c += cosine * value;
  }
  Line solve() const {
    const double det = ss * cc - sc * sc;
    Line line;
    if (det <= 1e-9 * ss * cc) return line;
    line.sine = (cc * s - sc * c) / det;
    line.cosine = (ss * c - sc * s) / det;
    line.squares = line.sine * s + line.cosine * c;
    return line;
  }
};

// Lines at orders of the spindle, each fitted separately. Sums that do not depend on the values are computed
// once.
class SpindleLines {
 public:
  explicit SpindleLines(const std::vector<double>& angle) : whole_(angle), half_(halved(angle)) {
    const std::vector<double> twice = whole_.along(std::vector<double>(angle.size(), 1.0), 2 * ORDERS);
    const auto of = [&](std::size_t doubled) {  // twice the order
      LineSums sums;
      sums.ss = 0.5 * (twice[0] - twice[2 * doubled - 1]);
      sums.cc = 0.5 * (twice[0] + twice[2 * doubled - 1]);
      sums.sc = 0.5 * twice[2 * doubled];
      return sums;
    };
    for (std::size_t k = 1; k <= ORDERS; ++k) wholes_[k - 1] = of(2 * k);
    for (std::size_t k = 0; k < HALF_ORDERS; ++k) halves_[k] = of(2 * k + 1);
  }

  /// Of orders 1..ORDERS.
  std::array<Line, ORDERS> wholes(const std::vector<double>& values) const {
    return solved(wholes_, whole_.along(values, ORDERS), 1);
  }
  /// Of 0.5, 1.5, ...
  std::array<Line, HALF_ORDERS> halves(const std::vector<double>& values) const {
    return solved(halves_, half_.along(values, 2 * HALF_ORDERS - 1), 2);
  }

 private:
  static std::vector<double> halved(std::vector<double> angle) {
    for (double& a : angle) a *= 0.5;
    return angle;
  }
  template <std::size_t N>
  static std::array<Line, N> solved(std::array<LineSums, N> sums, const std::vector<double>& along,
                                    std::size_t every) {
    std::array<Line, N> lines;
    for (std::size_t k = 0; k < N; ++k) {
      const std::size_t order = 1 + every * k;
      sums[k].c = along[2 * order - 1];
      sums[k].s = along[2 * order];
      lines[k] = sums[k].solve();
    }
    return lines;
  }

  OrderBasis whole_, half_;
  std::array<LineSums, ORDERS> wholes_;
  std::array<LineSums, HALF_ORDERS> halves_;
};

// Part of a span with one condition: the time in cut of a cut, otherwise all samples.
struct ChannelSegment {
  const TestData* test;
  double noise;
  std::vector<double> values;
  std::vector<double> angle;  // unwrapped; empty without spindle angle
  double rate;
  std::optional<SpindleLines> lines;  // with spindle angle
};

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

enum class ComponentKind { level, trend, decay, order, frequency };

struct Component {
  ComponentKind kind = ComponentKind::level;
  double location_value = 0.0;  // order or Hz
  double squares = 0.0;         // over all segments
  std::size_t freedom = 0;
  double trials = 1.0;  // independent locations tried
};

double excess(const Component& c) {
  return (c.squares - static_cast<double>(c.freedom)) /
         std::sqrt(2.0 * static_cast<double>(std::max<std::size_t>(c.freedom, 1)));
}

double meanOf(const std::vector<double>& v) {
  return std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
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

void countOrders(const ChannelSegment& s, std::vector<Component>& halves, std::vector<Component>& orders) {
  const std::array<Line, ORDERS> lines = s.lines->wholes(s.values);
  const std::array<Line, HALF_ORDERS> between = s.lines->halves(s.values);
  for (std::size_t k = 0; k < HALF_ORDERS; ++k) {
    halves[k].squares += between[k].squares;
    halves[k].freedom += 2;
  }
  for (std::size_t k = 0; k < ORDERS; ++k) {
    Component& o = orders[k];
    if (o.location_value * s.test->test.spindle_speed / units::TWO_PI > 0.45 * s.rate) continue;
    o.squares += lines[k].squares;
    o.freedom += 2;
  }
}

// The strongest line at a fixed frequency over all segments with the highest rate; freedom 0: none.
Component strongestFrequency(const std::vector<ChannelSegment>& segments) {
  double rate = 0.0;
  std::size_t longest = 0, used = 0;
  for (const ChannelSegment& s : segments) {
    rate = std::max(rate, s.rate);
    longest = std::max(longest, s.values.size());
  }
  std::vector<double> sum(PADDED / 2 + 1, 0.0);
  for (const ChannelSegment& s : segments) {
    if (s.rate != rate || s.values.size() > PADDED) continue;
    std::vector<double> padded(s.values);
    const double m = meanOf(padded);
    for (double& v : padded) v -= m;
    padded.resize(PADDED, 0.0);
    const auto spectrum = fourier(padded);
    for (std::size_t k = 0; k < sum.size(); ++k)
      sum[k] += 2.0 * std::norm(spectrum[k]) / static_cast<double>(s.values.size());
    ++used;
  }
  if (used == 0) return {};
  // A line below one cycle per record is a trend.
  const auto first = static_cast<std::size_t>(PADDED / longest + 1);
  const auto top = static_cast<std::size_t>(
      std::max_element(sum.begin() + static_cast<std::ptrdiff_t>(first), sum.end() - 1) - sum.begin());
  double location_value = static_cast<double>(top);
  const double a = sum[top - 1], b = sum[top], c = sum[top + 1];
  if (2.0 * b - a - c > 0.0) location_value += 0.5 * (c - a) / (2.0 * b - a - c);
  return {ComponentKind::frequency, location_value * rate / PADDED, sum[top], 2 * used,
          0.5 * static_cast<double>(longest)};
}

std::vector<Component> componentsOf(const std::vector<ChannelSegment>& segments) {
  Component level{ComponentKind::level, 0.0, 0.0, 0, 1.0}, trend{ComponentKind::trend, 0.0, 0.0, 0, 1.0};
  std::vector<Component> orders, halves, decay;
  for (std::size_t k = 0; k < HALF_ORDERS; ++k)
    halves.push_back({ComponentKind::order, static_cast<double>(k) + 0.5, 0.0, 0, 1.0});
  for (const double t : {0.02, 0.035, 0.06, 0.1}) decay.push_back({ComponentKind::decay, t, 0.0, 0, 2.0});
  for (std::size_t k = 1; k <= ORDERS; ++k)
    orders.push_back({ComponentKind::order, static_cast<double>(k), 0.0, 0, 1.0});
  for (const ChannelSegment& s : segments) {
    const double n = static_cast<double>(s.values.size()), m = meanOf(s.values);
    level.squares += n * m * m;
    ++level.freedom;
    trend.squares += trendOf(s.values).second;
    ++trend.freedom;
    for (Component& c : decay) {
      c.squares += decayFit(c.location_value, s).second;
      ++c.freedom;
    }
    if (!s.angle.empty()) countOrders(s, halves, orders);
  }
  std::vector<Component> all{level, trend};
  all.insert(all.end(), decay.begin(), decay.end());
  all.insert(all.end(), halves.begin(), halves.end());
  all.insert(all.end(), orders.begin(), orders.end());
  const Component frequency = strongestFrequency(segments);
  if (frequency.freedom > 0) all.push_back(frequency);
  return all;
}

// A component of one segment.
struct RemovedPart {
  double amplitude = 0.0, squares = 0.0, std_dev = 1.0;
};

// Removes a component from a segment; nothing if the segment cannot contain it.
std::optional<RemovedPart> removeFrom(const Component& c, ChannelSegment& s) {
  const double n = static_cast<double>(s.values.size());
  if (c.kind == ComponentKind::level) {
    const double mean = meanOf(s.values);
    for (double& v : s.values) v -= mean;
    return RemovedPart{mean, n * mean * mean, 1.0 / std::sqrt(n)};
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

// Removes a component from every segment. @return its finding
Finding removeComponent(const Component& c, const std::string& channel,
                        std::vector<ChannelSegment>& segments) {
  Finding f = named(c, channel);
  std::vector<TestAmplitude> amplitudes;
  for (ChannelSegment& s : segments) {
    const std::optional<RemovedPart> removed = removeFrom(c, s);
    if (!removed) continue;
    amplitudes.push_back({s.test, removed->amplitude, removed->std_dev});
    if (chiSquareTail(removed->squares, 2) < 1e-4) f.tests.push_back(s.test->test.name);
    f.amplitude = std::max(f.amplitude, std::abs(removed->amplitude) * s.noise);
  }
  f.depends_on = dependentConditions(amplitudes);
  return f;
}

// One channel of a campaign.
struct Channel {
  std::vector<ChannelSegment> segments;
  double samples = 0.0;
  double floor = 0.0;  // squares by which two accurate simulations may differ
};

Channel channelOf(const TwinRunner& runner, const std::vector<double>& residual, const std::string& name,
                  double twin_accuracy) {
  constexpr std::size_t LEAST_SAMPLES = 32;
  Channel channel;
  for (const ChannelSpan& block : runner.spans()) {
    if (block.channel != name || block.slow || !block.in_gap) continue;
    const TestData& test = runner.data().tests[block.test];
    const std::size_t from = test.test.kind == TestKind::cut ? test.first_cut : 0;
    if (block.size < from + LEAST_SAMPLES) continue;
    ChannelSegment s{&test, block.noise, {}, {}, test.test.sample_rate, {}};
    s.values.assign(residual.begin() + static_cast<std::ptrdiff_t>(block.offset + from),
                    residual.begin() + static_cast<std::ptrdiff_t>(block.offset + block.size));
    if (test.test.kind != TestKind::tap && test.record.has("spindle_angle"))
      s.angle = unwrapped(test.record.column("spindle_angle"), from);
    if (!s.angle.empty()) s.lines.emplace(s.angle);
    channel.samples += static_cast<double>(s.values.size());
    for (std::size_t i = block.offset; i < block.offset + block.size; ++i) {
      const double accuracy = twin_accuracy * runner.measured()[i];
      channel.floor += accuracy * accuracy;
    }
    channel.segments.push_back(std::move(s));
  }
  return channel;
}

// Decomposes a channel. @return p-values of the last trials, which found nothing
std::vector<double> decompose(const std::string& name, Channel channel, const StructureOptions& options,
                              double all_excess, std::vector<Finding>& found) {
  for (int step = 0; step < options.most; ++step) {
    const std::vector<Component> all = componentsOf(channel.segments);
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
    if (chiSquareTail(squares, b.size + b.size % 2) < 1e-4) f.tests.push_back(test.test.name);
    f.amplitude = std::max(f.amplitude, std::abs(sum / n) * b.noise);
    f.squares += squares;
    count += b.size;
  }
  if (count == 0) return;
  f.p_value = chiSquareTail(f.squares, count + count % 2);
  if (f.p_value > options.p_value || f.squares < 2.0 * static_cast<double>(count) + floor) {
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
    Channel channel = channelOf(runner, residual, names[k], options.twin_accuracy);
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
