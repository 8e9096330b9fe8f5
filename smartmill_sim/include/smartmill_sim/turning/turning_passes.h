#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_sim/controller/motion_state.h"
#include "smartmill_sim/controller/path_move.h"

namespace smartmill::sim {

/// Passes of the turning tool: longitudinal, facing and taper, as Cheng & Venuvinod calibrate and test
/// (sections 9 and 10). Units and meaning: declare().
struct PassTraits {
  double radius = 0.03;
  double reference_depth = 1.0e-3;
  std::vector<double> angle{0.0, 0.0, 0.5236, 1.5708};
  std::vector<double> feed{1.0e-4, 2.0e-4, 1.5e-4, 1.5e-4};
  std::vector<double> depth{1.0e-3, 0.8e-3, 0.8e-3, 0.6e-3};
  double duration = 8.0;

  void declare(ParameterTable& table);
  /// @throws Error naming key and value.
  void validate() const;
};

/// Motion of the axes over the passes, from the first to the last and again. Each pass is done twice in the
/// same direction and with the same feed: in air, the tool clear of the workpiece (kind AIR of the cutting
/// condition), and in the cut (CUT). In between the tool returns (NONE). X is the radius, Y is at rest, -Z
/// points to the chuck.
class TurningPasses {
 public:
  /// @param spindle_speed [rad/s] > 0. @throws Error on bad traits.
  TurningPasses(const PassTraits& traits, double spindle_speed);

  /// Goes on to a time [s]; times do not decrease. @return whether a new condition begins
  bool advance(double time);

  /// Axes and spindle at a time [s] of the present move.
  MotionState state(double time) const;
  std::array<double, 3> distanceToGo(double time) const;  ///< [m]
  /// Of the present move; a turning cut has no teeth, and the diameter of the workpiece at half depth and
  /// half way.
  const CuttingCondition& condition() const { return condition_; }

  /// Whether the tool is in the cut at a time [s]; then feed and width are those of the present pass.
  bool isCutting(double time) const;
  double feed() const { return traits_.feed[pass_]; }                              ///< [m] per revolution
  double width() const { return traits_.depth[pass_] / traits_.reference_depth; }  ///< [1]
  double angle() const { return traits_.angle[pass_]; }  ///< [rad] of the feed, from -Z towards -X
  /// [m] radius at half depth.
  double radius(double time) const { return radiusAt(move_.position(time)[0]); }

 private:
  enum class Step { retract, approach, feed };
  using Point = PathMove::Point;
  Point start(bool air) const;
  Point along(const Point& from, const std::array<double, 3>& direction, double distance) const;
  double radiusAt(double x) const;
  double velocity() const;
  void begin(double time);
  void announce(double time, CuttingCondition::Kind kind);

  PassTraits traits_;
  double spindle_speed_;
  std::size_t pass_ = 0;
  std::uint64_t passes_ = 0;  // so far
  bool air_ = true;
  Step step_ = Step::approach;
  PathMove move_;
  CuttingCondition condition_;
};

/// Unit vectors of a turning pass in the X-Z plane. @param angle [rad] of the feed, from -Z towards -X
std::array<double, 3> feedDirection(double angle);
/// Normal to the feed, away from the workpiece: +X, in facing +Z.
std::array<double, 3> clearDirection(double angle);

}  // namespace smartmill::sim
