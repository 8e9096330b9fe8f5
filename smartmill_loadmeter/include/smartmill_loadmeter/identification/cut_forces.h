#pragma once

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
