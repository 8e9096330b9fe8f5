#pragma once

#include <array>
#include <optional>
#include <random>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/model/station_axes.h"
#include "smartmill_sim/world/beam_response.h"
#include "smartmill_sim/world/gap_sensor.h"
#include "smartmill_sim/world/solenoid.h"
#include "smartmill_sim/world/station_traits.h"

namespace smartmill::sim {

/// Automatic hammer and capacitive displacement sensor on the table, for a tool at rest (Dunwoody fig. 4.1).
/// Calls per sample: setPose(), then push() and addDisplacement() for each integration step, then read().
/// Positions, displacements and forces are along the machine's axes; sensors and hits along those of the
/// station (StationAxes), which "axis" numbers.
class HammerStation {
 public:
  /// @param step [s] of integration @throws Error if the model lacks tool or hammer, or if stickout, offset
  /// and traits are inconsistent.
  HammerStation(const MachineModel& model, const StationTraits& traits, double force_scatter, double step);

  /// Drive-point receptances of the tip if the traits define the structure; nullopt: those of the model
  /// apply.
  std::optional<ToolTip> tip() const;
  /// Receptance [m/N] between hammer and sensor of two axes; beam only.
  ModalModel measured(std::size_t read_axis, std::size_t struck_axis) const;

  /// The axis of the station (0 x, 1 y) whose sensor and hammer the tool faces; nullopt: none.
  std::optional<std::size_t> facing(const std::array<double, 3>& position) const;

  /// Fires the hammer. @param now [s] time of the command @param touch [s] time of the first contact
  void fire(std::size_t axis, double now, double touch, std::mt19937_64& random);
  bool busy(double time) const { return fired_ && !solenoid_.over(time); }
  /// Skips a time [s].
  void skipTime(double time) { solenoid_.skipTime(time); }

  struct Pose {
    std::array<double, 3> position{};  ///< [m] machine position of the tip
    double angle = 0.0, speed = 0.0;   ///< [rad], [rad/s] of the spindle
  };
  void setPose(const Pose& machine_pose, std::mt19937_64& random);

  struct Push {
    double force = 0.0;                       ///< [N] of the hammer
    std::array<double, 2> tip_force{{0, 0}};  ///< [N] equivalent force at the tip; without a beam
    std::array<double, 2> tip{{0, 0}};        ///< [m] displacement of the tip; with a beam
  };
  Push push(double time);
  /// Adds a step to the sensors' means. @param in_machine [m] of the tip, without that of push()
  void addDisplacement(const std::array<double, 2>& in_machine);

  struct Sample {
    double force = 0.0, gap = 0.0, cross = 0.0;  ///< [N], [V], [V]; means over the steps, with noise
  };
  Sample read(double time, std::mt19937_64& random);
  bool hasCross() const { return traits_.cross_sensor; }

  /// Whether the tool touched a sensor in this sample.
  bool touched() const { return touched_; }
  /// Least distance [m] of the tool from the sensors' faces since it faced them.
  double closest() const { return closest_; }
  /// Distance [m] of the surface at the hammer from the cutting circle.
  double struckRetreat(const Pose& pose, std::size_t axis) const;

 private:
  /// Positioning error of x and y, drawn when an axis stops.
  class PositionError {
   public:
    /// @param deviation [m]
    explicit PositionError(double deviation) : deviation_(deviation) {}
    void update(const Axes3& before, const Axes3& now, std::mt19937_64& random);
    bool moving() const { return moving_; }
    double at(std::size_t axis) const { return error_[axis]; }  ///< [m]

   private:
    double deviation_;
    bool moving_ = false;
    std::array<double, 2> error_{{0, 0}};
    Axes3 stopped_{};
  };

  std::optional<std::size_t> facingAt(const Axes3& position) const;
  std::array<double, 2> gaps(const std::array<double, 2>& displacement) const;
  double rigidRatio(double height) const;
  void updateTarget();
  bool reads(std::size_t axis) const { return axis == *facing_axis_ || traits_.cross_sensor; }

  StationAxes axes_;
  smartmill::HammerStation station_;  // positions along its own axes
  ToolGeometry tool_;
  StationTraits traits_;
  ToolSurface surface_;
  std::array<GapMean, 2> gap_;  // in x, y
  Solenoid solenoid_;
  std::optional<BeamResponse> beam_;  // along the station's axes
  std::optional<ToolTip> tip_;        // of the beam, along the machine's axes
  PositionError error_;
  bool pivots_ = false;  // a rigid tool turns about its pivot
  double height_ = 0.0;  // [m] height of the sensor's centre above the tip

  bool fired_ = false;
  std::size_t fired_axis_ = 0;
  std::optional<std::size_t> facing_axis_;  // axis of the station that the tool faces
  Pose pose_;                               // position along the station's axes
  std::optional<Pose> surface_pose_;
  int samples_since_update_ = 0;
  bool touched_ = false;
  double closest_ = 1.0;
  int steps_ = 0;
  double force_sum_ = 0.0;
};

}  // namespace smartmill::sim
