#include "smartmill_discrepancy/gap/structure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numeric>
#include <set>
#include <tuple>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

constexpr double LEAST_P = 1e-300;
constexpr std::size_t ORDERS = 36;
constexpr std::size_t HALF_ORDERS = 4;  // 0.5, 1.5, ..
constexpr std::size_t PADDED = 1 << 16;

using Turn = std::complex<double>;

// The part of a block in which one kind of thing goes on: the cut of a cut, all of the rest.
struct Stretch {
  const TestData* test;
  std::size_t block;
  double noise;
  std::vector<double> values;
  std::vector<double> angle;  // unwrapped; empty without spindle angle
  std::vector<Turn> turns;    // exp(i angle)
  double rate;
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

template <class Phase>
Line lineOf(const std::vector<double>& values, const Phase& phase) {
  LineSums sums;
  for (std::size_t i = 0; i < values.size(); ++i) sums.add(std::sin(phase(i)), std::cos(phase(i)), values[i]);
  return sums.solve();
}

// Lines at orders 1..ORDERS of the spindle, each by itself.
std::array<Line, ORDERS> orderLines(const std::vector<double>& values, const std::vector<Turn>& turns) {
  std::array<LineSums, ORDERS> sums;
  for (std::size_t i = 0; i < values.size(); ++i) {
    Turn at{1.0, 0.0};
    for (LineSums& order : sums) {
      at *= turns[i];
      order.add(at.imag(), at.real(), values[i]);
    }
  }
  std::array<Line, ORDERS> lines;
  for (std::size_t k = 0; k < ORDERS; ++k) lines[k] = sums[k].solve();
  return lines;
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
  double xy = 0.0, xx = 0.0;
  for (std::size_t i = 0; i < s.values.size(); ++i) {
    const double shape = settled(time_constant, s, i);
    xy += shape * s.values[i];
    xx += shape * shape;
  }
  return {xy / xx, xy * xy / xx};
}

std::vector<Candidate> candidatesOf(const std::vector<Stretch>& stretches) {
  std::vector<Candidate> all;
  Candidate level{Kind::level, 0.0, 0.0, 0, 1.0}, trend{Kind::trend, 0.0, 0.0, 0, 1.0};
  std::vector<Candidate> orders;
  std::vector<Candidate> halves, settling;
  for (std::size_t k = 0; k < HALF_ORDERS; ++k)
    halves.push_back({Kind::order, static_cast<double>(k) + 0.5, 0.0, 0, 1.0});
  for (const double t : {0.02, 0.035, 0.06, 0.1}) settling.push_back({Kind::settling, t, 0.0, 0, 2.0});
  for (std::size_t k = 1; k <= ORDERS; ++k)
    orders.push_back({Kind::order, static_cast<double>(k), 0.0, 0, 1.0});
  double rate = 0.0;
  std::size_t longest = 0;
  std::vector<double> sum(PADDED / 2 + 1, 0.0);
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
    rate = std::max(rate, s.rate);
    longest = std::max(longest, s.values.size());
    if (!s.angle.empty()) {
      const std::array<Line, ORDERS> lines = orderLines(s.values, s.turns);
      for (Candidate& o : halves) {
        o.squares += lineOf(s.values, [&](std::size_t i) { return o.place * s.angle[i]; }).squares;
        o.freedom += 2;
      }
      for (std::size_t k = 0; k < ORDERS; ++k) {
        Candidate& o = orders[k];
        if (o.place * s.test->test.spindle_speed / units::TWO_PI > 0.45 * s.rate) continue;
        o.squares += lines[k].squares;
        o.freedom += 2;
      }
    }
  }
  std::size_t used = 0;
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
  all.push_back(level);
  all.push_back(trend);
  all.insert(all.end(), settling.begin(), settling.end());
  all.insert(all.end(), halves.begin(), halves.end());
  all.insert(all.end(), orders.begin(), orders.end());
  if (used > 0) {
    // Below one cycle a record a line is a trend.
    const auto first = static_cast<std::size_t>(PADDED / longest + 1);
    const auto top = static_cast<std::size_t>(
        std::max_element(sum.begin() + static_cast<std::ptrdiff_t>(first), sum.end() - 1) - sum.begin());
    double place = static_cast<double>(top);
    const double a = sum[top - 1], b = sum[top], c = sum[top + 1];
    if (2.0 * b - a - c > 0.0) place += 0.5 * (c - a) / (2.0 * b - a - c);
    all.push_back(
        {Kind::frequency, place * rate / PADDED, sum[top], 2 * used, 0.5 * static_cast<double>(longest)});
  }
  return all;
}

