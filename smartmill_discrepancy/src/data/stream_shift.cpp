#include "smartmill_discrepancy/data/stream_shift.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_sim/twin/axis_motion.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

using Values = std::vector<double>;

constexpr char AXES[] = {'x', 'y', 'z'};

// Force and acceleration of one test about their means.
struct Pair {
  Values force, acceleration;  // [N], [m/s2]
};

// Sums over the overlap of a force and the acceleration that is earlier by each shift, from -last to last
// samples.
struct Sums {
  Values product, force, acceleration;  // sum f a, sum f2, sum a2

  explicit Sums(std::size_t last) : product(2 * last + 1), force(product), acceleration(product) {}

  void add(const Sums& other) {
    for (std::size_t k = 0; k < product.size(); ++k) {
      product[k] += other.product[k];
      force[k] += other.force[k];
      acceleration[k] += other.acceleration[k];
    }
  }
  // [1] of the squares of the force, by one factor on the acceleration
  double explained(std::size_t k) const {
    const double squares = force[k] * acceleration[k];
    return squares > 0.0 ? product[k] * product[k] / squares : 0.0;
  }
  std::size_t best() const {
    std::size_t best = 0;
    for (std::size_t k = 1; k < product.size(); ++k) best = explained(k) > explained(best) ? k : best;
    return best;
  }
};

Values cumulativeSquares(const Values& values) {
  Values sums(1, 0.0);
  for (const double v : values) sums.push_back(sums.back() + v * v);
  return sums;
}

// Correlation by the transform of the padded signals.
Sums sumsOf(const Pair& pair, std::size_t last) {
  const std::size_t n = pair.force.size(), padded = n + last + 1;
  Values f = pair.force, a = pair.acceleration;
  f.resize(padded);
  a.resize(padded);
  std::vector<std::complex<double>> spectrum = fourier(f);
  const std::vector<std::complex<double>> other = fourier(a);
  for (std::size_t k = 0; k < spectrum.size(); ++k) spectrum[k] *= std::conj(other[k]);
  const Values correlation = inverseFourier(spectrum, padded);
  const Values force = cumulativeSquares(pair.force), acceleration = cumulativeSquares(pair.acceleration);
  Sums sums(last);
  for (std::size_t k = 0; k < sums.product.size(); ++k) {
    const auto shift = static_cast<std::int64_t>(k) - static_cast<std::int64_t>(last);
    const std::size_t size = static_cast<std::size_t>(std::abs(shift));
    if (size >= n) continue;
    const bool late = shift >= 0;
    sums.product[k] = correlation[late ? size : padded - size];
    sums.force[k] = late ? force[n] - force[size] : force[n - size];
    sums.acceleration[k] = late ? acceleration[n - size] : acceleration[n] - acceleration[size];
  }
  return sums;
}

// A test in which axes move, and whose streams have no stated offset.
struct MovingTest {
  const RecordedTest* recorded = nullptr;
  sim::AxisMotion motion;
};

std::vector<MovingTest> movingTests(const std::vector<RecordedTest>& tests) {
  std::vector<MovingTest> moving;
  for (const RecordedTest& one : tests) {
    const auto& stated = one.test.stream_offset;
    if (!sim::AxisMotion::isRecorded(one.record) || stated.count("force") > 0 ||
        stated.count("controller") > 0)
      continue;
    // As the effect axis_inertia.
    moving.push_back({&one, {one.record, one.test.sample_rate, sim::SimulationOptions().axis_smoothing}});
  }
  return moving;
}

std::optional<Pair> pairOf(const MovingTest& test, std::size_t axis) {
  const std::string force = std::string("f") + AXES[axis];
  if (test.motion.samples(axis).empty() || !test.recorded->record.has(force)) return {};
  Pair pair{test.recorded->record.column(force), test.motion.samples(axis)};
  for (Values* values : {&pair.force, &pair.acceleration}) {
    const double level = mean(*values);
    for (double& v : *values) v -= level;
  }
  return pair;
}

