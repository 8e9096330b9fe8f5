#pragma once

#include <array>
#include <deque>
#include <limits>
#include <string>

#include "smartmill_core/signal/streams.h"
#include "smartmill_loadmeter/identification/production_run.h"
#include "smartmill_loadmeter/identification/temperature_watch.h"

namespace smartmill::loadmeter {

/// A cut whose part may be inspected.
struct InspectedCut {
  CuttingCondition condition;
  double end = std::numeric_limits<double>::infinity();        ///< [s]
  std::array<TemperatureReading, 3> temperature;               ///< for faces along x, y, z
  double edge_age = std::numeric_limits<double>::quiet_NaN();  ///< [s] cutting time of the edge; NaN: unknown
};

/// Cuts of this run by name, for parts that are inspected later (topic cut/condition).
class CutHistory {
 public:
  /// A condition begins, and with it ends the one before.
  void handle(const CuttingCondition& condition, const TemperatureWatch& temperature,
              const ProductionRun& production);
  void clear() { cuts_.clear(); }

  /// @param time [s] of the cut; NaN: not stated. @throws Error if no cut or more than one is meant.
  const InspectedCut& find(const std::string& name, double time) const;

 private:
  std::deque<InspectedCut> cuts_;
};

}  // namespace smartmill::loadmeter
