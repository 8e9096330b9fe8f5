#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/effect.h"
#include "smartmill_core/model/effect_catalogue.h"

// Vocabulary of the files in src/effects/. Each of them defines one class with a static function
// declaration() and ends with
//
//   EffectKind NAME() { return declared<Class>(); }
//
// where NAME is the file's name without .cpp. CMake lists these functions by the names of the files
// (model/effect_files.cpp.in), so that neither a list nor the linker can lose one.

namespace smartmill::effects {

/// The declaration of a class with the function that constructs it.
template <class T>
EffectKind declared() {
  EffectKind kind = T::declaration();
  kind.make = [](const EffectEntry& entry) -> std::unique_ptr<Effect> { return std::make_unique<T>(entry); };
  return kind;
}

/// The beginning of the declaration of an empirical effect. @param form_stage, form its identity in files
EffectKind empirical(const char* form_stage, const char* form, EffectStage stage, int rank);

// ---- keys of a declaration

EffectParameter number(const char* key, const char* unit, const Range& range = {});
EffectParameter orZero(const char* key, const char* unit, const Range& range = {});  ///< optional, absent: 0
EffectParameter angle(const char* key);                                              ///< [deg]
EffectParameter angleOrZero(const char* key);
EffectParameter oneOf(const char* key, const std::vector<std::string>& words);
EffectParameter oneOfNumbers(const char* key, const char* unit, const std::vector<double>& choices);
EffectParameter perTooth(const char* key, const char* unit, const Range& range = {},
                         std::optional<double> sum = {});
EffectParameter series(const char* key, const char* unit, const Range& range = {});
EffectParameter table(const char* key, const char* unit, const Range& range = {});
EffectParameter tableOrNone(const char* key, const char* unit, const Range& range = {});
EffectParameter modes(const char* key);  ///< of the tool tip

const std::vector<std::string>& axisNames();         ///< x, y, z
const std::vector<std::string>& forceNames();        ///< fx, fy, fz
const std::vector<std::string>& streamedChannels();  ///< fx, fy, fz, load_meter

// ---- forms of a declaration

using Forms = std::vector<EffectForm>;
using Scope = EffectScope;
using Values = EffectForm::Values;

/// The same form in every campaign.
std::function<Forms(const Scope&)> always(const EffectForm& form);

/// A key that is added to a nominal value; the sum stays >= 0. @param stated nominal value, in the key's unit
EffectCoordinates addedTo(double stated, const char* key, FitRange range);

/// Range of the logarithm of a factor.
FitRange factorRange();

/// A form for each channel of streamedChannels() that the campaign measures.
Forms onChannels(const Scope& scope, const std::function<EffectForm(const std::string&)>& form);
/// The same for each clock (key `clock`) that the campaign states: the record's, the machine's.
Forms onClocks(const Scope& scope, const std::function<EffectForm(const std::string&)>& form);
/// Values of the key `clock`.
const std::vector<std::string>& clockNames();

/// Scale of steps and usual sizes in a channel: 1 N, 1 mV.
double unitOf(const std::string& channel);

/// `amplitude` and `time_constant_s` of an exponential approach that a campaign observes from this time [s]
/// on.
EffectForm exponentialApproach(const FitRange& size, double reach, double time);

// ---- random draws

double between(EffectKind::Random& random, double low, double high);
double eitherSign(EffectKind::Random& random, double low, double high);

// ---- values of an entry [shop units]

/// @throws Error when the entry lacks the key.
double valueOf(const EffectEntry& entry, const char* key);
const std::string& wordOf(const EffectEntry& entry, const char* key);
const std::vector<double>& listOf(const EffectEntry& entry, const char* key);  ///< not empty

/// @throws Error when a list does not have one value per tooth.
void checkTeeth(const char* effect, std::size_t values, const ToolGeometry& tool);

/// [s] by the clock of an effect on a channel (key `clock`).
class ChannelClock {
 public:
  explicit ChannelClock(const EffectEntry& entry) : record_(wordOf(entry, "clock") == "record") {}
  double operator()(const Instant& now) const {
    return record_ ? now.record_time : now.start_time + now.record_time;
  }

 private:
  bool record_;  // of the record; else of the machine since its cold start
};

}  // namespace smartmill::effects
