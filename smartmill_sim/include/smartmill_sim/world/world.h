#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_sim/controller/controller.h"
#include "smartmill_sim/controller/servo_recorder.h"
#include "smartmill_sim/twin/cutting_machine.h"
#include "smartmill_sim/world/hammer_station.h"
#include "smartmill_sim/world/manual_forces.h"
#include "smartmill_sim/world/motor_currents.h"
#include "smartmill_sim/world/plate.h"
#include "smartmill_sim/world/spindle_sensor.h"
#include "smartmill_sim/world/station_traits.h"
#include "smartmill_sim/world/stock_contact.h"

namespace smartmill::sim {

struct WorldOptions {
  std::uint64_t seed = 1;
  int substeps = 4;
  double tap_peak = 300.0;
  double tap_contact = 4.0e-4;
  double operator_delay = 0.0;
  double force_scatter = 0.05;
  double load_step = LOAD_METER_STEP;
  int servo_trigger = 0;
  bool pulse_train = false;
  bool microphone = false;
  StationTraits hammer;
  MotorTraits motor;
  SpindleSensorTraits spindle_sensor;
  PlateTraits plate;

  // Set by programs only.
  std::size_t contact_update = 64;  ///< [samples] between two updates of the contact with the stock: 2.5 ms,
                                    ///< in which a tool moves 0.1 mm at 2.4 m/min
  double hammer_delay = 0.03;       ///< [s] of a solenoid from its command to the contact
  /// Tools to which M6 changes, by T: of each model the tool, its coefficients and modes of the tip if
  /// stated; everything else is that of the machine. The machine starts with the tool of its own model.
  std::map<int, MachineModel> magazine;

  void declare(ParameterTable& table) {
    table.number("seed", seed, "1", Range::notNegative(), "seed of noise and scatter");
    table.number("substeps", substeps, "1", Range::closed(1, 64),
                 "integration steps per sample of 1/25600 s");
    table.number("tap_peak", tap_peak, "N", Range::closed(1.0, 1e5), "peak of a hit on the workpiece");
    table.number("tap_contact", tap_contact, "s", Range::closed(1e-5, 1e-2),
                 "contact time of a hit on the workpiece");
    table.number("operator_delay", operator_delay, "s", Range::closed(0.0, 60.0),
                 "delay of a manual hit on the workpiece after its request; 0: automatic hammer");
    table.number("force_scatter", force_scatter, "1", Range::closed(0.0, 0.5),
                 "standard deviation of a hit's peak, relative to its nominal value");
    table.number(
        "load_step", load_step, "V", Range::closed(0.0, 1.0),
        "resolution of the loads that the controller reports, on the load meter's scale; 0: not rounded");
    table.number("servo_trigger", servo_trigger, "1", Range::notNegative(),
                 "N word of the block that sets the trigger in daq/servo; 0: none");
    table.flag(
        "pulse_train", pulse_train,
        "true: daq/tachometer (one pulse of 5 V per revolution, at angle 0) in place of spindle/angle");
    table.flag("microphone", microphone,
               "true: daq/sound, the pressure at a microphone next to the tool [Pa]");
    table.part("hammer_", hammer);
    table.part("motor_", motor);
    table.part("spindle_sensor_", spindle_sensor);
    table.part("plate_", plate);
    table.section();
  }
  /// @throws Error naming key and value.
  void validate() const;
};

/// Random numbers that sensors and hits of a world share.
struct WorldRandom {
  std::mt19937_64 engine;
  std::normal_distribution<double> normal;

  double gaussian(double deviation) { return deviation * normal(engine); }
  double uniform() { return std::uniform_real_distribution<double>(0.0, 1.0)(engine); }
};

class WorldSensor;

/// A complete machine under its controller: axes, spindle, tool in stock, force sensor under the stock,
/// hammer station next to it, load meter. It advances in sample blocks; time is the running sample index over
/// the sample rate.
class World {
 public:
  static constexpr double SAMPLE_RATE = 25600.0;  ///< [Hz]
  static constexpr std::size_t BLOCK = 256;       ///< samples
  static constexpr std::size_t ANGLES = 2;        ///< samples of the spindle angle per block

