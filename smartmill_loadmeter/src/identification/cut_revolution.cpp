#include "cut_revolution.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/math/angle.h"

namespace smartmill::loadmeter {

namespace {

constexpr std::size_t ANGLES = RevolutionForce::ANGLES;

// Without a tachometer the speed is estimated as the one with the largest energy of the mean revolution: a
// slip of 0.2 % blurs a record of a hundred revolutions.
double revolutionsPerSample(const std::vector<double>& force, std::size_t first, double nominal) {
  const auto energyAt = [&](double per_sample) {
    std::array<double, ANGLES> sum{}, count{};
    for (std::size_t i = first; i < force.size(); ++i) {
      const double revolutions = static_cast<double>(i - first) * per_sample;
      const std::size_t bin = RevolutionForce::binOf(revolutions - std::floor(revolutions));
      sum[bin] += force[i];
      count[bin] += 1.0;
    }
    double energy = 0.0;
    for (std::size_t b = 0; b < ANGLES; ++b) energy += count[b] > 0.0 ? sum[b] * sum[b] / count[b] : 0.0;
    return energy;
  };
  const double turns = static_cast<double>(force.size() - first) * nominal;
  double best = nominal, most = energyAt(nominal);
  // Resolves a tenth of a revolution at the end of the record; then refined about the best.
  for (double step = 0.1 / turns, span = 0.01; step > 1e-3 / turns; span = 2.0 * step, step *= 0.25) {
    const double middle = best;
    for (double off = -span; off <= span; off += step) {
      const double candidate = energyAt(middle * (1.0 + off));
      if (candidate > most) most = candidate, best = middle * (1.0 + off);
    }
  }
  return best;
}

}  // namespace

CutRevolution revolutionOf(const CampaignTest& test, const Record& record) {
  CutRevolution r;
  r.engagement = *test.engagement;
  std::array<double, ANGLES> count{};
  const std::array<const char*, 3> names{"fx", "fy", "fz"};
  const std::size_t first =
      test.engage_time ? static_cast<std::size_t>(*test.engage_time * test.sample_rate) : 0;
  const bool angle = record.has("spindle_angle");
  const double nominal = test.spindle_speed / units::TWO_PI / test.sample_rate;
  const double per_sample = angle ? nominal : revolutionsPerSample(record.column("fy"), first, nominal);
  const double turns = std::floor(static_cast<double>(record.size() - first) * per_sample);
  if (turns < 1.0) throw Error(record.file + ": less than one revolution in cut");
  for (std::size_t i = first; i < record.size(); ++i) {
    const double revolutions = static_cast<double>(i - first) * per_sample;
    if (revolutions >= turns) break;
    const double at = angle ? wrapped(record.column("spindle_angle")[i]) / units::TWO_PI
                            : revolutions - std::floor(revolutions);
    const std::size_t bin = RevolutionForce::binOf(at);
    count[bin] += 1.0;
    for (std::size_t a = 0; a < 3; ++a) r.force.axis[a][bin] += record.column(names[a])[i];
  }
  for (std::size_t bin = 0; bin < ANGLES; ++bin) {
    if (count[bin] == 0.0) throw Error(record.file + ": too few samples per revolution, expected 48 or more");
    for (std::size_t a = 0; a < 3; ++a) r.force.axis[a][bin] /= count[bin];
  }
  return r;
}

std::size_t lowOrders(const RevolutionForce& force, int orders, double* out) {
  const double n = static_cast<double>(ANGLES);
  static const auto CIRCLE = [] {
    std::array<std::array<double, ANGLES>, 2> circle{};
    for (std::size_t i = 0; i < ANGLES; ++i) {
      const double at = units::TWO_PI * static_cast<double>(i) / static_cast<double>(ANGLES);
      circle[0][i] = std::cos(at);
      circle[1][i] = std::sin(at);
    }
    return circle;
  }();
  std::size_t written = 0;
  for (const auto& axis : force.axis) {
    double sum = 0.0;
    for (const double f : axis) sum += f;
    out[written++] = sum / n;
    for (int k = 1; k <= orders; ++k) {
      double c = 0.0, s = 0.0;
      for (std::size_t i = 0; i < ANGLES; ++i) {
        const std::size_t at = i * static_cast<std::size_t>(k) % ANGLES;
        c += axis[i] * CIRCLE[0][at], s += axis[i] * CIRCLE[1][at];
      }
      out[written++] = std::sqrt(2.0) * c / n;
      out[written++] = std::sqrt(2.0) * s / n;
    }
  }
  return written;
}

}  // namespace smartmill::loadmeter
