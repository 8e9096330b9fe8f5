#pragma once

#include <functional>
#include <string>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::stability {

/// One steady cut to be simulated.
struct TwinCut {
  double speed = 0.0;     ///< [rad/s]
  Engagement engagement;  ///< arc, depth, feed per tooth
  int samples = 180;      ///< [1] a revolution
  int revolutions = 100;  ///< [1] in cut
  int air = 0;            ///< [1] revolutions before the tool engages
};

/// Cuts of one machine run by the simulator, `rosrun smartmill_sim simulate`, as a program: model and
/// campaign go there as files, records come back. Spread over the cores, in batches.
class TwinCuts {
 public:
  /// @param simulate path of the program. @throws Error when it cannot be run.
  explicit TwinCuts(std::string simulate);
  /// Beside the running program in the same workspace: .../lib/smartmill_sim/simulate; "" when it is not
  /// there.
  static std::string besideThisProgram();

  /// @param columns of the records besides the time, as in docs/formats.md without unit (tool_x, fx, ...)
  /// @param noise of the sensors, seeded @param judge called once a cut with its index and record, in order
  /// @param progress called with the share done. @throws Error with the simulator's own words.
  void run(const MachineModel& model, const std::vector<TwinCut>& cuts,
           const std::vector<std::string>& columns, bool noise, unsigned seed,
           const std::function<void(std::size_t, const Record&)>& judge,
           const std::function<void(double)>& progress = {}) const {
    run(std::vector<MachineModel>{model}, cuts, columns, noise, seed, judge, progress);
  }
  /// The same with a machine of its own for each cut. @param models one, or one a cut
  void run(const std::vector<MachineModel>& models, const std::vector<TwinCut>& cuts,
           const std::vector<std::string>& columns, bool noise, unsigned seed,
           const std::function<void(std::size_t, const Record&)>& judge,
           const std::function<void(double)>& progress = {}) const;

 private:
  std::string simulate_;
};

}  // namespace smartmill::stability
