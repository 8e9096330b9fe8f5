#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "controller_state.h"
#include "motion_check.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/model/station_axes.h"
#include "smartmill_core/signal/hit_collector.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_hammer/sequence/hammer_parameters.h"
#include "smartmill_hammer/sequence/machine_command.h"
#include "voltage_average.h"

namespace smartmill::hammer {

/// The commanded motion is complete.
struct MotionDone {};

/// A hit, or why there is none.
struct RecordedHit {
  Hit hit;
  std::optional<Hit> cross;  ///< of the second sensor
  HitFault fault;
};

/// What ends a measurement.
struct ControlFault {
  FrfCode code = FrfCode::motion_failed;
  std::string text;
};

struct ControlEvent : std::variant<std::monostate, MotionDone, MeanVoltage, RecordedHit, ControlFault> {
  using variant::variant;
};

/// One sample of daq/hammer.
struct StationSample {
  double time = 0.0;  ///< [s]
  std::uint64_t index = 0;
  double rate = 0.0;                 ///< [Hz]
  double force = 0.0;                ///< [N]
  double volt = 0.0;                 ///< [V]
  std::optional<double> cross_volt;  ///< [V] second sensor; empty: none
};

/// Sends the commands of a measurement one at a time and decides from the streams when each is complete. The
/// inputs return the event that a step waits for. Positions are along the axes of the station; the commands
/// and the controller's state are in those of the machine.
class StationControl {
 public:
  /// @param range_volt [V] of the displacement sensor
  StationControl(const HammerParameters& parameters, const StationAxes& axes, double range_volt);

  /// Begins a measurement: waits until the axes rest at or after this time [s].
  void start(double stamp, const std::string& direction);

  void orient(double now, double angle);
  void jog(double now, std::size_t axis, double distance, double feed);
  void move(double now, const Axes3& from, std::vector<Waypoint> path);
  void strike(double now);
  void strikeAfterRest(double now);  ///< after `rest_time`
  void measureVoltage(double from);
  void stop(double now);
  /// Commands nothing more and waits for nothing.
  void release();

  /// Which sensor measureVoltage() reads.
  void selectSensor(bool cross) { cross_selected_ = cross; }
  /// Whether the end of the sensor's range is a fault: the tool is nearer than the sensor can measure.
  void watchRange(bool watch) { range_watched_ = watch; }

  ControlEvent handle(const StationSample& sample);
  ControlEvent handle(const CncState& state);
  ControlEvent handle(const SpindleAngle& angle);
  /// A fault or a missing hit when the deadline has passed.
  ControlEvent checkDeadline(double now);

  const std::optional<CncState>& state() const { return state_; }
  /// [m] displayed; empty: the controller's state lacks an axis
  std::optional<AxesPosition> position() const;
  bool hasCrossSensor() const { return has_cross_; }
  bool hasCommanded() const { return commanded_; }
  bool isWaitingForHit() const { return wait_ == Wait::hit; }
  const Axes3& target() const { return motion_.position(); }      ///< [m] commanded position
  double reachedAngle() const { return motion_.reachedAngle(); }  ///< [rad] after an orientation
  int spindleMoves() const { return spindle_moves_; }
  std::vector<Command> takeCommands();

 private:
  enum class Wait { nothing, readiness, position, angle, voltage, hit, rest, standstill };

  void send(Command command, Wait wait, double timeout);
  void move(double now, const Axes3& from, std::vector<Waypoint> path, double tolerance);
  double jogTolerance(double distance) const;  ///< [m]
  bool isTooNear(double volt);
  bool canComplete(double stamp) const;
  ControlEvent complete();
  ControlEvent hitOf(HitCollector::Record record, std::optional<HitCollector::Record> cross);

  const HammerParameters& parameters_;
  StationAxes axes_;
  double range_volt_;
  std::string direction_;
  std::vector<Command> commands_;
  bool commanded_ = false;
  int spindle_moves_ = 0;
  std::optional<CncState> state_;

  Wait wait_ = Wait::nothing;
  double sent_ = 0.0, deadline_ = 0.0;  // [s]
  MotionCheck motion_;
  double rest_until_ = 0.0;  // [s]

  VoltageAverage average_;
  HitCollector collector_, cross_collector_;
  bool has_cross_ = false, cross_selected_ = false, range_watched_ = false;
  int near_samples_ = 0;
};

}  // namespace smartmill::hammer