  /// Sensor signals and true values; stamps [s] count from sample 0.
  struct Block {
    SampleBlock hammer;         ///< hammer [N] positive in compression, gap [V]; gap_cross [V] if present
    SampleBlock dynamometer;    ///< fx, fy, fz [N]; with a plate also mx, my, mz [N m]
    SampleBlock spindle_force;  ///< x1 .. z2 [N]; no channels without these sensors
    std::array<SpindleAngle, ANGLES> angle;
    SampleBlock tachometer;     ///< one pulse per revolution [V]; no channels without pulse_train
    SampleBlock sound;          ///< pressure [Pa]; no channels without a microphone
    ForceBlock force;           ///< true cutting force on the tool
    SampleBlock vibration;      ///< true displacement of the tip, x, y [m]
    SampleBlock servo;          ///< ServoRecorder's: spindle load and axis currents at 1 kHz
    SampleBlock motor_current;  ///< MotorCurrents': phase currents at 1 kHz; no channels if they are off
    double spindle_load = 0.0;  ///< [1] indicated load at the end, 1 is full scale
  };
  enum class StrikeAnswer { ok, by_hand, failed };

  /// @throws Error naming a missing section of the model: tool, spindle, axes or cutting. Hammer and
  /// workpiece are optional.
  World(const MachineModel& model, const WorldOptions& options);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  /// The simulated controller; thread-safe.
  Controller& controller() { return controller_; }

  /// Drive-point receptances of the tool tip, from the model or from the hammer station's beam.
  const ToolTip& toolTip() const { return tip_; }

  /// Fires a hammer once. Thread-safe. @param point tool or force_sensor @param message receives one line of
  /// text
  StrikeAnswer strike(const std::string& point, const std::string& direction, std::string& message);

  /// Applies a constant force at the tool tip from now on. @param force [N] on the tool @param on_table
  /// whether it acts between tool and workpiece, so that the force sensor measures it too. Thread-safe, as
  /// the next two.
  void pull(const std::array<double, 3>& force, bool on_table);
  /// Changes tool and holder. @param length [m] of both @throws Error if the spindle has no force sensor.
  void setToolLength(double length);
  /// Point of hits on the workpiece. @param point [m] from the plate's origin
  void setTapPoint(const std::array<double, 3>& point);
  /// Clamps an uncut workpiece of the model. Thread-safe. @throws Error without one or when the spindle turns
  void changeWorkpiece();

  /// Breaks a tooth of the tool in the spindle from the next block on. Thread-safe. @param tooth 1..teeth, 0:
  /// a new tool, all teeth whole @param length [m] that its radius loses, from that of the whole tooth; 0:
  /// more than any chip
  /// @return [s] time of the first sample with this tool @throws Error on another tooth or length.
  double breakTooth(int tooth, double length);

  /// The next BLOCK samples.
  void advance(Block& block);
  /// The same with axes and spindle under an external controller. @param states at half a sample after each
  /// sample, BLOCK values
  void advance(Block& block, const std::vector<MotionState>& states);

  /// Skips samples: the index advances, the machine does not move.
  void skipSamples(std::uint64_t samples);

 private:
  /// A tool in the spindle or in the magazine, with the machine as it cuts with it.
  struct MountedTool {
    MountedTool(const MachineModel& model, double step) : machine(model, step) {}
    const ToolGeometry& geometry() const { return *machine.model().tool; }
    CuttingMachine machine;
    std::vector<double> shortening;  // [m] of each tooth
  };
  void addTool(int number, const MachineModel& model);
  void changeTool(int number);
  Hit drawHit(double now);
  void simulateBlock(Block& block, const std::vector<MotionState>& states);
  void updateContact(const MotionState& state);
  void simulateSample(double time, const MotionState& now, Block& block);
  ToolMotion between(const MotionState& now, double share) const;
  void raiseAlarm(int number, const char* text);

  WorldOptions options_;
  double full_scale_;  // [V] of the load meter
  Controller controller_;
  ServoRecorder servo_;
  std::optional<HammerStation> station_;
  ToolTip tip_;
  std::optional<Workpiece> workpiece_;
  std::map<int, MountedTool> tools_;  // by T; 0: that of the model
  MountedTool* tool_;                 // in the spindle
  std::optional<StockContact> stock_;
  std::optional<SpindleSensor> flange_;
  ManualForces manual_;
  WorldRandom random_;
  std::vector<std::unique_ptr<WorldSensor>> sensors_;

  std::mutex mutex_;
  std::uint64_t index_ = 0;
  MotionState last_;  // half a sample after the last sample
  std::vector<MotionState> states_;
  double load_meter_ = 0.0;  // [V]
  double torque_ = 0.0;      // [N m] cutting torque, summed over the samples of a block
};

}  // namespace smartmill::sim
