#include "smartmill_core/model/effect.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/model/effect_catalogue.h"

namespace smartmill {

const char* channelName(std::size_t channel) {
  return measuredChannels().at(channel).c_str();
}

std::size_t channelOf(const std::string& name) {
  const std::vector<std::string>& names = measuredChannels();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) throw Error("'" + name + "' is not a measured channel");
  return static_cast<std::size_t>(found - names.begin());
}

double BurstTrain::shape(double since) const {
  return std::exp(-since / decay) * std::sin(units::TWO_PI * frequency * since);
}

double BurstTrain::at(double time) const {
  const double since = std::fmod(time - first, period);
  return amplitude * shape(since < 0.0 ? since + period : since);
}

std::unique_ptr<Effect> makeEffect(const EffectEntry& entry) {
  const EffectKind* kind = findEffect(entry.name);
  if (!kind) throw Error("'" + entry.name + "' is not an effect of the catalogue");
  return kind->make(entry);
}

}  // namespace smartmill
