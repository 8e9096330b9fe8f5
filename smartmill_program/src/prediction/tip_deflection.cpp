#include "smartmill_program/prediction/tip_deflection.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "smartmill_core/units.h"

namespace smartmill::program {
namespace {

using Complex = std::complex<double>;

constexpr double BAND = 3.0;                  // [1] highest frequency over the highest natural frequency
constexpr double LEAST = 16.0, MOST = 256.0;  // harmonics, the least per tooth
constexpr std::size_t OVERSAMPLING = 4;       // samples per harmonic: the force has kinks and jumps

}  // namespace

double TipDeflection::largest(ForcePredictor& forces, const Contact& contact, const EngagementCell& cell,
                              double speed, double feed_per_tooth) {
  const bool same_cell = !(cell < cell_) && !(cell_ < cell);
  if (same_cell && speed == speed_ && sameContact(contact, contact_) &&
      std::abs(feed_per_tooth - feed_per_tooth_) <= ALIKE_FEED * feed_per_tooth)
    return largest_;
  contact_ = contact;
  cell_ = cell;
  speed_ = speed;
  feed_per_tooth_ = feed_per_tooth;

  const stability::RegenerativeSystem system = cell.system(model_);
  double highest = 0.0;
  for (const stability::SystemMode& mode : system.modes) highest = std::max(highest, mode.frequency);
  const ToolGeometry& tool = *model_.tool;
  const double order = tool.pitch.empty() ? tool.teeth : 1.0;  // of the force's period
  const double base = order * speed / units::TWO_PI;           // [Hz]
  const double least = LEAST * tool.teeth / order;
  const auto harmonics =
      static_cast<std::size_t>(std::clamp(std::ceil(BAND * highest / base), least, std::max(MOST, least)));
  const std::vector<CuttingForce> series =
      forces.series(contact, feed_per_tooth, units::TWO_PI / order, OVERSAMPLING * harmonics);
  const std::size_t count = series.size();
  std::vector<double> cosine(count), sine(count);
  for (std::size_t k = 0; k < count; ++k) {
    const double turn = units::TWO_PI * static_cast<double>(k) / static_cast<double>(count);
    cosine[k] = std::cos(turn);
    sine[k] = std::sin(turn);
  }
  std::vector<double> x(count, 0.0), y(count, 0.0);
  for (std::size_t n = 0; n <= harmonics; ++n) {
    Complex fx = 0.0, fy = 0.0;
    const double share = (n == 0 ? 1.0 : 2.0) / static_cast<double>(count);  // and the negative frequency
    for (std::size_t k = 0, at = 0; k < count; ++k, at = (at + n) % count) {
      fx += Complex(series[k].fx * cosine[at], -series[k].fx * sine[at]);
      fy += Complex(series[k].fy * cosine[at], -series[k].fy * sine[at]);
    }
    const auto g = stability::receptance(system.modes, static_cast<double>(n) * base);
    const Complex u = share * (g[0] * fx + g[1] * fy), v = share * (g[2] * fx + g[3] * fy);
    for (std::size_t k = 0, at = 0; k < count; ++k, at = (at + n) % count) {
      x[k] += u.real() * cosine[at] - u.imag() * sine[at];
      y[k] += v.real() * cosine[at] - v.imag() * sine[at];
    }
  }
  largest_ = 0.0;
  for (std::size_t k = 0; k < count; ++k) largest_ = std::max(largest_, std::hypot(x[k], y[k]));
  return largest_;
}

}  // namespace smartmill::program
