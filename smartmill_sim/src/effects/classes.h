#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/effects/effect.h"

namespace smartmill::sim {

/// A key's value [shop unit]. @throws Error when the entry lacks it.
inline double valueOf(const EffectEntry& entry, const char* key) {
  const auto found = entry.numbers.find(key);
  if (found == entry.numbers.end()) throw Error(std::string(key) + " is missing");
  return found->second;
}

inline const std::string& wordOf(const EffectEntry& entry, const char* key) {
  const auto found = entry.words.find(key);
  if (found == entry.words.end()) throw Error(std::string(key) + " is missing");
  return found->second;
}

using EffectPtr = std::unique_ptr<Effect>;

// Each in the file of its name.
EffectPtr makeRunout(const EffectEntry& entry);
EffectPtr makeUnevenPitch(const EffectEntry& entry);
EffectPtr makeHelix(const EffectEntry& entry);
EffectPtr makeFeedError(const EffectEntry& entry);
EffectPtr makeDepthTilt(const EffectEntry& entry);
EffectPtr makeEdgeForces(const EffectEntry& entry);
EffectPtr makeSizeEffect(const EffectEntry& entry);
EffectPtr makeCuttingSpeed(const EffectEntry& entry);
EffectPtr makeToolWear(const EffectEntry& entry);
EffectPtr makeProcessDamping(const EffectEntry& entry);
EffectPtr makeToolFlexibility(const EffectEntry& entry);
EffectPtr makeMassLoading(const EffectEntry& entry);
EffectPtr makeSpeedDependentMode(const EffectEntry& entry);
EffectPtr makeExtraMode(const EffectEntry& entry);
EffectPtr makeUnbalance(const EffectEntry& entry);
EffectPtr makeStribeckFriction(const EffectEntry& entry);
EffectPtr makeFrictionWarmup(const EffectEntry& entry);
EffectPtr makeLoadMeterLag(const EffectEntry& entry);
EffectPtr makeCrossTalk(const EffectEntry& entry);
EffectPtr makeGainError(const EffectEntry& entry);
EffectPtr makeChannelDelay(const EffectEntry& entry);
EffectPtr makeChargeDrift(const EffectEntry& entry);
EffectPtr makeMainsHum(const EffectEntry& entry);
EffectPtr makeSaturation(const EffectEntry& entry);
// Beyond the contract's list.
EffectPtr makeChipCoefficients(const EffectEntry& entry);
EffectPtr makeEdgeBuildup(const EffectEntry& entry);
EffectPtr makeSpindleOrder(const EffectEntry& entry);
EffectPtr makeZeroOffset(const EffectEntry& entry);

}  // namespace smartmill::sim
