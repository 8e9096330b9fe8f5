#include "smartmill_hammer/analysis/health.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/formatted.h"

namespace smartmill::hammer {
namespace {

double finiteOrZero(double std) {
  return std::isfinite(std) ? std : 0.0;
}

std::string quantityName(const char* quantity, const Mode& mode) {
  return formatted("%s of the mode at %.0f Hz", quantity, mode.frequency);
}

HealthChange change(const std::string& quantity, double before, double before_std, double now, double now_std,
                    double allowance) {
  HealthChange c{quantity, before, now, now / before - 1.0, 0.0};
  const double deviation = std::hypot(finiteOrZero(before_std), finiteOrZero(now_std), allowance * before);
  c.sigmas = deviation > 0.0 ? (now - before) / deviation : 0.0;
  return c;
}

const Mode* nearestMode(const std::vector<Mode>& modes, const Mode& mode, const HealthAllowance& allowance) {
  const Mode* found = nullptr;
  for (const Mode& m : modes) {
    const double off = std::abs(m.frequency - mode.frequency);
    if (off < allowance.same_mode * mode.frequency &&
        (!found || off < std::abs(found->frequency - mode.frequency)))
      found = &m;
  }
  return found;
}

/// Changes for the modes of one list that the other one does not contain.
void addMissing(const std::vector<Mode>& present, const std::vector<Mode>& other, const char* word,
                const HealthAllowance& allowance, std::vector<HealthChange>& changes) {
  double largest = 0.0;
  for (const Mode& m : present) largest = std::max(largest, std::abs(m.gain));
  for (const Mode& m : present) {
    if (nearestMode(other, m, allowance) || std::abs(m.gain) < allowance.least_gain * largest) continue;
    const bool gone = word[0] == 'g';
    changes.push_back({quantityName("gain", m) + ", " + word, gone ? m.gain : 0.0, gone ? 0.0 : m.gain,
                       gone ? -1.0 : INFINITY, gone ? -INFINITY : INFINITY});
  }
}

}  // namespace

bool HealthChange::drifted() const {
  return std::abs(sigmas) > DRIFT_DEVIATIONS;
}

std::vector<HealthChange> modeChanges(const MeasuredModes& before, const MeasuredModes& now,
                                      const HealthAllowance& allowance) {
  std::vector<HealthChange> changes;
  const std::vector<Mode>&old = before.model.modes, &fresh = now.model.modes;
  for (const Mode& m : old) {
    const Mode* n = nearestMode(fresh, m, allowance);
    if (!n) continue;
    changes.push_back(change(quantityName("frequency", m), m.frequency, m.frequency_std, n->frequency,
                             n->frequency_std, allowance.frequency));
    changes.push_back(change(quantityName("damping", m), m.damping_ratio, m.damping_ratio_std,
                             n->damping_ratio, n->damping_ratio_std, allowance.damping));
    changes.push_back(
        change(quantityName("gain", m), m.gain, m.gain_std, n->gain, n->gain_std, allowance.gain));
  }
  addMissing(old, fresh, "gone", allowance, changes);
  addMissing(fresh, old, "new", allowance, changes);
  return changes;
}

HealthChange valueChange(const std::string& quantity, const ValueWithStd& before, const ValueWithStd& now,
                         double allowance) {
  return change(quantity, before.value, before.std, now.value, now.std, allowance);
}

std::string driftText(const std::vector<HealthChange>& changes) {
  const HealthChange* worst = nullptr;
  for (const HealthChange& c : changes) {
    if (c.drifted() && (!worst || std::abs(c.sigmas) > std::abs(worst->sigmas))) worst = &c;
  }
  if (!worst) return "";
  if (!std::isfinite(worst->sigmas)) return worst->quantity;
  return formatted("%s changed by %+.1f %% (%.1f standard deviations)", worst->quantity.c_str(),
                   100.0 * worst->relative, std::abs(worst->sigmas));
}

}  // namespace smartmill::hammer
