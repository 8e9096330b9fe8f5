#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/modal/hit_test_parameters.h"
#include "smartmill_core/modal/impact_analysis.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/hit_collector.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_hammer/analysis/tip_correction.h"
#include "smartmill_hammer/search/flute_search.h"
#include "smartmill_hammer/search/sensor_approach.h"
#include "smartmill_hammer/search/sensor_calibration.h"

namespace smartmill {
namespace hammer {

/// What may be tuned; defaults are the thesis's where it gives one.
struct HammerParameters : HitTestParameters {
  // Flute search.
  double start_angle = 0.0;
  double bracket_first_step = 0.0977;
  double bracket_max_step = 0.3927;
  double flute_tolerance = 0.02618;
  double noise_sigmas = 5.0;
  double least_rise = 0.005;
  int golden_only = 0;
  // When a command is done.
  double command_delay = 0.2;
  double settle_time = 0.05;
  double averaging_time = 0.01;
  double angle_tolerance = 2.6e-3;
  double zero_speed = 0.02;
  int rest_readings = 5;
  double position_tolerance = 2.0e-6;
  double orient_timeout = 20.0;
  double motion_timeout = 60.0;
  // Paths.
  double standoff = 5.0e-3;
  double retract_height = 50.0e-3;
  double approach_feed = 16.7e-3;
  double jog_feed = 1.0e-3;
  double near_path = 1.0e-3;
  // Sensor calibration.
  double first_jog = 50.0e-6;
  double max_jog = 100.0e-6;
  double least_jog = 5.0e-6;
  double resolution = 1.0e-6;
  double zero_volt = 0.1;
  double check_jog = 10.0e-6;
  double position_std = 0.1e-6;
  double min_gap_share = 0.5;
  double sensor_face = 8.0e-3;
  double sensor_electrode = 2.0e-3;
  double curve_error = 0.15;
  double curve_jog = 100.0e-6;
  double max_approach = 1.0e-3;
  // Hits.
  double force_high = 3000.0;
  double asked_std = 0.0;
  double exponential_time = 0.0;
  int straighten_sensor = 1;
  double averaged_share = 1.0;
  double coil_share = 0.1;
  double axes_turn_std = 0.03;
  int cross_frf = 1;
  // From the struck height to the tip.
  std::string tip_correction = "apart";
  int second_height = 1;
  double read_height = 0.0;
  double height_std = 0.5e-3;
  double stickout_std = 0.5e-3;
  std::string tool_material = "unknown";
  double tool_fluted_length = 0.0;