// Rank of association of the line's amplitudes with the tests' conditions.
std::vector<std::string> dependence(const std::vector<const TestData*>& tests,
                                    const std::vector<double>& amplitudes,
                                    const std::vector<double>& std_devs) {
  std::vector<std::string> names;
  std::vector<double> cut, rest;
  std::vector<std::size_t> cuts;
  for (std::size_t t = 0; t < tests.size(); ++t) {
    (tests[t]->test.kind == TestKind::cut ? cut : rest).push_back(amplitudes[t]);
    if (tests[t]->test.kind == TestKind::cut) cuts.push_back(t);
  }
  const auto rmsOf = [](const std::vector<double>& v) {
    double s = 0.0;
    for (const double x : v) s += x * x;
    return v.empty() ? 0.0 : std::sqrt(s / static_cast<double>(v.size()));
  };
  if (!cut.empty() && !rest.empty() && rmsOf(rest) < 0.3 * rmsOf(cut)) names.push_back("cutting");
  struct Condition {
    const char* name;
    std::vector<double> values;
  };
  const bool among_cuts = cuts.size() >= 4;
  std::vector<std::size_t> chosen = cuts;
  if (!among_cuts) {
    chosen.clear();
    for (std::size_t t = 0; t < tests.size(); ++t) {
      if (tests[t]->test.kind != TestKind::tap) chosen.push_back(t);
    }
  }
  std::vector<Condition> conditions{{"speed", {}}, {"time", {}}};
  if (among_cuts)
    conditions = {{"speed", {}}, {"chip_load", {}}, {"depth", {}}, {"immersion", {}}, {"time", {}}};
  for (const std::size_t t : chosen) {
    const CampaignTest& test = tests[t]->test;
    for (Condition& c : conditions) {
      const std::string name = c.name;
      c.values.push_back(name == "speed"       ? test.spindle_speed
                         : name == "chip_load" ? test.engagement->feed_per_tooth
                         : name == "depth"     ? test.engagement->axial_depth
                         : name == "immersion"
                             ? test.engagement->exit - test.engagement->entry + test.engagement->entry / 7.0
                             : test.start_time.value_or(0.0));
    }
  }
  const std::size_t n = chosen.size();
  if (n < 4) return names;
  // Spread beyond the amplitudes' own uncertainty?
  double weighted = 0.0, weights = 0.0;
  for (const std::size_t t : chosen) {
    weighted += amplitudes[t] / (std_devs[t] * std_devs[t]);
    weights += 1.0 / (std_devs[t] * std_devs[t]);
  }
  double spread = 0.0;
  for (const std::size_t t : chosen) {
    const double z = (amplitudes[t] - weighted / weights) / std_devs[t];
    spread += z * z;
  }
  if (chiSquareTail(spread, n - 1 + (n - 1) % 2) > 1e-4) return names;
  std::vector<std::pair<double, std::string>> strengths;
  for (const Condition& c : conditions) {
    double mx = meanOf(c.values), my = 0.0;
    for (const std::size_t t : chosen) my += amplitudes[t] / static_cast<double>(n);
    double xx = 0.0, yy = 0.0, xy = 0.0;
    for (std::size_t k = 0; k < n; ++k) {
      const double x = c.values[k] - mx, y = amplitudes[chosen[k]] - my;
      xx += x * x;
      yy += y * y;
      xy += x * y;
    }
    if (xx <= 0.0 || yy <= 0.0) continue;
    const double r = std::abs(xy) / std::sqrt(xx * yy);
    // Fisher's z against chance among n tests and as many looks as there are conditions.
    const double z =
        std::atanh(std::min(r, 0.999999)) * std::sqrt(std::max(static_cast<double>(n) - 3.0, 1.0));
    if (std::erfc(z / std::sqrt(2.0)) * static_cast<double>(conditions.size()) < 0.05)
      strengths.emplace_back(-r, c.name);
  }
  std::sort(strengths.begin(), strengths.end());
  for (const auto& s : strengths) names.push_back(s.second);
  return names;
}

}  // namespace

