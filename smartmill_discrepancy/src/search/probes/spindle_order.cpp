#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <map>

#include <Eigen/Eigenvalues>

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
  /// [1] distance from a whole order below which a line without a fixed phase belongs to the teeth or the
  /// drive
  double off_whole = 0.02;
};

constexpr std::size_t PADDING = 8;  // spectral lines per resolution of a record: the nearest is within 1/16

using Complex = std::complex<double>;

// One force channel of one record.
struct Spectrum {
  std::size_t axis = 0, test = 0;
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

// @param with_angle only of records with a spindle angle
std::vector<Spectrum> spectraOf(const TwinRunner& runner, const std::vector<double>& residual,
                                double min_revolutions, bool with_angle) {
  std::vector<Spectrum> spectra;
  for (const ChannelSpan& b : runner.spans()) {
    const TestData& t = runner.data().tests[b.test];
    const bool has_angle = t.record.has("spindle_angle");
    if (!b.in_gap || b.channel.size() != 2 || b.channel.front() != 'f' || t.test.kind == TestKind::tap ||
        (with_angle && !has_angle))
      continue;
    Spectrum s;
    s.test = b.test;
    s.axis = static_cast<std::size_t>(b.channel[1] - 'x');
    s.rate = t.test.sample_rate;
    s.speed = t.test.spindle_speed;
    if (has_angle) s.start = t.record.column("spindle_angle").front();
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

// Response of the force sensor to an order of the spindle, over the noise of the channel; 0: outside the band
// or too few periods.
Complex responseAt(double order, const Spectrum& s, const MachineModel& model,
                   const SpindleOrderOptions& options) {
  const double f = s.frequency(order);
  if (f > options.band * s.rate || order * s.revolutions() < options.min_revolutions) return 0.0;
  return model.force_sensor.axis[s.axis].response(f) / s.noise;
}

// Reduction of squares by one sine and cosine per axis, common to all records.
double lockedGainAt(double order, const std::vector<Spectrum>& spectra, const MachineModel& model,
                    const SpindleOrderOptions& options) {
  std::array<Complex, 3> product{};
  std::array<double, 3> squares{};
  for (const Spectrum& s : spectra) {
    const Complex response = responseAt(order, s, model, options);
    if (response == 0.0) continue;
    product[s.axis] += std::conj(response) * s.at(order);
    squares[s.axis] += 0.5 * s.samples * std::norm(response);
  }
  double gain = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    if (squares[a] > 0.0) gain += std::norm(product[a]) / squares[a];
  }
  return gain;
}

// A force of one size per axis at an order, in phase on all axes, with a phase of its own in each record.
struct FreeLine {
  std::array<double, 3> size{};  // [N]
  double gain = 0.0;             // [1] reduction of squares
};

// Least squares with the direction of the largest eigenvector of the records' products, which is the best one
// if the records are equally long.
FreeLine freeLineAt(double order, const std::vector<Spectrum>& spectra, const MachineModel& model,
                    const SpindleOrderOptions& options) {
  using Matrix = Eigen::Matrix3d;
  std::map<std::size_t, std::array<Complex, 3>> products;  // of each record
  Eigen::Vector3d squares = Eigen::Vector3d::Zero();
  for (const Spectrum& s : spectra) {
    const Complex response = responseAt(order, s, model, options);
    if (response == 0.0) continue;
    products[s.test][s.axis] = std::conj(response) * s.at(order);
    squares[static_cast<Eigen::Index>(s.axis)] += 0.5 * s.samples * std::norm(response);
  }
  FreeLine line;
  if (!(squares.sum() > 0.0)) return line;
  const Eigen::Vector3d scale =
      squares.unaryExpr([](double v) { return v > 0.0 ? 1.0 / std::sqrt(v) : 0.0; });
  Matrix all = Matrix::Zero();
  for (const auto& [test, product] : products) {
    for (Eigen::Index a = 0; a < 3; ++a) {
      for (Eigen::Index b = 0; b < 3; ++b)
        all(a, b) += std::real(product[static_cast<std::size_t>(a)] *
                               std::conj(product[static_cast<std::size_t>(b)])) *
                     scale[a] * scale[b];
    }
  }
  const Eigen::SelfAdjointEigenSolver<Matrix> axes(all);
  const Eigen::Vector3d along = axes.eigenvectors().col(2).cwiseProduct(scale);
  double size = 0.0;
  for (const auto& [test, product] : products) {
    Complex sum = 0.0;
    for (std::size_t a = 0; a < 3; ++a) sum += along[static_cast<Eigen::Index>(a)] * product[a];
    size += std::abs(sum);
  }
  line.gain = size * size;
  const double sign = along[0] < 0.0 ? -1.0 : 1.0;  // part of the phase
  for (std::size_t a = 0; a < 3; ++a) line.size[a] = sign * size * along[static_cast<Eigen::Index>(a)];
  return line;
}

// The orders with the largest gains, best first.
template <class Gain>
std::vector<double> bestOrders(const std::vector<Spectrum>& spectra, const SpindleOrderOptions& options,
                               const Gain& gain_at) {
  double revolutions = 0.0;
  for (const Spectrum& s : spectra) revolutions = std::max(revolutions, s.revolutions());
  std::vector<double> orders, gains, best;
  if (revolutions <= 0.0) return best;
  for (double o = options.lowest; o < options.highest; o += options.spacing / revolutions) {
    orders.push_back(o);
    gains.push_back(gain_at(o));
  }
  while (best.size() < options.found) {
    const auto top = std::max_element(gains.begin(), gains.end());
    if (*top <= 0.0) break;
    best.push_back(orders[static_cast<std::size_t>(top - gains.begin())]);
    for (std::size_t k = 0; k < gains.size(); ++k) {
      if (std::abs(orders[k] - best.back()) < options.separation / revolutions) gains[k] = 0.0;
    }
  }
  return best;
}

/// Lines locked to the spindle angle: the orders at which a force of the same phase in every record, filtered
/// by the model's force sensor, explains most of the residual.
class SpindleOrders : public ProbeFamily {
 public:
  explicit SpindleOrders(const ProbeContext& context) : context_(context) {}

  // The order, then amplitudes.
  Probes probesOf(const Hypothesis& h) override {
    const std::vector<Spectrum> spectra =
        spectraOf(context_.runner, context_.now.residual, options_.min_revolutions, true);
    const auto gain = [&](double order) { return lockedGainAt(order, spectra, context_.model, options_); };
    const std::size_t coordinates = h.coordinates.size();
    Probes found;
    for (const double order : bestOrders(spectra, options_, gain)) {
      Hypothesis::Probe probe;
      probe.null.assign(coordinates, 0.0);
      probe.null.front() = order;
      for (std::size_t k = 1; k < coordinates; ++k) addUnitPoint(probe, k);
      found.push_back(probe);
    }
    return found;
  }

 private:
  const ProbeContext& context_;
  SpindleOrderOptions options_;
};

/// Lines at an order without a fixed phase, as those of a rolling bearing.
class FreeOrders : public ProbeFamily {
 public:
  explicit FreeOrders(const ProbeContext& context) : context_(context) {}

  // The order, then the sizes on the axes; the phase is undefined without a size.
  Probes probesOf(const Hypothesis&) override {
    const std::vector<Spectrum> spectra =
        spectraOf(context_.runner, context_.now.residual, options_.min_revolutions, false);
    const auto gain = [&](double order) {
      return std::abs(order - std::round(order)) < options_.off_whole
                 ? 0.0
                 : freeLineAt(order, spectra, context_.model, options_).gain;
    };
    Probes found;
    for (const double order : bestOrders(spectra, options_, gain)) {
      const FreeLine line = freeLineAt(order, spectra, context_.model, options_);
      Hypothesis::Probe probe;
      probe.null = {order, 0.0, 0.0, 0.0};
      probe.points = {{order, line.size[0], line.size[1], line.size[2]}};
      found.push_back(probe);
    }
    return found;
  }

 private:
  const ProbeContext& context_;
  SpindleOrderOptions options_;
};

}  // namespace

std::unique_ptr<ProbeFamily> makeSpindleOrders(const ProbeContext& context) {
  return std::make_unique<SpindleOrders>(context);
}

std::unique_ptr<ProbeFamily> makeFreeOrders(const ProbeContext& context) {
  return std::make_unique<FreeOrders>(context);
}

}  // namespace smartmill::discrepancy
