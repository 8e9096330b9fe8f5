#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "smartmill_program/engagement/cut_simulation.h"
#include "smartmill_program/prediction/step_predictor.h"

namespace smartmill::program {

/// The steps of one executed block together. Angles, depths, feed per tooth and forces are those of its cuts;
/// NaN: it has none.
struct BlockSummary {
  static constexpr double NONE = std::numeric_limits<double>::quiet_NaN();

  BlockSummary() = default;
  explicit BlockSummary(const Move& move);
  void add(const Step& step, const StepPrediction& prediction);
  void addDwell(double seconds) { time += seconds; }

  std::size_t block = 0;  ///< in the order of execution, from 0
  int line = 0, tool = 0;
  std::string operation;
  std::shared_ptr<const std::string> name;         ///< see Move
  double length = 0.0;                             ///< [m]
  double time = 0.0, cut_time = 0.0;               ///< [s] of all, of the steps that remove material
  double feed_time = 0.0;                          ///< [s] of feed motion
  double axial_depth = NONE, radial_depth = NONE;  ///< [m] largest
  double entry = NONE, exit = NONE;        ///< [rad] of the widest engagement: least and largest angle
  double feed_per_tooth = NONE;            ///< [m] largest
  double chip = NONE;                      ///< [m] largest thickness
  double deflection = NONE;                ///< [m] largest of the tip, of stable steps
  double speed = 0.0, feed = 0.0;          ///< [rad/s], [m/s] of the feed motion
  double volume = 0.0, face_volume = 0.0;  ///< [m3]
  double peak_force = NONE;                ///< [N]
  double peak_torque = NONE;               ///< [N m]
  double power = NONE;                     ///< [W] largest mean power of a step
  double margin = NONE;                    ///< [1] least stability limit over axial depth
  double chatter = NONE;                   ///< [1] largest probability of chatter
  double wall_error = NONE;                ///< [m] of the largest magnitude
  bool rapid_hit = false;                  ///< a rapid move removes material
  bool holder_hit = false;                 ///< the holder meets material

  /// "G1" or "G1, NAME"
  std::string label() const { return name ? operation + ", " + *name : operation; }
  /// [1] Share of the feed motion's time without removal; NaN without feed motion.
  double airShare() const { return feed_time > 0.0 ? 1.0 - cut_time / feed_time : NONE; }
};

/// "NAME: line 12: G0: a rapid move hits the stock (and 3 more blocks)" of the first collision, of a rapid
/// move or the holder; empty: there is none.
std::string collisionText(const std::string& name, const std::vector<BlockSummary>& blocks);

}  // namespace smartmill::program