double chiSquareTail(double value, std::size_t freedom) {
  // exp(-x/2) sum (x/2)^k / k!, in logarithms.
  const double half = 0.5 * value;
  if (half <= 0.0) return 1.0;
  double largest = -1e308, sum = 0.0;
  std::vector<double> logs;
  for (std::size_t k = 0; k < std::max<std::size_t>(freedom / 2, 1); ++k) {
    logs.push_back(static_cast<double>(k) * std::log(half) - std::lgamma(static_cast<double>(k) + 1.0) -
                   half);
    largest = std::max(largest, logs.back());
  }
  for (const double l : logs) sum += std::exp(l - largest);
  return std::clamp(std::exp(largest + std::log(sum)), LEAST_P, 1.0);
}

std::vector<double> falseDiscoveryRates(const std::vector<double>& p_values) {
  const std::size_t n = p_values.size();
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return p_values[a] < p_values[b]; });
  std::vector<double> rates(n);
  double least = 1.0;
  for (std::size_t k = n; k-- > 0;) {
    least = std::min(least, p_values[order[k]] * static_cast<double>(n) / static_cast<double>(k + 1));
    rates[order[k]] = std::max(least, LEAST_P);
  }
  return rates;
}

std::vector<Finding> findStructure(const TwinRunner& runner, const std::vector<double>& residual,
                                   const StructureOptions& options) {
  std::set<std::string> channels;
  double all_excess = options.squares_of_gap;
  if (all_excess <= 0.0) {
    double all_squares = 0.0;
    for (const double r : residual) all_squares += r * r;
    all_excess = std::max(all_squares - static_cast<double>(residual.size()), 1.0);
  }
  for (const Block& b : runner.blocks()) channels.insert(b.channel);
  std::vector<Finding> found;
  std::vector<double> looks;  // p-values of every look that found nothing, for the control of false discovery
  for (const std::string& channel : channels) {
    std::vector<Stretch> stretches;
    double samples = 0.0, floor = 0.0;
    for (std::size_t b = 0; b < runner.blocks().size(); ++b) {
      const Block& block = runner.blocks()[b];
      if (block.channel != channel) continue;
      const TestData& test = runner.data().tests[block.test];
      const std::size_t from = test.test.kind == TestKind::cut ? test.first_cut : 0;
      if (block.size < from + 32) continue;
      Stretch s{&test, b, block.noise, {}, {}, {}, test.test.sample_rate};
      s.values.assign(residual.begin() + static_cast<std::ptrdiff_t>(block.offset + from),
                      residual.begin() + static_cast<std::ptrdiff_t>(block.offset + block.size));
      if (test.test.kind != TestKind::tap && test.record.has("spindle_angle"))
        s.angle = unwrapped(test.record.column("spindle_angle"), from);
      for (const double a : s.angle) s.turns.push_back(std::polar(1.0, a));
      samples += static_cast<double>(s.values.size());
      for (std::size_t i = block.offset; i < block.offset + block.size; ++i) {
        const double trust = options.twin_accuracy * runner.measured()[i];
        floor += trust * trust;
      }
      stretches.push_back(std::move(s));
    }
    if (stretches.empty()) continue;
    for (int step = 0; step < options.most; ++step) {
      const std::vector<Candidate> all = candidatesOf(stretches);
      std::vector<double> p_values;
      for (const Candidate& c : all)
        p_values.push_back(
            std::min(1.0, c.freedom ? c.looks * chiSquareTail(c.squares, c.freedom + c.freedom % 2) : 1.0));
      const Candidate* best = nullptr;
      for (const Candidate& c : all) {
        if (c.freedom > 0 && (!best || excess(c) > excess(*best))) best = &c;
      }
      const double p = p_values[static_cast<std::size_t>(best - all.data())];
      if (p > options.p_value || best->squares < options.least_share * samples + floor) {
        looks.insert(looks.end(), p_values.begin(), p_values.end());
        break;
      }
      Finding f;
      f.channel = channel;
      f.domain = best->kind == Kind::level                                   ? "level"
                 : best->kind == Kind::trend || best->kind == Kind::settling ? "time"
                 : best->kind == Kind::order                                 ? "order"
                                                                             : "frequency";
      if (best->kind == Kind::order) f.location["order"] = best->place;
      if (best->kind == Kind::frequency) f.location["frequency_hz"] = best->place;
      if (best->kind == Kind::trend) f.location["time_s"] = 0.0;
      if (best->kind == Kind::settling) f.location["time_s"] = best->place;
      f.p_value = p;
      f.share_of_gap = (best->squares - static_cast<double>(best->freedom)) / all_excess;
      f.squares = best->squares;
      std::vector<const TestData*> tests;
      std::vector<double> amplitudes, std_devs;
      for (Stretch& s : stretches) {
        const double n = static_cast<double>(s.values.size());
        double amplitude = 0.0, squares = 0.0, std_dev = 1.0 / std::sqrt(n);
        if (best->kind == Kind::level) {
          amplitude = meanOf(s.values);
          squares = n * amplitude * amplitude;
          for (double& v : s.values) v -= amplitude;
        } else if (best->kind == Kind::trend) {
          const auto [slope, taken] = trendOf(s.values);
          squares = taken;
          amplitude = slope * s.rate;
          std_dev = s.rate * std::sqrt(12.0 / (n * n * n));
          for (std::size_t i = 0; i < s.values.size(); ++i)
            s.values[i] -= slope * (static_cast<double>(i) - 0.5 * (n - 1.0));
        } else if (best->kind == Kind::settling) {
          std::tie(amplitude, squares) = settlingOf(best->place, s);
          std_dev = std::sqrt(2.0 / (s.rate * best->place));
          for (std::size_t i = 0; i < s.values.size(); ++i)
            s.values[i] -= amplitude * settled(best->place, s, i);
        } else {
          if (best->kind == Kind::order && s.angle.empty()) continue;
          const auto phase = [&](std::size_t i) {
            return best->kind == Kind::order ? best->place * s.angle[i]
                                             : units::TWO_PI * best->place * static_cast<double>(i) / s.rate;
          };
          const Line line = lineOf(s.values, phase);
          amplitude = std::hypot(line.sine, line.cosine);
          squares = line.squares;
          std_dev = std::sqrt(2.0 / n);
          subtract(s.values, phase, line);
        }
        tests.push_back(s.test);
        amplitudes.push_back(amplitude);
        std_devs.push_back(std_dev);
        if (chiSquareTail(squares, 2) < 1e-4) f.tests.push_back(s.test->test.name);
        f.amplitude = std::max(f.amplitude, std::abs(amplitude) * s.noise);
      }
      f.depends_on = dependence(tests, amplitudes, std_devs);
      found.push_back(std::move(f));
    }
  }
  std::vector<double> p_values = looks;
  for (const Finding& f : found) p_values.push_back(f.p_value);
  const std::vector<double> rates = falseDiscoveryRates(p_values);
  for (std::size_t k = 0; k < found.size(); ++k) found[k].p_value = rates[looks.size() + k];
  found.erase(std::remove_if(found.begin(), found.end(),
                             [&](const Finding& f) { return f.p_value > options.p_value; }),
              found.end());
  std::stable_sort(found.begin(), found.end(),
                   [](const Finding& a, const Finding& b) { return a.share_of_gap > b.share_of_gap; });
  if (found.size() > 2 * static_cast<std::size_t>(options.most))
    found.resize(2 * static_cast<std::size_t>(options.most));
  return found;
}

}  // namespace smartmill::discrepancy
