#include "modal_doubts.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>

#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using Complex = std::complex<double>;

double halfWidth(const EstimatedMode& mode) {
  return mode.frequency * mode.damping_ratio;
}

/// [1] Median coherence within the width of a mode, of the FRF where it is highest; NaN: not known.
double coherenceAt(const std::vector<FrequencyResponse>& bands, const EstimatedMode& mode) {
  double highest = std::nan("");
  for (const FrequencyResponse& band : bands) {
    if (band.coherence.size() != band.size() || band.size() < 2) continue;
    const double reach = std::max(halfWidth(mode), 2.0 * (band.frequency[1] - band.frequency[0]));
    std::vector<double> about;
    for (std::size_t i = 0; i < band.size(); ++i) {
      if (std::abs(band.frequency[i] - mode.frequency) <= reach && std::isfinite(band.coherence[i]))
        about.push_back(band.coherence[i]);
    }
    if (!about.empty()) highest = std::fmax(highest, median(about));
  }
  return highest;
}

Complex gainOf(const EstimatedMode& mode, std::size_t frf) {
  return {mode.gain[frf], mode.phase_part[frf]};
}

/// [rad] Phase of a mode to another one modulo 180 deg, 0..pi/2, less three standard deviations, in the FRF
/// where the mode is largest.
double surePhase(const EstimatedMode& mode, const EstimatedMode& other) {
  std::size_t largest = 0;
  for (std::size_t o = 1; o < mode.gain.size(); ++o)
    if (std::norm(gainOf(mode, o)) > std::norm(gainOf(mode, largest))) largest = o;
  const auto deviation = [&](const EstimatedMode& m) {
    return std::hypot(m.gain_std[largest], m.phase_part_std[largest]) / std::abs(gainOf(m, largest));
  };
  const Complex ratio = gainOf(mode, largest) * std::conj(gainOf(other, largest));
  return std::atan2(std::abs(ratio.imag()), std::abs(ratio.real())) -
         3.0 * std::hypot(deviation(mode), deviation(other));
}

double sizeOf(const EstimatedMode& mode) {
  double squares = 0.0;
  for (std::size_t o = 0; o < mode.gain.size(); ++o) squares += std::norm(gainOf(mode, o));
  return std::sqrt(squares);
}

/// The largest neighbour of which a mode is a flank; nullptr: none.
const EstimatedMode* flankOf(const EstimatedMode& mode, const std::vector<EstimatedMode>& all,
                             const ModalSearchOptions& options) {
  const EstimatedMode* found = nullptr;
  for (const EstimatedMode& other : all) {
    const double distance = std::abs(other.frequency - mode.frequency);
    if (distance == 0.0 || distance > options.together * (halfWidth(mode) + halfWidth(other))) continue;
    if (sizeOf(mode) > options.dominant * sizeOf(other)) continue;
    if (surePhase(mode, other) < units::radFromDeg(options.flank_phase)) continue;
    if (!found || sizeOf(other) > sizeOf(*found)) found = &other;
  }
  return found;
}

}  // namespace

void judgeModes(const std::vector<FrequencyResponse>& bands, const ModalSearchOptions& options,
                ModalEstimate& estimate) {
  std::vector<EstimatedMode> all = estimate.modes;
  all.insert(all.end(), estimate.doubts.begin(), estimate.doubts.end());
  for (EstimatedMode& m : estimate.doubts)
    m.doubt = m.evidence < options.proven ? formatted("evidence %.1f, below %.1f", m.evidence, options.proven)
                                          : std::string("at the end of the band");
  std::vector<EstimatedMode> plausible;
  for (EstimatedMode& m : estimate.modes) {
    const double coherence = coherenceAt(bands, m);
    if (coherence < options.coherent) {
      m.doubt = formatted("coherence %.2f within its width, below %.2f", coherence, options.coherent);
    } else if (coherence < options.repeatable) {
      if (const EstimatedMode* other = flankOf(m, all, options))
        m.doubt = formatted(
            "flank of a resonance that differs from hit to hit: phase not that of the mode at %.2f Hz, "
            "coherence %.2f",
            other->frequency, coherence);
    }
    (m.doubt.empty() ? plausible : estimate.doubts).push_back(m);
  }
  estimate.modes = std::move(plausible);
  std::sort(estimate.doubts.begin(), estimate.doubts.end(),
            [](const EstimatedMode& a, const EstimatedMode& b) { return a.frequency < b.frequency; });
}

}  // namespace smartmill