// Whether another shift, outside the peak about the best one, explains nearly as much.
bool isAmbiguous(const Sums& sums, std::size_t best, const StreamShiftOptions& options) {
  const double most = sums.explained(best);
  std::size_t from = best, to = best;
  while (from > 0 && sums.explained(from) > options.lobe * most) --from;
  while (to + 1 < sums.product.size() && sums.explained(to) > options.lobe * most) ++to;
  for (std::size_t k = 0; k < sums.product.size(); ++k) {
    if ((k < from || k > to) && sums.explained(k) > options.max_other * most) return true;
  }
  return false;
}

// Top [samples] of the parabola through the explained shares at half the width of the peak to either side.
double topOf(const Sums& sums, std::size_t best) {
  std::size_t reach = 1;
  const double most = sums.explained(best);
  while (best > reach && best + reach + 1 < sums.product.size() &&
         std::min(sums.explained(best - reach), sums.explained(best + reach)) > 0.9 * most)
    ++reach;
  const double before = sums.explained(best - reach), after = sums.explained(best + reach);
  const double bend = 2.0 * most - before - after;
  return static_cast<double>(best) +
         (bend > 0.0 ? 0.5 * static_cast<double>(reach) * (after - before) / bend : 0.0);
}

bool isAtAnEnd(const Sums& sums, std::size_t at) {
  return at == 0 || at + 1 == sums.product.size();
}

// [samples] Scatter of the shifts of the single tests about the common one, each by its share of the squares.
double scatterOf(const std::vector<Sums>& tests, double top, const StreamShiftOptions& options) {
  double weights = 0.0, squares = 0.0, count = 0.0;
  for (const Sums& sums : tests) {
    const std::size_t own = sums.best();
    if (sums.explained(own) < options.min_explained || isAtAnEnd(sums, own)) continue;
    weights += sums.acceleration[own];
    squares += sums.acceleration[own] * std::pow(topOf(sums, own) - top, 2);
    count += 1.0;
  }
  return count > 1.0 ? std::sqrt(squares / weights / (count - 1.0)) : 0.0;
}

std::optional<StreamShift> shiftAlong(std::size_t axis, const std::vector<MovingTest>& tests,
                                      const StreamShiftOptions& options) {
  std::vector<Sums> single;
  std::optional<Sums> all;
  double rate = 0.0;
  std::size_t last = 0;
  for (const MovingTest& test : tests) {
    const std::optional<Pair> pair = pairOf(test, axis);
    const double own_rate = test.recorded->test.sample_rate;
    if (!pair || (rate > 0.0 && own_rate != rate)) continue;
    rate = own_rate;
    last = static_cast<std::size_t>(options.range * rate);
    single.push_back(sumsOf(*pair, last));
    if (!all) all.emplace(last);
    all->add(single.back());
  }
  if (!all) return {};
  const std::size_t at = all->best();
  const double explained = all->explained(at);
  if (explained < options.min_explained || isAtAnEnd(*all, at) || isAmbiguous(*all, at, options)) return {};
  const double top = topOf(*all, at), rounding = std::sqrt(1.0 / 12.0);  // [samples] of the columns' clocks
  return StreamShift{(top - static_cast<double>(last)) / rate,
                     std::hypot(scatterOf(single, top, options), rounding) / rate, explained, AXES[axis]};
}

}  // namespace

std::optional<StreamShift> shiftOfForces(const std::vector<RecordedTest>& tests,
                                         const StreamShiftOptions& options) {
  const std::vector<MovingTest> moving = movingTests(tests);
  std::optional<StreamShift> best;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::optional<StreamShift> shift = shiftAlong(axis, moving, options);
    if (shift && (!best || best->explained <= shift->explained)) best = shift;
  }
  return best;
}

}  // namespace smartmill::discrepancy
