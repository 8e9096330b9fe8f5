// FRF lines of a cut at the harmonics of the spindle.

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/in_cut/cutting_frf.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;

constexpr double MIN_REVOLUTIONS = 11.0;  // the window's main lobe is +-4 of their inverse

std::vector<double> taper(std::size_t size) {
  std::vector<double> window(size);
  for (std::size_t i = 0; i < size; ++i)
    window[i] = blackmanHarris(units::TWO_PI * (static_cast<double>(i) + 0.5) / static_cast<double>(size));
  return window;
}

/// Spindle angle over a part [rad]: a parabola fitted to the measured angle, which removes its noise.
class RotationFit {
 public:
  RotationFit(const CutSegment& cut, std::size_t from, std::size_t size)
      : middle_(0.5 * static_cast<double>(size - 1)), rate_(cut.sample_rate) {
    if (cut.angle.empty()) {
      speed_ = cut.speed;
      return;
    }
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    double unwrapped = 0.0;
    for (std::size_t i = 0; i < size; ++i) {
      if (i > 0) unwrapped += std::remainder(cut.angle[from + i] - cut.angle[from + i - 1], units::TWO_PI);
      const double t = (static_cast<double>(i) - middle_) / middle_;
      const Eigen::Vector3d row(1.0, t, t * t);
      normal += row * row.transpose();
      right += row * unwrapped;
    }
    const Eigen::Vector3d found = normal.ldlt().solve(right);
    speed_ = found[1] / middle_ * rate_;
    bend_ = found[2] / (middle_ * middle_) * rate_ * rate_;
  }
  double speed() const { return speed_; }  // [rad/s] in the middle
  double at(std::size_t i) const {
    const double t = (static_cast<double>(i) - middle_) / rate_;
    return (speed_ + bend_ * t) * t;
  }

 private:
  double middle_, rate_, speed_ = 0.0, bend_ = 0.0;
};

/// Amplitudes at every half order of the spindle, 0, 1/2, 1, ...
struct HalfOrders {
  std::vector<Complex> force, response;
  int neighbours = 0;  // half orders around a harmonic, for its noise

  /// Power of the non-synchronous part at a line, from the half orders around it; divided by their number
  /// less one, since a ratio to so few is distributed as Student's.
  double noise(const std::vector<Complex>& values, std::size_t order) const {
    double sum = 0.0;
    int count = 0;
    const auto last = static_cast<long>(values.size());
    for (int n = 0; n < neighbours; ++n) {
      const long place = 2 * static_cast<long>(order) + 1 - neighbours + 2 * n;
      if (place < 1 || place >= last) continue;
      sum += std::norm(values[static_cast<std::size_t>(place)]);
      ++count;
    }
    return sum / (count - 1);
  }
};

HalfOrders halfOrders(const CutSegment& cut, std::size_t from, std::size_t size, const RotationFit& rotation,
                      std::size_t orders, int neighbours) {
  HalfOrders found;
  found.neighbours = neighbours;
  found.force.resize(2 * orders + static_cast<std::size_t>(neighbours));
  found.response.resize(found.force.size());
  const std::vector<double> window = taper(size);
  double sum = 0.0, force_mean = 0.0, response_mean = 0.0;
  for (std::size_t i = 0; i < size; ++i) {
    const double w = window[i];
    sum += w;
    force_mean += w * cut.force[from + i];
    response_mean += w * cut.response[from + i];
  }
  force_mean /= sum;
  response_mean /= sum;
  for (std::size_t i = 0; i < size; ++i) {
    const double w = 2.0 * window[i] / sum;
    const double force = w * (cut.force[from + i] - force_mean);
    const double response = w * (cut.response[from + i] - response_mean);
    const Complex turn = std::polar(1.0, -0.5 * rotation.at(i));
    Complex phase = 1.0;
    for (std::size_t k = 0; k < found.force.size(); ++k, phase *= turn) {
      found.force[k] += force * phase;
      found.response[k] += response * phase;
    }
  }
  return found;
}

/// Relative variance of a sensor's response by the standard deviations of its modes.
double relativeVariance(const ModalModel& chain, double f) {
  const Complex nominal = chain.response(f);
  double sum = 0.0;
  for (std::size_t m = 0; m < chain.modes.size(); ++m) {
    const auto moved = [&](double Mode::*what, double by) {
      if (!std::isfinite(by) || by == 0.0) return;
      ModalModel other = chain;
      other.modes[m].*what += by;
      if (what == &Mode::gain) other.direct -= by;  // the static gain stays 1
      sum += std::norm(other.response(f) / nominal - 1.0);
    };
    moved(&Mode::frequency, chain.modes[m].frequency_std);
    moved(&Mode::damping_ratio, chain.modes[m].damping_ratio_std);
    moved(&Mode::gain, chain.modes[m].gain_std);
  }
  return sum;
}

void addSegmentLines(const CutSegment& cut, std::size_t from, std::size_t size,
                     const CuttingFrfOptions& options, std::vector<FrfLine>& lines) {
  const RotationFit rotation(cut, from, size);
  const double step = rotation.speed() / units::TWO_PI;  // [Hz]
  if (!(step > 0.0) || static_cast<double>(size) / cut.sample_rate * step < MIN_REVOLUTIONS) return;
  const auto orders = static_cast<std::size_t>(options.high / step);
  const HalfOrders found = halfOrders(cut, from, size, rotation, orders, options.noise_orders);
  for (auto k = static_cast<std::size_t>(cut.every); k <= orders; k += static_cast<std::size_t>(cut.every)) {
    FrfLine line;
    line.frequency = static_cast<double>(k) * step;
    if (line.frequency < options.low) continue;
    line.speed = rotation.speed();
    const Complex measured = found.force[2 * k], chain = cut.chain.response(line.frequency);
    const double force_noise = found.noise(found.force, k), response_noise = found.noise(found.response, k);
    if (std::norm(measured) < options.least_signal * options.least_signal * force_noise) continue;
    line.value = found.response[2 * k] / measured * chain;
    line.force = std::abs(measured / chain);
    const double relative = force_noise / std::norm(measured) + relativeVariance(cut.chain, line.frequency) +
                            cut.relative_force_std * cut.relative_force_std;
    line.std_dev = std::sqrt(response_noise / (line.force * line.force) + std::norm(line.value) * relative);
    if (line.std_dev > 0.0) lines.push_back(line);
  }
}

}  // namespace

std::vector<FrfLine> frfLines(const CutSegment& cut, const CuttingFrfOptions& options) {
  options.validate();
  const std::size_t size = cut.force.size();
  if (cut.response.size() != size || (!cut.angle.empty() && cut.angle.size() != size))
    throw Error(cut.name + ": force, response and angle differ in length");
  for (const std::vector<double>* values : {&cut.force, &cut.response, &cut.angle})
    if (firstNotFinite(*values) < values->size()) throw Error(cut.name + ": a value is not finite");
  if (!(cut.sample_rate > 0.0) || !(cut.speed > 0.0)) throw Error(cut.name + ": no sample rate or no speed");
  // Each part has MIN_REVOLUTIONS at least.
  const double least = 1.02 * MIN_REVOLUTIONS * units::TWO_PI / cut.speed;
  const auto part_size = static_cast<std::size_t>(std::max(options.part, least) * cut.sample_rate);
  const std::size_t parts = std::max<std::size_t>(1, size / std::max<std::size_t>(1, part_size));
  std::vector<FrfLine> lines;
  for (std::size_t p = 0; p < parts; ++p)
    addSegmentLines(cut, p * (size / parts), size / parts, options, lines);
  return lines;
}

}  // namespace smartmill::kalman
