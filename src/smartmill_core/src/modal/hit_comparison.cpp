#include <algorithm>
#include <cmath>
#include <complex>

#include "hit_channel.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/modal/hit_check.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;

struct Lines {
  std::vector<Complex> force, response;
  double noise = 0.0;  // mean |response|^2 of a line by the sensor's noise alone
};

Lines linesOf(const Hit& hit) {
  HitChannel force = hitChannel(hit.force, hit.pre_trigger);
  const std::vector<double> window = impactWindow(force.values);
  for (std::size_t i = 0; i < window.size(); ++i) force.values[i] *= window[i];
  const HitChannel response = hitChannel(hit.response, hit.pre_trigger);
  return {fourier(force.values), fourier(response.values),
          static_cast<double>(response.values.size()) * response.noise * response.noise};
}

/// A hit's response relative to the one predicted from its force with the FRF of the others.
struct Comparison {
  double gain = 1.0, shift = 0.0;          ///< [1], [samples] of the response
  double gain_std = 0.0, shift_std = 0.0;  ///< by the noise

  // 1: at the limit
  double jump(const HitComparisonLimits& limits) const {
    return std::abs(std::log(gain)) / (limits.gain_jump + limits.by_noise * gain_std);
  }
  double skew(const HitComparisonLimits& limits) const {
    return std::abs(shift) / (limits.skew + limits.by_noise * shift_std);
  }
  double severity(const HitComparisonLimits& limits) const { return std::max(jump(limits), skew(limits)); }
};

Comparison compareWithOthers(const std::vector<Lines>& lines, const std::vector<std::size_t>& members,
                             std::size_t h, const HitComparisonLimits& limits) {
  const std::vector<Complex>& force = lines[h].force;
  double strongest = 0.0, power = 0.0, slope_power = 0.0, noise = 0.0;
  const double turn = units::PI / static_cast<double>(force.size() - 1);
  for (const Complex& f : force) strongest = std::max(strongest, std::abs(f));
  std::vector<Complex> product(force.size());
  for (std::size_t k = 1; k < force.size(); ++k) {
    if (std::abs(force[k]) < limits.strong_force * strongest) continue;
    Complex cross;
    double squares = 0.0;
    for (const std::size_t o : members) {
      if (o == h) continue;
      cross += std::conj(lines[o].force[k]) * lines[o].response[k];
      squares += std::norm(lines[o].force[k]);
    }
    const Complex predicted = force[k] * cross / squares;
    product[k] = std::conj(predicted) * lines[h].response[k];
    // The prediction contains a share of the others' noise, which is not part of its power.
    const double of_noise = std::norm(force[k]) * lines[h].noise / squares;
    power += std::norm(predicted) - of_noise;
    slope_power += std::pow(turn * static_cast<double>(k), 2) * (std::norm(predicted) - of_noise);
    noise = std::max(noise, lines[h].noise * (1.0 + std::norm(force[k]) / squares));
  }
  if (!(power > 0.0 && slope_power > 0.0)) return {1.0, 0.0, INFINITY, INFINITY};
  // The shift of largest correlation, and the gain there.
  const auto along = [&](double shift) {
    double sum = 0.0;
    for (std::size_t k = 1; k < product.size(); ++k) {
      if (product[k] != 0.0)
        sum += (product[k] * std::polar(1.0, turn * shift * static_cast<double>(k))).real();
    }
    return sum / power;
  };
  const double gain_std = std::sqrt(0.5 * noise / power), shift_std = std::sqrt(0.5 * noise / slope_power);
  Comparison found{along(0.0), 0.0, gain_std, shift_std};
  for (double shift = -limits.most_skew; shift <= limits.most_skew; shift += limits.skew_step) {
    const double gain = along(shift);
    if (gain > found.gain) found = {gain, shift, gain_std, shift_std};
  }
  found.gain = std::max(found.gain, 1e-6);
  return found;
}

}  // namespace

std::vector<HitFault> faultsAmongHits(const std::vector<Hit>& hits, const std::vector<bool>& usable,
                                      const HitComparisonLimits& limits) {
  std::vector<HitFault> faults(hits.size());
  std::vector<Lines> lines(hits.size());
  std::vector<std::size_t> members;
  for (std::size_t h = 0; h < hits.size(); ++h) {
    if (!usable[h]) continue;
    if (hits[h].force.size() != hits[members.empty() ? h : members.front()].force.size()) return faults;
    lines[h] = linesOf(hits[h]);
    members.push_back(h);
  }
  // The worst is removed first, since it affects the reference of the others.
  while (members.size() >= 3) {
    Comparison worst;
    std::size_t at = members.front();
    for (const std::size_t h : members) {
      const Comparison found = compareWithOthers(lines, members, h, limits);
      if (found.severity(limits) > worst.severity(limits)) worst = found, at = h;
    }
    if (worst.severity(limits) <= 1.0) break;
    faults[at] = {
        worst.skew(limits) > worst.jump(limits)
            ? formatted("trigger skew: the channels are shifted by %.2f samples relative to the other hits",
                        worst.shift)
            : formatted("gain jump: %.2f of the gain of the other hits", worst.gain),
        true};
    members.erase(std::find(members.begin(), members.end(), at));
  }
  return faults;
}

}  // namespace smartmill
