#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_sim/controller/controller.h"
#include "smartmill_sim/world/motor_currents.h"
#include "smartmill_sim/world/plate.h"
#include "smartmill_sim/world/spindle_sensor.h"
#include "smartmill_sim/world/station_traits.h"

namespace smartmill::sim {

struct WorldOptions {
  std::uint64_t seed = 1;
  int substeps = 4;
  double tap_peak = 300.0;
  double tap_contact = 4.0e-4;
  double operator_delay = 0.0;
  double force_scatter = 0.05;
  double load_step = 3.0e-4;
  int servo_trigger = 0;
  StationTraits hammer;
  MotorTraits motor;
  SpindleSensorTraits spindle_sensor;
  PlateTraits plate;

  void declare(ParameterTable& table) {
    table.number("seed", seed, "1", Range::notNegative(), "of noise and scatter");
    table.number("substeps", substeps, "1", Range::closed(1, 64), "integration steps a sample of 1/25600 s");
    table.number("tap_peak", tap_peak, "N", Range::closed(1.0, 1e5), "of a blow on the workpiece");
    table.number("tap_contact", tap_contact, "s", Range::closed(1e-5, 1e-2), "of a blow on the workpiece");
    table.number("operator_delay", operator_delay, "s", Range::closed(0.0, 60.0),
                 "above 0 a person hits the workpiece, so long after being asked; 0: automatic");
    table.number("force_scatter", force_scatter, "1", Range::closed(0.0, 0.5),
                 "standard deviation of a blow's peak over its nominal value");
    table.number("load_step", load_step, "V", Range::closed(0.0, 1.0),
                 "of the load meter's scale, to which the controller rounds the loads that it tells; 0: not");
    table.number("servo_trigger", servo_trigger, "1", Range::notNegative(),
                 "N word of the block that starts the trigger in daq/servo; 0: none");
    table.part("hammer_", hammer);
    table.part("motor_", motor);
    table.part("spindle_sensor_", spindle_sensor);
    table.part("plate_", plate);
    table.section();
  }
  /// @throws Error naming key and value.
  void validate() const;
};

/// A whole machine that obeys its controller: axes, spindle, tool in stock, force sensor under it, hammer
/// station beside it, load meter. In blocks of samples; time is the running sample index over the sample
/// rate.
class World {
 public:
  static constexpr double SAMPLE_RATE = 25600.0;  ///< [Hz]
  static constexpr std::size_t BLOCK = 256;       ///< samples
  static constexpr std::size_t ANGLES = 2;        ///< readings of the spindle's angle a block

  /// What the sensors deliver and what is true; stamps [s] count from sample 0.
  struct Block {
    SampleBlock hammer;       ///< hammer [N] positive in compression, gap [V]; gap_cross [V] where it stands
    SampleBlock dynamometer;  ///< fx, fy, fz [N]; of a plate also mx, my, mz [N m]
    SampleBlock spindle_force;  ///< x1 .. z2 [N]; without channels where the spindle has no such sensors
    std::array<SpindleAngle, ANGLES> angle;
    ForceBlock force;       ///< true force of the cut on the tool
    SampleBlock vibration;  ///< true displacement of the tip, x, y [m]
    SampleBlock servo;      ///< ServoRecorder's: spindle load and axis currents at 1 kHz
    SampleBlock
        motor_current;  ///< MotorCurrents': phase currents at 1 kHz; without channels where they are off
    double spindle_load = 0.0;  ///< [1] what the load meter shows at the end, 1 is full scale
  };
  enum class StrikeAnswer { ok, by_hand, failed };

  /// @throws Error naming what the model lacks: tool, spindle, axes, cutting; hammer and workpiece only limit
  /// what can be done.
  World(const MachineModel& model, const WorldOptions& options);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  /// May be used from any thread.
  Controller& controller();

  /// Direct receptances of the tool's tip, of the model or of the hammer station's beam.
  const ToolTip& toolTip() const;

  /// Fires a hammer, once. May be called from any thread. @param point tool or force_sensor @param message
  /// one line
  StrikeAnswer strike(const std::string& point, const std::string& direction, std::string& message);

  /// Something pulls at the tool's tip from now on. @param force [N] on the tool @param on_table against the
  /// workpiece: the force sensor under it feels it too. May be called from any thread, as the next two.
  void pull(const std::array<double, 3>& force, bool on_table);
  /// Another tool and holder in the spindle. @param length [m] @throws Error where nothing depends on it.
  void setToolLength(double length);
  /// Where blows on the workpiece go. @param point [m] from the plate's origin
  void setTapPoint(const std::array<double, 3>& point);

  /// The next BLOCK samples.
  void advance(Block& block);
  /// The same with axes and spindle that obey a controller elsewhere. @param states of half a sample after
  /// each sample, BLOCK of them
  void advance(Block& block, const std::vector<MotionState>& states);

  /// Samples that nobody took: the index goes on, the machine does not move.
  void lose(std::uint64_t samples);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartmill::sim
