#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/modal/hit_test_parameters.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/signal/hit_collector.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/sensor/tap_pairs.h"

namespace smartmill::kalman {

/// Taps on the workpiece that identify the force sensor.
struct TapParameters : HitTestParameters {
  double response_range = 0.0;  ///< [N] a sample of the sensor at or beyond it is clipped; 0: unknown
  double static_tolerance = 0.25;
  double systematic = 0.002;

  TapParameters() {
    record_length = 0.2;
    strike_timeout = 10.0;  // long enough for a hit by hand
  }
  void declare(ParameterTable& table) {
    declareHits(table);
    table.internal("response_range", response_range, "N", Range::notNegative());
    table.number("static_tolerance", static_tolerance, "1", Range::positive(),
                 "accepted difference of the measured static gain from 1");
    table.number("systematic", systematic, "1", Range::openHigh(0.0, 1.0),
                 "systematic relative error of |H| (linearity, aliasing), part of each standard deviation");
    declareFit(table);
  }
  /// @throws Error naming key and value.
  void validate() const;
};

struct SensorResult {
  FrfCode code = FrfCode::ok;
  std::string message;             ///< one line
  MeasuredFrf frf;                 ///< [1] measured over applied force, static gain positive
  MeasuredModes modes;             ///< [1] static gain 1
  double noise_rms = 0.0;          ///< [N] of one sample of the sensor, from the samples before the hits
  double static_gain = 0.0;        ///< [1] measured; the fit assumes 1; negative: hit against the axis
  double static_gain_std = 0.0;    ///< [1]
  std::vector<double> hit_stamps;  ///< [s] triggers of the accepted hits
};

struct TapFeedback {
  std::string stage;
  double progress = 0.0;  ///< [1] 0..1
  int hits_done = 0;
};

struct StrikeCommand {
  double stamp = 0.0;     ///< [s] of the input that caused it
  std::string direction;  ///< x, y or z
};

/// Sequence of a tap test of the force sensor: requests a hit, detects it in the hammer's samples, pairs them
/// with the sensor's samples (TapPairs), averages, and fits modes with static gain 1 (Dunwoody
/// ch. 5). No machine motion.
///
/// Inputs come in stamp order, and time is that of the inputs. Directions are the sensor's axes. A hit may
/// come from either side: the sign of the response is chosen for a positive static gain.
class SensorMeasurement {
 public:
  explicit SensorMeasurement(const TapParameters& parameters);

  /// @return false when a measurement is running: the goal is refused and nothing changes.
  bool handle(const MeasureFrfGoal& goal);
  /// Block of the hammer (channel hammer [N]). @throws Error when the channel is missing.
  void handleHammer(const SampleBlock& block);
  /// Block of the force sensor (channels fx, fy, fz [N]). @throws Error when the channel is missing.
  void handleSensor(const SampleBlock& block);
  /// Ends a running measurement: cancelled, a command failed, an input stream has ended.
  void end(FrfCode code, const std::string& message);
  /// There is no automatic hammer: feedback requests a hit by hand.
  void hitByHand();
  /// As new: a recording was restarted.
  void reset();

  bool active() const { return active_; }

  std::optional<StrikeCommand> takeCommand();
  std::optional<TapFeedback> takeFeedback();
  std::optional<SensorResult> takeResult();

 private:
  void handlePairs();
  void addSample(double time, std::uint64_t index, double rate, double force, double response);
  void requestHit(double now);
  void handleRecord(double now, HitCollector::Record record);
  void rejectHit(double now, const std::string& why, bool bad_data);
  void finish(FrfCode code, const std::string& message);
  void reportStage(const std::string& stage);

  TapParameters parameters_;
  bool active_ = false;
  MeasureFrfGoal goal_;
  HitCollector collector_;
  TapPairs pairs_;
  bool waiting_for_hit_ = false;
  double deadline_ = 0.0, rest_until_ = 0.0;  // [s]
  std::vector<Hit> hits_;
  int bad_hits_ = 0;
  SensorResult result_;

  std::optional<StrikeCommand> command_;
  std::optional<TapFeedback> feedback_;
  std::optional<SensorResult> finished_;
};

}  // namespace smartmill::kalman
