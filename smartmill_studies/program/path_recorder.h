#pragma once

#include <array>
#include <vector>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_sim/world/world.h"

namespace smartmill {

/// Records the production of a part as a test of kind path: forces and spindle angle at the rate of the
/// dynamometer; positions and load of the controller between its stamps, linear and held.
class PathRecorder {
 public:
  void push(const CncState& state) { states_.push_back(state); }
  void push(const LoadSample& load) { loads_.push_back(load); }
  void push(const sim::World::Block& block);

  double sampleRate() const { return rate_; }  ///< [Hz]
  /// @param full_scale [V] of the load meter @param begin, end [s] stamps
  Record record(double full_scale, double begin, double end) const;

 private:
  std::vector<CncState> states_;
  std::vector<LoadSample> loads_;
  std::vector<SpindleAngle> angles_;
  std::vector<double> time_;  // [s]
  std::array<std::vector<double>, 3> force_;
  double rate_ = 0.0;
};

}  // namespace smartmill
