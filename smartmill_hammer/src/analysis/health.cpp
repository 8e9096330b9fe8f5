#include "smartmill_hammer/analysis/health.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/formatted.h"

namespace smartmill {
namespace hammer {
namespace {

/// Deviations beyond which a change is one: of some dozens of quantities chance shows it once in a thousand
/// looks.
constexpr double DRIFT = 4.0;
/// Modes nearer than that are the same.
constexpr double SAME = 0.05;
/// A mode that comes or goes counts from this share of the largest gain on.
constexpr double SEEN = 0.05;

double known(double std) {
  return std::isfinite(std) ? std : 0.0;
}

std::string naming(const char* quantity, const Mode& mode) {
  return formatted("%s of the mode at %.0f Hz", quantity, mode.frequency);
}

HealthChange change(const std::string& what, double before, double before_std, double now, double now_std,
                    double allowance) {
  HealthChange c{what, before, now, now / before - 1.0, 0.0};
  const double deviation = std::hypot(known(before_std), known(now_std), allowance * before);
  c.sigmas = deviation > 0.0 ? (now - before) / deviation : 0.0;
  return c;
}

const Mode* nearest(const std::vector<Mode>& modes, const Mode& mode) {
  const Mode* found = nullptr;
  for (const Mode& m : modes) {
    const double off = std::abs(m.frequency - mode.frequency);
    if (off < SAME * mode.frequency && (!found || off < std::abs(found->frequency - mode.frequency)))
      found = &m;
  }
  return found;
}

/// Modes of one list that the other lacks.
void addMissing(const std::vector<Mode>& has, const std::vector<Mode>& lacks, const char* word,
                std::vector<HealthChange>& changes) {
  double largest = 0.0;
  for (const Mode& m : has) largest = std::max(largest, std::abs(m.gain));
  for (const Mode& m : has) {
    if (nearest(lacks, m) || std::abs(m.gain) < SEEN * largest) continue;
    const bool gone = word[0] == 'g';
    changes.push_back({naming("gain", m) + ", " + word, gone ? m.gain : 0.0, gone ? 0.0 : m.gain,
                       gone ? -1.0 : INFINITY, gone ? -INFINITY : INFINITY});
  }
}

}  // namespace

bool HealthChange::drifted() const {
  return std::abs(sigmas) > DRIFT;
}

std::vector<HealthChange> modeChanges(const MeasuredModes& before, const MeasuredModes& now,
                                      const HealthAllowance& allowance) {
  std::vector<HealthChange> changes;
  const std::vector<Mode>&old = before.model.modes, &fresh = now.model.modes;
  for (const Mode& m : old) {
    const Mode* n = nearest(fresh, m);
    if (!n) continue;
    changes.push_back(change(naming("frequency", m), m.frequency, m.frequency_std, n->frequency,
                             n->frequency_std, allowance.frequency));
    changes.push_back(change(naming("damping", m), m.damping_ratio, m.damping_ratio_std, n->damping_ratio,
                             n->damping_ratio_std, allowance.damping));
    changes.push_back(change(naming("gain", m), m.gain, m.gain_std, n->gain, n->gain_std, allowance.gain));
  }
  addMissing(old, fresh, "gone", changes);
  addMissing(fresh, old, "new", changes);
  return changes;
}

HealthChange valueChange(const std::string& what, const Stated& before, const Stated& now, double allowance) {
  return change(what, before.value, before.std, now.value, now.std, allowance);
}

std::string driftOf(const std::vector<HealthChange>& changes) {
  const HealthChange* worst = nullptr;
  for (const HealthChange& c : changes) {
    if (c.drifted() && (!worst || std::abs(c.sigmas) > std::abs(worst->sigmas))) worst = &c;
  }
  if (!worst) return "";
  if (!std::isfinite(worst->sigmas)) return worst->what;
  return formatted("%s changed by %+.1f %% (%.1f deviations)", worst->what.c_str(), 100.0 * worst->relative,
                   std::abs(worst->sigmas));
}

}  // namespace hammer
}  // namespace smartmill
