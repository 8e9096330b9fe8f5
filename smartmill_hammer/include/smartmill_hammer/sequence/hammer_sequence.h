#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/model/station_axes.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_hammer/sequence/hammer_parameters.h"
#include "smartmill_hammer/sequence/machine_command.h"
#include "smartmill_hammer/sequence/measure_frf_result.h"

namespace smartmill::hammer {

class Measurement;
class StationControl;
class StepRunner;
struct ControlEvent;
struct StepOutcome;

/// The measurement of thesis chapter 4 as a list of steps (src/sequence/steps/), without a clock: inputs
/// arrive in stamp order; commands, feedback and the result are fetched. Completion of a command is decided
/// from the streams alone, so that recorded streams answer the same commands in a replay: spindle at its
/// angle and at rest, axes at their target with no distance to go, a hit in the record. An abort retracts the
/// tool where the controller's state permits it, and states so in the message.
///
/// Signs: the tool nears the sensor in the positive sense of the direction; a hammer above the sensor strikes
/// away from it. A hit thus lowers the voltage, and displacement along the hit is -(V - V before) x
/// sensitivity. A hammer opposite the sensor (HammerStation::Opposite) strikes towards it: +(V - V before) x
/// sensitivity.
///
/// A station turned about z (StationAxes) is measured along both of its axes for each goal, and the FRFs are
/// turned into the axes of the machine, in which the goal's direction is.
class HammerSequence {
 public:
  /// @throws Error when the model lacks the hammer or the tool section, a parameter is out of range, or the
  /// station is turned and lacks what that needs.
  HammerSequence(const HammerParameters& parameters, const MachineModel& model);
  ~HammerSequence();

  /// @return false when a measurement is running: the goal is refused and nothing changes.
  bool handle(const MeasureFrfGoal& goal);
  void handle(const SampleBlock& block);
  void handle(const CncState& state);
  void handle(const SpindleAngle& angle);
  void cancel(double stamp);
  void commandFailed(double stamp, const std::string& text);
  /// An input stream has ended, so that no completion can be observed: ends at once, with a last stop and
  /// retract sent without feedback.
  void inputLost(double stamp, const std::string& text);
  /// Discards everything: a bag was restarted.
  void reset();

  bool isActive() const { return phase_ != Phase::idle; }

  std::vector<Command> takeCommands();
  std::optional<Feedback> takeFeedback();
  std::optional<MeasureFrfResult> takeResult();

 private:
  enum class Phase { idle, steps, stopping, retracting };

  void begin(const MeasureFrfGoal& goal);
  void apply(double now, const StepOutcome& outcome);
  void completeHits(double now);
  void checkDeadline(double now);
  /// Passes an event to the steps, or ends the measurement.
  void dispatch(double now, ControlEvent event);
  void abort(double now, FrfCode code, const std::string& reason);
  void retract(double now);
  void endPart(double now);
  void finish();

  HammerParameters parameters_;
  MachineModel model_;
  StationAxes axes_;
  Phase phase_ = Phase::idle;
  std::unique_ptr<StationControl> control_;
  std::unique_ptr<Measurement> measurement_;
  std::unique_ptr<StepRunner> steps_;
  int asked_modes_ = 0;
  std::optional<MeasureFrfResult> first_part_;  // of a turned station: hits along the first of its axes
  std::optional<MeasureFrfResult> result_;
};

}  // namespace smartmill::hammer
