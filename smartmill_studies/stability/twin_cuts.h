#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/cutting/speed_variation.h"
#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::stability {

/// One steady cut.
struct TwinCut {
  double speed = 0.0;     ///< [rad/s]
  Engagement engagement;  ///< arc, depth, feed per tooth
  int samples = 180;      ///< [1] per revolution
  int revolutions = 100;  ///< [1] in cut
  int air = 0;            ///< [1] revolutions before the tool engages
  /// Of the speed; revolutions are those of the mean speed.
  std::optional<SpeedVariation> variation = std::nullopt;
};

/// Rounds the samples per revolution up to a multiple of the teeth.
inline int wholeTeeth(int samples, int teeth) {
  return (samples + teeth - 1) / teeth * teeth;
}

/// Options of the simulation.
struct TwinRequest {
  std::vector<std::string>
      columns;         ///< of the records in addition to the time, as in docs/formats.md without unit
  bool noise = false;  ///< of the sensors
  unsigned seed = 1;   ///< of the noise of the first cut, increased by one per cut
};

/// Cuts in the time domain of smartmill_sim, spread over the cores.
/// @param models one for all cuts, or one per cut
/// @param judge called once per cut with its index and record, in order
/// @param progress called with the share done. @throws Error with the message of the simulator.
void runTwinCuts(const std::vector<MachineModel>& models, const std::vector<TwinCut>& cuts,
                 const TwinRequest& request, const std::function<void(std::size_t, const Record&)>& judge,
                 const std::function<void(double)>& progress = {});

}  // namespace smartmill::stability
