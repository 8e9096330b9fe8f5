#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/strict_yaml.h"

namespace smartmill {

/// What stands behind a key of an effect.
enum class EffectValue { number, word, pitch, modes };

/// One key of an effect, as files write it (shop units).
struct EffectParameter {
  std::string key;
  std::string unit;  ///< "1" without one
  EffectValue value = EffectValue::number;
  Range range;
  bool optional = false;                ///< absent is 0 (modes: none)
  std::vector<std::string> words = {};  ///< allowed words
  std::vector<double> choices = {};     ///< allowed numbers, empty: the range
};

/// One cause that a nominal model may lack.
struct EffectKind {
  std::string name;
  std::vector<EffectParameter> parameters;
};

/// The catalogue: the one table of names, keys, units and ranges that a model's `effects:` and a report may
/// use.
const std::vector<EffectKind>& effectCatalogue();

/// nullptr when the catalogue has no such effect.
const EffectKind* findEffect(const std::string& name);

}  // namespace smartmill
