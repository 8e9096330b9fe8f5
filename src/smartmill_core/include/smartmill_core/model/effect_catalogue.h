#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/strict_yaml.h"

namespace smartmill {

/// What stands behind a key of an effect.
enum class EffectValue { number, word, pitch, modes };

/// What is expected of a value before any measurement: normal about neutral with scale, cut to low..high;
/// uniform in low..high where scale is 0.
struct EffectPrior {
  double low = 0.0, high = 0.0;  ///< where a fit looks [unit of the key]
  double neutral = 0.0;          ///< at this value the effect is absent (uniform: no such value)
  double scale = 0.0;            ///< size that is usual where the effect is present
  bool periodic = false;         ///< an angle: high is low again
};

/// One key of an effect, as files write it (shop units).
struct EffectParameter {
  std::string key;
  std::string unit;  ///< "1" without one
  EffectValue value = EffectValue::number;
  Range range;
  bool optional = false;                ///< absent is 0 (modes: none)
  std::vector<std::string> words = {};  ///< allowed words
  std::vector<double> choices = {};     ///< allowed numbers, empty: the range
  /// Of a number; of a pitch: of each pitch's difference from even; of modes: not set.
  EffectPrior prior = {};
};

/// One cause that a nominal model may lack.
struct EffectKind {
  std::string name;
  std::vector<EffectParameter> parameters;
  std::string source;             ///< where the law stands
  bool needs_start_time = false;  ///< of a test: start_time_s
  bool needs_cut_time = false;    ///< of a cut: cut_time_before_s
};

/// The catalogue: the one table of names, keys, units and ranges that a model's `effects:` and a report may
/// use.
const std::vector<EffectKind>& effectCatalogue();

/// Effects beyond the contract's that measured data called for; files may name them as well.
const std::vector<EffectKind>& furtherEffects();

/// Of both lists; nullptr when there is no such effect.
const EffectKind* findEffect(const std::string& name);

/// nullptr when the effect has no such key.
const EffectParameter* findParameter(const EffectKind& kind, const std::string& key);

}  // namespace smartmill
