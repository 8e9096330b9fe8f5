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

// Squares that a sine of these phases takes from the values, and its amplitude.
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

// Lines at orders of the spindle, each by itself. What of them does not depend on the values is summed once.
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

  Orders whole_, half_;
  std::array<LineSums, ORDERS> wholes_;
  std::array<LineSums, HALF_ORDERS> halves_;
};

// The part of a block in which one kind of thing goes on: the cut of a cut, all of the rest.
struct Stretch {
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

enum class Kind { level, trend, settling, order, frequency };

struct Candidate {
  Kind kind = Kind::level;
  double place = 0.0;    // order or Hz
  double squares = 0.0;  // over all stretches
  std::size_t freedom = 0;
  double looks = 1.0;  // independent places looked at
};

double excess(const Candidate& c) {
  return (c.squares - static_cast<double>(c.freedom)) /
         std::sqrt(2.0 * static_cast<double>(std::max<std::size_t>(c.freedom, 1)));
}

double meanOf(const std::vector<double>& v) {
  return std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
}

// Slope per sample about the middle, and squares that it takes.
std::pair<double, double> trendOf(const std::vector<double>& v) {
  const double n = static_cast<double>(v.size()), middle = 0.5 * (n - 1.0);
  double xy = 0.0;
  for (std::size_t i = 0; i < v.size(); ++i) xy += (static_cast<double>(i) - middle) * v[i];
  const double xx = n * (n * n - 1.0) / 12.0;
  return {xy / xx, xy * xy / xx};
}

// Of something that settles from the record's start on, place: its time constant [s].
double settled(double time_constant, const Stretch& s, std::size_t i) {
  return std::exp(-static_cast<double>(i) / (s.rate * time_constant));
}

// Size of it and squares that it takes.
std::pair<double, double> settlingOf(double time_constant, const Stretch& s) {
  const double share = settled(time_constant, s, 1);  // from one sample to the next
  double xy = 0.0, xx = 0.0, shape = 1.0;
  for (const double value : s.values) {
    xy += shape * value;
    xx += shape * shape;
    shape *= share;
  }
  return {xy / xx, xy * xy / xx};
}

void countOrders(const Stretch& s, std::vector<Candidate>& halves, std::vector<Candidate>& orders) {
  const std::array<Line, ORDERS> lines = s.lines->wholes(s.values);
  const std::array<Line, HALF_ORDERS> between = s.lines->halves(s.values);
  for (std::size_t k = 0; k < HALF_ORDERS; ++k) {
    halves[k].squares += between[k].squares;
    halves[k].freedom += 2;
  }
  for (std::size_t k = 0; k < ORDERS; ++k) {
    Candidate& o = orders[k];
    if (o.place * s.test->test.spindle_speed / units::TWO_PI > 0.45 * s.rate) continue;
    o.squares += lines[k].squares;
    o.freedom += 2;
  }
}

// The strongest line at a fixed frequency over all stretches of the highest rate; no freedom: there is none.
Candidate strongestFrequency(const std::vector<Stretch>& stretches) {
  double rate = 0.0;
  std::size_t longest = 0, used = 0;
  for (const Stretch& s : stretches) {
    rate = std::max(rate, s.rate);
    longest = std::max(longest, s.values.size());
  }
  std::vector<double> sum(PADDED / 2 + 1, 0.0);
  for (const Stretch& s : stretches) {
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
  // Below one cycle a record a line is a trend.
  const auto first = static_cast<std::size_t>(PADDED / longest + 1);
  const auto top = static_cast<std::size_t>(
      std::max_element(sum.begin() + static_cast<std::ptrdiff_t>(first), sum.end() - 1) - sum.begin());
  double place = static_cast<double>(top);
  const double a = sum[top - 1], b = sum[top], c = sum[top + 1];
  if (2.0 * b - a - c > 0.0) place += 0.5 * (c - a) / (2.0 * b - a - c);
  return {Kind::frequency, place * rate / PADDED, sum[top], 2 * used, 0.5 * static_cast<double>(longest)};
}

std::vector<Candidate> candidatesOf(const std::vector<Stretch>& stretches) {
  Candidate level{Kind::level, 0.0, 0.0, 0, 1.0}, trend{Kind::trend, 0.0, 0.0, 0, 1.0};
  std::vector<Candidate> orders, halves, settling;
  for (std::size_t k = 0; k < HALF_ORDERS; ++k)
    halves.push_back({Kind::order, static_cast<double>(k) + 0.5, 0.0, 0, 1.0});
  for (const double t : {0.02, 0.035, 0.06, 0.1}) settling.push_back({Kind::settling, t, 0.0, 0, 2.0});
  for (std::size_t k = 1; k <= ORDERS; ++k)
    orders.push_back({Kind::order, static_cast<double>(k), 0.0, 0, 1.0});
  for (const Stretch& s : stretches) {
    const double n = static_cast<double>(s.values.size()), m = meanOf(s.values);
    level.squares += n * m * m;
    ++level.freedom;
    trend.squares += trendOf(s.values).second;
    ++trend.freedom;
    for (Candidate& c : settling) {
      c.squares += settlingOf(c.place, s).second;
      ++c.freedom;
    }
    if (!s.angle.empty()) countOrders(s, halves, orders);
  }
  std::vector<Candidate> all{level, trend};
  all.insert(all.end(), settling.begin(), settling.end());
  all.insert(all.end(), halves.begin(), halves.end());
  all.insert(all.end(), orders.begin(), orders.end());
  const Candidate frequency = strongestFrequency(stretches);
  if (frequency.freedom > 0) all.push_back(frequency);
  return all;
}

// What a candidate was in one stretch.
struct Taken {
  double amplitude = 0.0, squares = 0.0, std_dev = 1.0;
};

// Takes a candidate's part out of a stretch; nothing where it cannot be there.
std::optional<Taken> takeAway(const Candidate& c, Stretch& s) {
  const double n = static_cast<double>(s.values.size());
  if (c.kind == Kind::level) {
    const double mean = meanOf(s.values);
    for (double& v : s.values) v -= mean;
    return Taken{mean, n * mean * mean, 1.0 / std::sqrt(n)};
  }
  if (c.kind == Kind::trend) {
    const auto [slope, squares] = trendOf(s.values);
    for (std::size_t i = 0; i < s.values.size(); ++i)
      s.values[i] -= slope * (static_cast<double>(i) - 0.5 * (n - 1.0));
    return Taken{slope * s.rate, squares, s.rate * std::sqrt(12.0 / (n * n * n))};
  }
  if (c.kind == Kind::settling) {
    const auto [size, squares] = settlingOf(c.place, s);
    for (std::size_t i = 0; i < s.values.size(); ++i) s.values[i] -= size * settled(c.place, s, i);
    return Taken{size, squares, std::sqrt(2.0 / (s.rate * c.place))};
  }
  if (c.kind == Kind::order && s.angle.empty()) return {};
  const auto phase = [&](std::size_t i) {
    return c.kind == Kind::order ? c.place * s.angle[i]
                                 : units::TWO_PI * c.place * static_cast<double>(i) / s.rate;
  };
  const Line line = lineOf(s.values, phase);
  subtract(s.values, phase, line);
  return Taken{std::hypot(line.sine, line.cosine), line.squares, std::sqrt(2.0 / n)};
}

// Domain and location as reports name them.
Finding named(const Candidate& c, const std::string& channel) {
  Finding f;
  f.channel = channel;
  switch (c.kind) {
    case Kind::level:
      f.domain = "level";
      break;
    case Kind::trend:
      f.domain = "time";
      f.location["time_s"] = 0.0;
      break;
    case Kind::settling:
      f.domain = "time";
      f.location["time_s"] = c.place;
      break;
    case Kind::order:
      f.domain = "order";
      f.location["order"] = c.place;
      break;
    case Kind::frequency:
      f.domain = "frequency";
      f.location["frequency_hz"] = c.place;
  }
  f.squares = c.squares;
  return f;
}

// Takes a candidate out of every stretch and tells of it.
Finding take(const Candidate& c, const std::string& channel, std::vector<Stretch>& stretches) {
  Finding f = named(c, channel);
  std::vector<Shown> shown;
  for (Stretch& s : stretches) {
    const std::optional<Taken> taken = takeAway(c, s);
    if (!taken) continue;
    shown.push_back({s.test, taken->amplitude, taken->std_dev});
    if (chiSquareTail(taken->squares, 2) < 1e-4) f.tests.push_back(s.test->test.name);
    f.amplitude = std::max(f.amplitude, std::abs(taken->amplitude) * s.noise);
  }
  f.depends_on = dependence(shown);
  return f;
}

// One channel of a campaign, to be taken apart.
struct Channel {
  std::vector<Stretch> stretches;
  double samples = 0.0;
  double floor = 0.0;  // squares by which two faithful twins may differ
};

Channel channelOf(const TwinRunner& runner, const std::vector<double>& residual, const std::string& name,
                  double twin_accuracy) {
  constexpr std::size_t LEAST_SAMPLES = 32;
  Channel channel;
  for (const Block& block : runner.blocks()) {
    if (block.channel != name || block.slow || !block.judged) continue;
    const TestData& test = runner.data().tests[block.test];
    const std::size_t from = test.test.kind == TestKind::cut ? test.first_cut : 0;
    if (block.size < from + LEAST_SAMPLES) continue;
    Stretch s{&test, block.noise, {}, {}, test.test.sample_rate, {}};
    s.values.assign(residual.begin() + static_cast<std::ptrdiff_t>(block.offset + from),
                    residual.begin() + static_cast<std::ptrdiff_t>(block.offset + block.size));
    if (test.test.kind != TestKind::tap && test.record.has("spindle_angle"))
      s.angle = unwrapped(test.record.column("spindle_angle"), from);
    if (!s.angle.empty()) s.lines.emplace(s.angle);
    channel.samples += static_cast<double>(s.values.size());
    for (std::size_t i = block.offset; i < block.offset + block.size; ++i) {
      const double trust = twin_accuracy * runner.measured()[i];
      channel.floor += trust * trust;
    }
    channel.stretches.push_back(std::move(s));
  }
  return channel;
}

// Takes a channel apart. Returns the p-values of the last looks, which found nothing.
std::vector<double> takeApart(const std::string& name, Channel channel, const StructureOptions& options,
                              double all_excess, std::vector<Finding>& found) {
  for (int step = 0; step < options.most; ++step) {
    const std::vector<Candidate> all = candidatesOf(channel.stretches);
    std::vector<double> p_values;
    const Candidate* best = nullptr;
    for (const Candidate& c : all) {
      p_values.push_back(
          std::min(1.0, c.freedom ? c.looks * chiSquareTail(c.squares, c.freedom + c.freedom % 2) : 1.0));
      if (c.freedom > 0 && (!best || excess(c) > excess(*best))) best = &c;
    }
    const double p = p_values[static_cast<std::size_t>(best - all.data())];
    if (p > options.p_value || best->squares < options.least_share * channel.samples + channel.floor)
      return p_values;
    Finding f = take(*best, name, channel.stretches);
    f.p_value = p;
    f.share_of_gap = (best->squares - static_cast<double>(best->freedom)) / all_excess;
    found.push_back(std::move(f));
  }
  return {};
}

// Corrects the p-values for all looks and keeps what stands, the largest first.
void keepSignificant(const std::vector<double>& looks, const StructureOptions& options,
                     std::vector<Finding>& found) {
  std::vector<double> p_values = looks;
  for (const Finding& f : found) p_values.push_back(f.p_value);
  const std::vector<double> rates = falseDiscoveryRates(p_values);
  for (std::size_t k = 0; k < found.size(); ++k) found[k].p_value = rates[looks.size() + k];
  found.erase(std::remove_if(found.begin(), found.end(),
                             [&](const Finding& f) { return f.p_value > options.p_value; }),
              found.end());
  std::stable_sort(found.begin(), found.end(),
                   [](const Finding& a, const Finding& b) { return a.share_of_gap > b.share_of_gap; });
  const std::size_t most = 2 * static_cast<std::size_t>(options.most);
  if (found.size() > most) found.resize(most);
}

// A channel that was read now and then: whether its level stands where the model says, in all tests together.
void lookAtMeans(const TwinRunner& runner, const std::vector<double>& residual, const std::string& name,
                 const StructureOptions& options, double all_excess, std::vector<Finding>& found,
                 std::vector<double>& looks) {
  Finding f;
  f.channel = name;
  f.domain = "level";
  std::vector<Shown> shown;
  std::size_t count = 0;
  double floor = 0.0;
  for (const Block& b : runner.blocks()) {
    if (b.channel != name || !b.slow || !b.judged) continue;
    const TestData& test = runner.data().tests[b.test];
    double sum = 0.0, squares = 0.0;
    for (std::size_t i = b.offset; i < b.offset + b.size; ++i) {
      sum += residual[i];
      squares += residual[i] * residual[i];
      floor += std::pow(options.twin_accuracy * runner.measured()[i], 2);
    }
    const auto n = static_cast<double>(b.size);
    shown.push_back({&test, sum / n, 1.0 / std::sqrt(n)});
    if (chiSquareTail(squares, b.size + b.size % 2) < 1e-4) f.tests.push_back(test.test.name);
    f.amplitude = std::max(f.amplitude, std::abs(sum / n) * b.noise);
    f.squares += squares;
    count += b.size;
  }
  if (count == 0) return;
  f.p_value = chiSquareTail(f.squares, count + count % 2);
  if (f.p_value > options.p_value || f.squares < 2.0 * static_cast<double>(count) + floor) {
    looks.push_back(f.p_value);
    return;
  }
  f.share_of_gap = (f.squares - static_cast<double>(count)) / all_excess;
  f.depends_on = dependence(shown);
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
  for (const Block& b : runner.blocks()) channels.insert(b.channel);
  struct Looked {
    std::vector<Finding> found;
    std::vector<double> looks;  // p-values of those that found nothing, for the control of false discovery
  };
  const std::vector<std::string> names(channels.begin(), channels.end());
  std::vector<Looked> looked(names.size());
  runParallel(names.size(), runner.threads(), [&](std::size_t k) {
    Looked& of = looked[k];
    Channel channel = channelOf(runner, residual, names[k], options.twin_accuracy);
    lookAtMeans(runner, residual, names[k], options, all_excess, of.found, of.looks);
    if (channel.stretches.empty()) return;
    const std::vector<double> last = takeApart(names[k], std::move(channel), options, all_excess, of.found);
    of.looks.insert(of.looks.end(), last.begin(), last.end());
  });
  std::vector<Finding> found;
  std::vector<double> looks;
  for (const Looked& of : looked) {
    found.insert(found.end(), of.found.begin(), of.found.end());
    looks.insert(looks.end(), of.looks.begin(), of.looks.end());
  }
  keepSignificant(looks, options, found);
  return found;
}

}  // namespace smartmill::discrepancy
