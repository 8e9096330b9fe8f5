#pragma once

#include <array>
#include <optional>
#include <random>
#include <vector>

#include "smartmill_core/cutting/tool.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_sim/world/gap_sensor.h"
#include "smartmill_sim/world/solenoid.h"
#include "smartmill_sim/world/station_traits.h"
#include "smartmill_sim/world/tool_structure.h"

namespace smartmill::sim {

/// Automatic hammer and capacitive displacement sensor on the table, as the standing tool meets them
/// (Dunwoody fig. 4.1). Sample by sample: stand(), then push() and hear() for each integration step, then
/// read().
class HammerStation {
 public:
  /// @param step [s] of integration. @throws Error when the model lacks tool or hammer, or when stickout,
  /// offset and traits contradict each other.
  HammerStation(const MachineModel& model, const StationTraits& traits, double force_scatter, double step);

  /// Direct receptances of the tip where the traits give the structure; else empty: the model's stand.
  std::optional<ToolTip> tip() const;
  /// Receptance [m/N] of what sensor and hammer of two axes measure; beam only.
  ModalModel measured(std::size_t read_axis, std::size_t struck_axis) const;

  /// The axis (0 x, 1 y) whose sensor and hammer the tool stands before.
  std::optional<std::size_t> facing(const std::array<double, 3>& position) const;

  /// @param now [s] of the command @param touch [s] of the hammer
  void fire(std::size_t axis, double now, double touch, std::mt19937_64& random);
  bool busy(double time) const { return fired_ && !solenoid_.over(time); }
  /// Time went on without it.
  void shift(double time) { solenoid_.shift(time); }

  struct Place {
    std::array<double, 3> position{};  ///< [m] of the tip, machine
    double angle = 0.0, speed = 0.0;   ///< [rad], [rad/s] of the spindle
  };
  void stand(const Place& place, std::mt19937_64& random);

  struct Push {
    double force = 0.0;                       ///< [N] of the hammer
    std::array<double, 2> tip_force{{0, 0}};  ///< [N] at the tip that moves it so; without a beam
    std::array<double, 2> tip{{0, 0}};        ///< [m] of the tip; of a beam
  };
  Push push(double time);
  /// @param displacement [m] of the tip besides push()'s
  void hear(const std::array<double, 2>& displacement);

  struct Reading {
    double force = 0.0, gap = 0.0, cross = 0.0;  ///< [N], [V], [V]: means over the steps, with noise
  };
  Reading read(double time, std::mt19937_64& random);
  bool hasCross() const { return traits_.cross_sensor; }

  /// Whether the tool touches a sensor in this sample.
  bool touched() const { return touched_; }
  /// [m] least distance of the tool from the sensors' faces since it came.
  double closest() const { return closest_; }
  /// [m] how far the surface before the hammer lies behind the cutting circle.
  double struckRetreat(const Place& place, std::size_t axis) const;

 private:
  struct Way {                           // from a blow in one axis
    std::vector<ModalFilter> read, tip;  // by axis
  };
  std::array<double, 2> gaps(const std::array<double, 2>& displacement) const;
  double rigid(double height) const;
  void standBy(std::size_t axis);
  void settle(const Place& place, std::mt19937_64& random);

  smartmill::HammerStation station_;
  ToolGeometry tool_;
  StationTraits traits_;
  ToolSurface surface_;
  std::array<GapSensor, 2> sensor_;  // facing x, y
  Solenoid solenoid_;
  std::optional<ToolStructure> structure_;
  std::vector<Way> ways_;                     // by axis struck; of a beam, at the height of the last blow
  std::array<double, 2> way_height_{{0, 0}};  // [m] of the sensor above the tip in each
  double step_;                               // [s]
  bool turns_ = false;                        // a rigid tool, about its pivot
  double height_ = 0.0;                       // [m] of the sensor's centre above the tip

  bool fired_ = false;
  std::size_t fired_axis_ = 0;
  std::optional<std::size_t> before_;  // the station's axis
  Place place_;
  std::optional<Place> faced_;
  int since_faced_ = 0;
  bool moving_ = false;
  std::array<double, 2> unseen_{{0, 0}};  // [m] by which x and y are off
  std::array<double, 3> stopped_{};
  std::array<double, 2> now_{{0, 0}};  // [m] the structure's displacement at the sensor
  struct Seen {                        // what the present surface shows at one gap
    double gap = -1.0, clearance = 1.0, volt = 0.0;
  };
  std::array<Seen, 2> seen_;
  double rings_until_ = -1.0;  // [s]
  bool touched_ = false;
  double closest_ = 1.0;
  int steps_ = 0;
  double force_sum_ = 0.0;
  std::array<double, 2> volt_sum_{{0, 0}};
};

}  // namespace smartmill::sim
