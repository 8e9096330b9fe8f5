#include "smartmill_discrepancy/data/chatter.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/interpolate.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

constexpr double LEAST_FREQUENCY = 80.0;  // [Hz] drift, hum and slow trends are below
constexpr std::size_t LEAST_SAMPLES = 128;

// Interpolated value between samples.
double at(const std::vector<double>& x, double position) {
  const auto i = static_cast<std::size_t>(position);
  return catmullRom(x[i - 1], x[i], x[i + 1], x[i + 2], position - static_cast<double>(i));
}

}  // namespace

std::optional<Chatter> findChatter(const Record& record, const CampaignTest& test, std::size_t first_cut) {
  if (test.kind != TestKind::cut || !(test.spindle_speed > 0.0)) return {};
  const double revolution = units::TWO_PI / test.spindle_speed * test.sample_rate;  // [samples]
  const std::size_t from = first_cut + (record.size() - std::min(first_cut, record.size())) / 2;
  if (static_cast<double>(from - first_cut) < revolution + 2.0 || from + LEAST_SAMPLES > record.size())
    return {};
  Chatter chatter;
  chatter.share = 1e300;
  for (const char* channel : {"fx", "fy"}) {
    if (!record.has(channel)) return {};
    const std::vector<double>& x = record.column(channel);
    std::vector<double> change, window;
    const std::size_t n = record.size() - from;
    for (std::size_t i = from; i < record.size(); ++i) {
      const double sine =
          std::sin(units::PI * (static_cast<double>(i - from) + 0.5) / static_cast<double>(n));
      change.push_back((x[i] - at(x, static_cast<double>(i) - revolution)) * sine * sine);
    }
    const std::vector<double> cut(x.begin() + static_cast<std::ptrdiff_t>(from), x.end());
    const auto spectrum = fourier(change);
    const double bin = test.sample_rate / static_cast<double>(n);
    double squares = 0.0, largest = 0.0;
    std::size_t top = 0;
    for (std::size_t k = 1; k + 1 < spectrum.size(); ++k) {
      if (static_cast<double>(k) * bin < LEAST_FREQUENCY) continue;
      const double power = std::norm(spectrum[k]);
      squares += power;
      if (power > largest) {
        largest = power;
        top = k;
      }
    }
    // Two-sided spectrum; the mean square of the window is 3/8; a difference doubles the variance.
    const double rms =
        std::sqrt(2.0 * squares / (static_cast<double>(n) * static_cast<double>(n)) / 0.375 / 2.0);
    const double deviation = standardDeviation(cut);
    if (!(deviation > 0.0)) return {};
    chatter.share = std::min(chatter.share, rms / deviation);
    const double frequency = static_cast<double>(top) * bin;
    // A line with phase shift phi per revolution differs from its delayed self by 2 sin(phi / 2).
    const double doubled = 2.0 * std::abs(std::sin(units::PI * frequency * revolution / test.sample_rate));
    const double amplitude = 4.0 * std::sqrt(largest) / static_cast<double>(n) / std::max(doubled, 0.1);
    if (amplitude > chatter.amplitude) {
      chatter.amplitude = amplitude;
      chatter.frequency = frequency;
    }
  }
  if (chatter.share < CHATTER_SHARE) return {};
  return chatter;
}

}  // namespace smartmill::discrepancy
