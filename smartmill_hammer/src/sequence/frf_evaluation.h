#pragma once

#include <optional>
#include <vector>

#include "measurement.h"
#include "smartmill_core/modal/impact_analysis.h"
#include "smartmill_hammer/analysis/tip_correction.h"

namespace smartmill::hammer {

/// FRF and modes of the hits of a measurement, and both at the tip.
class FrfEvaluation {
 public:
  explicit FrfEvaluation(Measurement& measurement);

  /// Whether the hits at the present height reach the standard deviation `asked_std`, three hits at least.
  bool isPreciseEnough() const;
  /// Fills the measurement's result.
  void evaluate();

 private:
  double offsetCorrection() const;
  ImpactOptions impactOptions(const SensorState& sensor) const;
  FrequencyResponse averageOf(const std::vector<Hit>& hits, const SensorState& sensor) const;
  void addScatter(const FrequencyResponse& frf, ModalModel& model) const;
  void addCrossAxisError(ModalModel& model) const;
  void addCurveError(FrequencyResponse& frf, ModalModel& model) const;
  ToolBeam toolBeam() const;
  std::vector<OffsetMeasurement> offsetMeasurements(const ModalModel& modes) const;
  TipCorrection tipCorrection(const ModalModel& modes) const;
  void correctToTip(const FrequencyResponse& frf, const ModalModel& modes);
  void useHalfCorrection(const FrequencyResponse& frf);
  void evaluateCross(const std::optional<TipCorrection>& tip);
  void fit();

  Measurement& measurement_;
  const HammerParameters& parameters_;
  const MeasureFrfGoal& goal_;
  MeasureFrfResult& result_;
};

}  // namespace smartmill::hammer
