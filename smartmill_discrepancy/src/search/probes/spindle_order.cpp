#include <algorithm>
#include <array>
#include <cmath>
#include <complex>

#include "search/probes/probe_family.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

struct SpindleOrderOptions {
  double lowest = 0.2, highest = 60.0;  ///< [1] orders searched
  double band = USABLE_BAND;            ///< [1] of the sample rate
  double spacing = 0.25;                ///< [1] of the resolution of the longest record
  double min_revolutions = 3.0;         ///< of a record for an order
  double separation = 2.0;              ///< [1] of that resolution between two orders
  std::size_t found = 2;                ///< best orders, of which the fit tries each
};

constexpr std::size_t PADDING = 8;  // spectral lines per resolution of a record: the nearest is within 1/16

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

std::vector<Spectrum> spectraOf(const TwinRunner& runner, const std::vector<double>& residual,
                                double min_revolutions) {
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
    if (s.revolutions() < min_revolutions) continue;
    std::vector<double> padded = valuesOf(residual, b);
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
double gainAt(double order, const std::vector<Spectrum>& spectra, const MachineModel& model,
              const SpindleOrderOptions& options) {
  std::array<Complex, 3> product{};
  std::array<double, 3> squares{};
  for (const Spectrum& s : spectra) {
    const double f = s.frequency(order);
    if (f > options.band * s.rate || order * s.revolutions() < options.min_revolutions) continue;
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

/// Lines locked to the spindle angle: the orders at which a force of the same phase in every record, filtered
/// by the model's force sensor, explains most of the residual.
class SpindleOrders : public ProbeFamily {
 public:
  explicit SpindleOrders(const ProbeContext& context) : context_(context) {}

  // The order, then amplitudes.
  Probes probesOf(const Hypothesis& h) override {
    const std::size_t coordinates = h.coordinates.size();
    Probes found;
    for (const double order : bestOrders()) {
      Hypothesis::Probe probe;
      probe.null.assign(coordinates, 0.0);
      probe.null.front() = order;
      for (std::size_t k = 1; k < coordinates; ++k) addUnitPoint(probe, k);
      found.push_back(probe);
    }
    return found;
  }

 private:
  // Best first.
  std::vector<double> bestOrders() const {
    const std::vector<Spectrum> spectra =
        spectraOf(context_.runner, context_.now.residual, options_.min_revolutions);
    double revolutions = 0.0;
    for (const Spectrum& s : spectra) revolutions = std::max(revolutions, s.revolutions());
    std::vector<double> orders, gains, best;
    if (revolutions <= 0.0) return best;
    for (double o = options_.lowest; o < options_.highest; o += options_.spacing / revolutions) {
      orders.push_back(o);
      gains.push_back(gainAt(o, spectra, context_.model, options_));
    }
    while (best.size() < options_.found) {
      const auto top = std::max_element(gains.begin(), gains.end());
      if (*top <= 0.0) break;
      best.push_back(orders[static_cast<std::size_t>(top - gains.begin())]);
      for (std::size_t k = 0; k < gains.size(); ++k) {
        if (std::abs(orders[k] - best.back()) < options_.separation / revolutions) gains[k] = 0.0;
      }
    }
    return best;
  }

  const ProbeContext& context_;
  SpindleOrderOptions options_;
};

}  // namespace

std::unique_ptr<ProbeFamily> makeSpindleOrders(const ProbeContext& context) {
  return std::make_unique<SpindleOrders>(context);
}

}  // namespace smartmill::discrepancy
