#include "smartmill_discrepancy/search/order_probes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

constexpr double LEAST_ORDER = 0.2, MOST_ORDER = 60.0;
constexpr double BAND = 0.42;            // of the sample rate
constexpr std::size_t PADDING = 8;       // spectral lines per resolution of a record
constexpr double SPACING = 0.25;         // of the resolution of the longest record
constexpr double MIN_REVOLUTIONS = 3.0;  // minimum of a record for an order

using Complex = std::complex<double>;

// One force channel of one record.
struct Spectrum {
  std::size_t axis = 0;
  double rate = 0.0, speed = 0.0, start = 0.0;  // [Hz], [rad/s], [rad] spindle at the first sample
  double samples = 0.0, noise = 0.0;
  std::vector<Complex> lines;

  double revolutions() const { return samples / rate * speed / units::TWO_PI; }
  double frequency(double order) const { return order * speed / units::TWO_PI; }
  // Sum of the residual times exp(-i order angle).
  Complex at(double order) const {
    const double step = rate / (samples * static_cast<double>(PADDING)), f = frequency(order);
    const auto line = static_cast<std::size_t>(std::lround(f / step));
    // Phase about the middle of the record; the nearest spectral line rotates about it.
    const double offset = f - static_cast<double>(line) * step;
    return lines.at(line) * std::polar(1.0, -order * start - units::PI * offset * samples / rate);
  }
};

std::vector<Spectrum> spectraOf(const TwinRunner& runner, const std::vector<double>& residual) {
  std::vector<Spectrum> spectra;
  for (const ChannelSpan& b : runner.spans()) {
    const TestData& t = runner.data().tests[b.test];
    if (!b.in_gap || b.channel.size() != 2 || b.channel.front() != 'f' || t.test.kind == TestKind::tap ||
        !t.record.has("spindle_angle"))
      continue;
    Spectrum s;
    s.axis = static_cast<std::size_t>(b.channel[1] - 'x');
    s.rate = t.test.sample_rate;
    s.speed = t.test.spindle_speed;
    s.start = t.record.column("spindle_angle").front();
    s.samples = static_cast<double>(b.size);
    s.noise = b.noise;
    if (s.revolutions() < MIN_REVOLUTIONS) continue;
    std::vector<double> padded(residual.begin() + static_cast<std::ptrdiff_t>(b.offset),
                               residual.begin() + static_cast<std::ptrdiff_t>(b.offset + b.size));
    double mean = 0.0;
    for (const double r : padded) mean += r / s.samples;
    for (double& r : padded) r -= mean;
    padded.resize(PADDING * b.size, 0.0);
    s.lines = fourier(padded);
    spectra.push_back(std::move(s));
  }
  return spectra;
}

// Reduction of squares by one sine and cosine per axis, common to all records.
double gainAt(double order, const std::vector<Spectrum>& spectra, const MachineModel& model) {
  std::array<Complex, 3> product{};
  std::array<double, 3> squares{};
  for (const Spectrum& s : spectra) {
    const double f = s.frequency(order);
    if (f > BAND * s.rate || order * s.revolutions() < MIN_REVOLUTIONS) continue;
    const Complex response = model.force_sensor.axis[s.axis].response(f) / s.noise;
    product[s.axis] += std::conj(response) * s.at(order);
    squares[s.axis] += 0.5 * s.samples * std::norm(response);
  }
  double gain = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    if (squares[a] > 0.0) gain += std::norm(product[a]) / squares[a];
  }
  return gain;
}

}  // namespace

std::vector<double> bestOrders(const TwinRunner& runner, const MachineModel& model,
                               const std::vector<double>& residual, std::size_t count) {
  const std::vector<Spectrum> spectra = spectraOf(runner, residual);
  double revolutions = 0.0;
  for (const Spectrum& s : spectra) revolutions = std::max(revolutions, s.revolutions());
  std::vector<double> orders, gains, best;
  if (revolutions <= 0.0) return best;
  for (double o = LEAST_ORDER; o < MOST_ORDER; o += SPACING / revolutions) {
    orders.push_back(o);
    gains.push_back(gainAt(o, spectra, model));
  }
  while (best.size() < count) {
    const auto top = std::max_element(gains.begin(), gains.end());
    if (*top <= 0.0) break;
    best.push_back(orders[static_cast<std::size_t>(top - gains.begin())]);
    for (std::size_t k = 0; k < gains.size(); ++k) {
      if (std::abs(orders[k] - best.back()) < 2.0 / revolutions) gains[k] = 0.0;
    }
  }
  return best;
}

}  // namespace smartmill::discrepancy
