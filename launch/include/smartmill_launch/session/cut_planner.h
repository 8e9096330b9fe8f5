#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::session {

/// Reserves in time and length of every cut.
struct CutReserves {
  double exit = 1.0e-3;         ///< [m] from the far side of the stock, so that the tool does not leave it
  double run_out_time = 0.1;    ///< [s] of feed beyond the steady segment, for the ramps of the axes
  double spin_up_factor = 1.2;  ///< [1] of the time of the nominal acceleration: the real one differs
  double spin_up_extra = 0.3;   ///< [s] for M3 itself
};

/// Parameters of the paths through the stock.
struct PathParameters {
  std::string tool = "end_mill";
  std::string material;

  double lane_margin = 2.0e-3;
  double clearance = 2.0e-3;
  double safe_height = 10.0e-3;
  double plunge_feed = 20.0e-3;
  double spin_up_time = 3.0;
  int feed_block = 0;
  CutReserves reserves;  ///< no parameters of the node

  void declareNames(ParameterTable& table);
  void declarePaths(ParameterTable& table);
};

/// One test or cut, ready for execution.
struct PlannedCut {
  CuttingCondition condition;
  std::array<double, 3> from{{0, 0, 0}};  ///< [m] tool tip before the stock at cutting height; machine frame
  std::array<double, 3> to{{0, 0, 0}};    ///< [m] end of the feed motion
  double feed = 0.0;                      ///< [m/s]; 0: in air, no motion
  double spin_up = 0.0;                   ///< [s] dwell after M3
  double dwell = 0.0;                     ///< [s] at speed, in air
  /// [m] y at which the tool is in air next to the stock; it moves there from the end, before it is lifted.
  std::optional<double> leave_y;
  double leave_feed = 0.0;     ///< [m/s]
  double cuttingTime() const;  ///< [s] of feed, with entry and exit
  double duration() const;     ///< [s] of spin-up, feed and dwell, without rapid motion
};

/// Part of the tool's front half that is in the stock: all of it (entry 0, exit pi), up-milling (entry 0,
/// exit pi/2) or down-milling (entry pi/2, exit pi) with half immersion.
enum class Immersion { slot, half_up, half_down };
/// slot, half_up or half_down.
const char* wordOf(Immersion immersion);

/// A cut along +x.
struct SlotRequest {
  std::string name;
  std::size_t lane = 0;  ///< of slots; of half immersion the strip, counted from the free side of the stock
  double speed = 0.0, depth = 0.0, feed_per_tooth = 0.0;  ///< [rad/s], [m], [m]
  double time = 0.0, least_time = 0.0;                    ///< [s] steady cutting: maximum, minimum
  Immersion immersion = Immersion::slot;
  double shift = 0.0;  ///< [m] of the lanes of slots in y, by strips before the first lane
  /// [m] x that the feed reaches at least; beyond the stock: its end
  double least_end = -std::numeric_limits<double>::infinity();
};

/// Paths of single cuts in the stock of the nominal model, along +x: full slots in parallel lanes, spaced in
/// y, and cuts of half immersion along a free side of the stock. Such a cut has the centre of the tool on
/// the free side and takes a strip of its radius; its new side is the free side of the next strip.
/// Up-milling strips begin at the side of small y, down-milling strips at that of large y. The tool enters
/// from the air before the stock and leaves sideways into the air next to it. All positions are of the centre
/// of the tool tip in the machine frame.
class CutPlanner {
 public:
  /// @throws Error of one line if the model lacks tool, spindle, axes or workpiece.
  CutPlanner(const MachineModel& model, const PathParameters& parameters);

  const std::string& material() const { return material_; }
  std::size_t lanes() const { return lanes_; }  ///< lanes in the stock
  /// @throws Error if the stock has fewer lanes. @param purpose of the lanes, for the error
  void requireLanes(std::size_t needed, const std::string& purpose) const;

  double laneWidth() const;   ///< [m] of a slot with the margin to the next
  double height() const;      ///< [m] of the stock
  double stripWidth() const;  ///< [m] of a cut of half immersion
  /// [m] width of the stock for lanes and strips, without the margin of the first lane.
  double width() const;

  double feedPerTooth(double speed) const;  ///< [m] at the maximum feed of the axes and a speed [rad/s]

  /// @throws Error if the cut does not fit machine or stock.
  PlannedCut slot(const SlotRequest& request) const;
  PlannedCut air(double speed, double time) const;
  /// Move along +x above the stock for the friction of the feed drives, over at least a time [s] and a
  /// distance [m].
  PlannedCut airMove(double speed, double feed, double time, double distance) const;

  /// NC program of a cut (dialect of smartmill_cnc), incremental from the current position, independent of
  /// work offsets. @param position [m] of the machine at its start.
  std::string program(const PlannedCut& cut, const std::array<double, 3>& position) const;

 private:
  double spinUp(double speed) const;
  void checkSpeed(const std::string& name, double speed) const;
  void checkTravel(const PlannedCut& cut) const;
  double laneY(const SlotRequest& request) const;

  PathParameters parameters_;
  std::string file_, material_;
  ToolGeometry tool_;
  Spindle spindle_;
  MachineAxes axes_;
  Workpiece stock_;
  std::size_t lanes_ = 0;
};

}  // namespace smartmill::session
