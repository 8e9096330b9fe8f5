#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::session {

/// How cuts are led through the stock.
struct PathParameters {
  std::string tool = "end_mill";
  std::string material;

  double lane_margin = 2.0e-3;
  double clearance = 2.0e-3;
  double safe_height = 10.0e-3;
  double plunge_feed = 20.0e-3;
  double spin_up_time = 3.0;
  int feed_block = 0;

  void declareNames(ParameterTable& table);
  void declarePaths(ParameterTable& table);
};

/// One test or cut, ready to be sent.
struct PlannedCut {
  CuttingCondition condition;
  std::array<double, 3> from{{0, 0, 0}};  ///< [m] tool tip beside the stock at cutting height; machine frame
  std::array<double, 3> to{{0, 0, 0}};    ///< [m] where the feed ends
  double feed = 0.0;                      ///< [m/s]; 0: in air, no motion
  double spin_up = 0.0;                   ///< [s] waited after M3
  double dwell = 0.0;                     ///< [s] at speed, in air
  double duration() const;                ///< [s] of spin-up, feed and dwell, without rapid motion
};

/// A full slot along +x.
struct SlotWish {
  std::string name;
  std::size_t lane = 0;
  double speed = 0.0, depth = 0.0, feed_per_tooth = 0.0;  ///< [rad/s], [m], [m]
  double time = 0.0, least_time = 0.0;                    ///< [s] steady: longest, shortest
};

/// Paths of single cuts in the stock of the believed model: full slots along +x in lanes side by side in y.
/// All positions are of the tool tip's centre in the machine frame.
class CutPlanner {
 public:
  /// @throws Error of one line when the model lacks something.
  CutPlanner(const MachineModel& model, const PathParameters& parameters);

  const std::string& material() const { return material_; }
  std::size_t lanes() const { return lanes_; }  ///< that the stock holds
  /// @throws Error when the stock holds fewer. @param what they are for
  void needLanes(std::size_t needed, const std::string& what) const;

  /// @throws Error saying what does not fit machine or stock.
  PlannedCut slot(const SlotWish& wish) const;
  PlannedCut air(double speed, double time) const;
  /// Along +x above the stock, as long as the time or the way asks, for the feed drives' friction.
  PlannedCut airMove(double speed, double feed, double time, double way) const;

  /// NC program of a cut (dialect of smartmill_cnc), in increments from where the machine stands, free of
  /// work offsets. @param position [m] of the machine before it.
  std::string program(const PlannedCut& cut, const std::array<double, 3>& position) const;

 private:
  double spinUp(double speed) const;
  void checkSpeed(const std::string& name, double speed) const;
  void checkTravel(const PlannedCut& cut) const;
  double laneY(std::size_t lane) const;

  PathParameters parameters_;
  std::string file_, material_;
  ToolGeometry tool_;
  Spindle spindle_;
  MachineAxes axes_;
  Workpiece stock_;
  std::size_t lanes_ = 0;
};

}  // namespace smartmill::session