  HammerParameters() {
    fit_low = 200.0;
    fit_high = 3500.0;
    max_modes = 6;
  }
  void declare(ParameterTable& table);
  /// @throws Error naming the key and the value that is out of range.
  void validate() const;
};

struct MeasureFrfResult {
  FrfCode code = FrfCode::ok;
  std::string message;
  MeasuredFrf frf;
  MeasuredModes modes;
  /// Before the correction to the tip apart for spindle and tool; by eq. 4.44, or without one, as above.
  FrequencyResponse measured_frf;  ///< deviations without the sensitivity's
  ModalModel measured;
  double sensitivity = NOT_A_NUMBER;      ///< [m/V] displacement towards the sensor per volt
  double sensitivity_std = NOT_A_NUMBER;  ///< [m/V]
  double flute_low = NOT_A_NUMBER;        ///< [rad] spindle angle with a flute at the sensor, at the tip
  double flute_high = NOT_A_NUMBER;       ///< [rad] halfway up to the hammer
  double flute_hammer = NOT_A_NUMBER;     ///< [rad] a flute at the hammer (eq. 4.1)
  double flute_sure = NOT_A_NUMBER;       ///< [1] probability that both searches hold their flute, by noise
  int spindle_moves = 0;                  ///< [1] orientations of the spindle
  /// Struck along the direction, read at right angles to it; direction "xy" or "yx". Empty: no second sensor,
  /// or the message says why.
  MeasuredFrf cross;
};

struct Waypoint {
  Axes3 position{{0, 0, 0}};  ///< [m] machine
  double feed = 0.0;          ///< [m/s] 0: rapid
};

/// What the machine is asked to do.
struct Command {
  enum class Kind { orient, jog, move, strike, stop };
  Kind kind = Kind::stop;      ///< stop: give up the motion that is running
  double stamp = 0.0;          ///< [s] of the input that caused it
  double angle = 0.0;          ///< [rad] orient: 0..2 pi
  std::string axis;            ///< jog: x, y or z
  double distance = 0.0;       ///< [m] jog
  double feed = 0.0;           ///< [m/s] jog
  Axes3 from{{0, 0, 0}};       ///< [m] move: machine position from which the path leads
  std::vector<Waypoint> path;  ///< move
  std::string direction;       ///< strike
};

/// NC text of a move, mm and mm/min, one block a waypoint. Incremental: machine positions need no knowledge
/// of the work offset.
std::string moveProgram(const Axes3& from, const std::vector<Waypoint>& path);

struct Feedback {
  std::string stage;
  double progress = 0.0;  ///< [1]
  int hits_done = 0;
};

/// The whole measurement of thesis chapter 4 as one class without a clock: inputs come in stamp order,
/// commands, feedback and the result are drained. Whether a command is done is judged from the streams alone,
/// so that recorded streams answer the same commands in replay: spindle at its angle and at rest, axes at
/// their place with nothing to go, a hit in the record. An abort retracts the tool where the controller's
/// state allows it and says so.
///
/// Sides: the sensor stands where the tool nears it in the direction's positive sense, the hammer above it
/// strikes away from it; so a blow lowers the voltage, and displacement along the blow is -(V - V before) x
/// sensitivity.
class HammerSequence {
 public:
  /// @throws Error when the model lacks the hammer or the tool section, or a parameter is out of range.
  HammerSequence(const HammerParameters& parameters, const MachineModel& model);

  /// @return false when a measurement is running: the goal is refused and nothing changes.
  bool handle(const MeasureFrfGoal& goal);
  void handle(const SampleBlock& block);
  void handle(const CncState& state);
  void handle(const SpindleAngle& angle);
  void cancel(double stamp);
  void commandFailed(double stamp, const std::string& text);
  /// An input stream has died, nothing further can be judged: ends at once, with a last stop and retract sent
  /// blindly.
  void lost(double stamp, const std::string& text);
  /// Forgets everything: a bag was restarted.
  void reset();

  bool active() const { return stage_ != Stage::idle; }

  std::vector<Command> takeCommands();
  std::optional<Feedback> takeFeedback();
  std::optional<MeasureFrfResult> takeResult();

 private:
  enum class Stage {
    idle,
    check,
    orient_start,
    to_station,
    search_low,
    to_height,
    search_high,
    to_tip,
    orient_flute,
    survey,
    trial,
    calibrate,
    calibrate_cross,
    calibrate_again,
    strike,
    to_second,
    orient_second,
    calibrate_second,
    stopping,
    retract
  };
  enum class Wait { nothing, position, angle, average, hit, rest, standstill };

  /// A sensor as its calibration left it.
  struct SensorState {
    double sensitivity = NOT_A_NUMBER, sensitivity_std = NOT_A_NUMBER;  // [m/V]
    double bend_gap = NOT_A_NUMBER, bend_gap_std = NOT_A_NUMBER;        // [m]
    double volt = 0.0;                                                  // [V] at rest
  };

  void start(double now);
  void orient(double now, double angle);
  void jog(double now, const std::string& axis, double distance, double feed);
  void move(double now, const Axes3& from, std::vector<Waypoint> path);
  void strike(double now);
  void average(double from);
  void send(Command command, Wait wait, double timeout);

