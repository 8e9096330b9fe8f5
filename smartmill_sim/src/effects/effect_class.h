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

using EffectMaker = std::unique_ptr<Effect> (*)(const EffectEntry& entry);

/// Makes a class known under a name of the catalogue while the library is loaded.
struct EffectRegistration {
  EffectRegistration(const char* name, EffectMaker make);
};

/// In the file of an effect: `const EffectClass<Runout> REGISTERED("runout");`
template <class T>
struct EffectClass : EffectRegistration {
  explicit EffectClass(const char* name)
      : EffectRegistration(name, [](const EffectEntry& entry) -> std::unique_ptr<Effect> {
          return std::make_unique<T>(entry);
        }) {}
};

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

/// One value a tooth [shop unit].
inline const std::vector<double>& listOf(const EffectEntry& entry, const char* key) {
  const auto found = entry.lists.find(key);
  if (found == entry.lists.end() || found->second.empty()) throw Error(std::string(key) + " is missing");
  return found->second;
}

/// @throws Error when a list has not one value for each tooth.
inline void checkTeeth(const char* effect, std::size_t values, const ToolGeometry& tool) {
  if (values != static_cast<std::size_t>(tool.teeth))
    throw Error(std::string(effect) + ": " + std::to_string(values) + " values for " +
                std::to_string(tool.teeth) + " teeth");
}

}  // namespace smartmill::sim
