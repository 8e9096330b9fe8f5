#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_loadmeter/identification/load_test.h"
#include "smartmill_loadmeter/motor/drive_moves.h"
#include "smartmill_loadmeter/motor/force_estimate.h"
#include "smartmill_loadmeter/motor/motor_chain.h"
#include "smartmill_loadmeter/motor/self_calibration.h"

namespace smartmill::loadmeter {

/// Mean force of a cut.
struct MeanForce {
  std::array<std::optional<Estimate>, 3> axis;  ///< [N] X, Y, Z on the tool, without the error of the gain
  double gain_error = 0.0;                      ///< [1] standard deviation, common to all cuts
  bool any() const { return axis[0] || axis[1] || axis[2]; }
};

/// Force of each cut: by calibrated motors, and by all measurements together.
class CutForces {
 public:
  CutForces(const MotorParameters& motor, const ForceEstimateParameters& force,
            const std::optional<MachineAxes>& axes);

  /// Uses motor currents, from the next test on.
  void setMotors(const MotorCalibration& calibration) { motors_ = calibration; }
  /// Uses motor currents, calibrated by the session's own air moves and cuts (SelfCalibration).
  void enableSelfCalibration() { self_calibration_.emplace(motor_parameters_); }
  bool usesMotors() const { return motors_ || self_calibration_; }

  void handle(const CncState& state) { moves_.handle(state); }
  void handle(const SampleBlock& block);

  /// Adds motor currents and, in a cut with calibrated motors, its force. @param velocity [m/s] of the tool.
  /// @param is_short the record is a window of a cut.
  void addMotors(const MotorRecord& record, const std::array<double, 3>& velocity, bool is_short,
                 const std::vector<LoadTest>& air_cuts, LoadTest* test) const;
  /// Force by all measurements of a cut; a sensor's zero and noise are those of the last air cut. Empty
  /// without a measurement. @param torque [N m] of the cut by the load meter; empty: friction is unknown.
  std::optional<ForceEstimate> estimate(const LoadTest& cut, const std::optional<Estimate>& torque,
                                        const std::vector<LoadTest>& air_cuts,
                                        bool without_motors = false) const;
  /// [N] Mean force of a straight cut in the machine's axes, by a force sensor or else by calibrated motors;
  /// empty where nothing measures it.
  MeanForce meanForce(const LoadTest& cut, const std::vector<LoadTest>& air_cuts) const;
  /// Adds a test to the self-calibration, if enabled.
  void calibrate(const LoadTest& test, const std::optional<Estimate>& torque,
                 const std::vector<LoadTest>& air_cuts);

  /// Bandwidth [Hz] of a feed drive's lag from the rapid moves so far.
  const std::optional<Estimate>& driveBandwidth(std::size_t axis) const { return moves_.bandwidth(axis); }
  /// Calibration from the session itself; empty: not enabled, or too few cuts.
  std::optional<MotorCalibration> selfCalibration() const;
  std::string calibrationText() const;  ///< for messages; empty without motors

  void clearCalibration();
  void clear();

 private:
  MotorParameters motor_parameters_;
  ForceEstimateParameters force_parameters_;
  std::optional<MotorCalibration> motors_;
  std::optional<SelfCalibration> self_calibration_;
  DriveMoves moves_;
};

}  // namespace smartmill::loadmeter