  FluteSearchOptions searchOptions() const;
  SensorCalibrationOptions calibrationOptions(std::size_t axis) const;
  double safeTravel(std::size_t axis) const;
  double movedFrom(std::size_t axis) const;
  bool surveyDue(double volt);
  void surveyed(double now, double volt);
  void tried(double now, const Hit& hit);
  double turnedFrom(std::size_t axis) const;
  std::size_t calibratedAxis() const;
  void sensorKnown(double now);
  void crossFailed(double now);
  bool tooNear(double volt);
  void moveToStation(double now);
  void reached(double now);
  void measured(double now, double volt, double volt_std);
  void calibrated(double now, double volt, double volt_std);
  void fluteFound(double now);
  void search(double now);
  HitFault judged(const Hit& hit) const;
  void recorded(double now, HitCollector::Record record, std::optional<HitCollector::Record> cross);
  void badHit(double now, const std::string& why, bool bad_data);
  bool enough() const;
  double offsetCorrection() const;
  ImpactOptions impactOptions(const SensorState& sensor) const;
  bool secondHeightDue() const;
  double lowered() const;
  int hitsDue() const;
  void hitsDone(double now);
  void toSecondHeight(double now);
  void withoutSecond(double now, const std::string& why);
  double hitProgress() const;
  FrequencyResponse averaged(const std::vector<Hit>& hits, const SensorState& sensor) const;
  void addScatter(const FrequencyResponse& frf, ModalModel& model) const;
  void addSystematic(FrequencyResponse& frf, ModalModel& model) const;
  ToolBeam toolBeam() const;
  std::vector<OffsetMeasurement> atHeights(const ModalModel& modes) const;
  TipCorrection tipOf(const ModalModel& modes) const;
  bool correctsApart() const;
  void toTip(const FrequencyResponse& frf, const ModalFit& fit);
  void evaluateCross(const std::optional<TipCorrection>& tip);
  void evaluate();

  void abort(double now, FrfCode code, const std::string& why);
  void retract(double now);
  void finish();
  bool late(double now);
  void say(const std::string& stage, double progress);

  bool readPosition(const CncState& state, Axes3& position, double& to_go) const;
  bool safeToMove() const;
  std::string unsafe(const CncState& state) const;
  Axes3 stationPosition() const;
  double safeHeight() const;

  HammerParameters parameters_;
  MachineModel model_;
  HammerStation station_;
  ToolGeometry tool_;
  SensorApproach approach_;  // of the tool at the tip, as the first search saw it

  Stage stage_ = Stage::idle;
  Wait wait_ = Wait::nothing;
  MeasureFrfGoal goal_;
  MeasureFrfResult result_;
  std::optional<CncState> state_;
  int direction_ = 0;  // 0, 1, 2 of x, y, z
  double pitch_ = 0.0;
  double sent_ = 0.0, deadline_ = 0.0;
  double target_angle_ = 0.0, angle_sum_ = 0.0, reached_angle_ = 0.0;
  int rest_count_ = 0;
  Axes3 target_{{0, 0, 0}};
  double target_tolerance_ = 0.0;
  bool at_station_ = false;
  bool retracting_after_abort_ = false;

  double average_from_ = 0.0;
  std::vector<double> average_;
  std::uint64_t average_index_ = 0;
  int bad_averages_ = 0;
  double rest_until_ = 0.0;

  std::optional<FluteSearch> search_;
  double expected_angle_ = 0.0;
  std::vector<double> survey_;  // [rad] still to be read beside the place for the hammer, last first
  bool surveyed_ = false;
  std::optional<double> swing_;  // [m] towards the sensor that a blow may make
  std::optional<SensorCalibration> calibration_;
  SensorState sensor_, cross_sensor_, second_sensor_;
  bool second_ = false;      // at the second height
  std::string no_second_;    // why there is none
  double flank_volt_ = 0.0;  // [V] of the first sensor at the station, a flute at the hammer
  bool has_cross_ = false;
  std::string no_cross_;  // why there is no cross FRF
  int near_samples_ = 0;
  HitCollector collector_, cross_collector_;
  std::vector<Hit> hits_, cross_hits_, second_hits_;
  int bad_hits_ = 0;

  std::vector<Command> commands_;
  std::optional<Feedback> feedback_;
  std::optional<MeasureFrfResult> done_;
};

}  // namespace hammer
}  // namespace smartmill
