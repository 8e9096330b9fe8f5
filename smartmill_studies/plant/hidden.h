#pragma once

#include <string>
#include <vector>

#include "plant/machine.h"

namespace smartmill::plant {

/// The hidden effects of one plant, by name and key.
class Hidden {
 public:
  explicit Hidden(const Plant& plant) : plant_(plant) {}

  bool has(const std::string& name) const { return find(name) != nullptr; }
  /// 0 without the effect or the key
  double operator()(const std::string& name, const std::string& key) const {
    const EffectEntry* e = find(name);
    if (!e) return 0.0;
    const auto at = e->numbers.find(key);
    return at == e->numbers.end() ? 0.0 : at->second;
  }
  std::vector<double> list(const std::string& name, const std::string& key) const {
    const EffectEntry* e = find(name);
    return e && e->lists.count(key) ? e->lists.at(key) : std::vector<double>();
  }
  std::vector<const EffectEntry*> all(const std::string& name) const {
    std::vector<const EffectEntry*> found;
    for (const EffectEntry& e : plant_.effects) {
      if (e.name == name) found.push_back(&e);
    }
    return found;
  }

 private:
  const EffectEntry* find(const std::string& name) const {
    for (const EffectEntry& e : plant_.effects) {
      if (e.name == name) return &e;
    }
    return nullptr;
  }
  const Plant& plant_;
};

/// Whether a cause outside the catalogue acts.
inline bool isOutside(const Plant& plant, const std::string& kind) {
  return plant.outside && plant.outside->kind == kind;
}

}  // namespace smartmill::plant
