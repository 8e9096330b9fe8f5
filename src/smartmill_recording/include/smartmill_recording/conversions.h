#pragma once

#include <string>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_core/frames.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/signal/inspection_feature.h"
#include "smartmill_core/signal/machine_temperature.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_recording/messages.h"

namespace smartmill {

/// Seconds of a message stamp. A double near 1.8e9 s resolves 0.24 us: the same message gives the same double
/// wherever it is read, and a stamp is stable from the first conversion on.
double toSec(const plain::Time& stamp);

// Both ways without loss, as smartmill_ros/conversions.h for the generated messages of ROS. fromMsg throws
// Error naming the field when the content contradicts itself (sample count, rate, unequal lengths, unknown
// enumerators); NaN samples pass, the estimators decide about them.
SampleBlock fromMsg(const plain::SampleBlock& message);
plain::SampleBlock toPlain(const SampleBlock& block, const std::string& frame_id = "");
SpindleAngle fromMsg(const plain::SpindleAngle& message);
plain::SpindleAngle toPlain(const SpindleAngle& angle);
CncState fromMsg(const plain::CncState& message);
plain::CncState toPlain(const CncState& state);
LoadSample fromMsg(const plain::LoadSample& message);
plain::LoadSample toPlain(const LoadSample& load);
MachineTemperature fromMsg(const plain::MachineTemperature& message);
plain::MachineTemperature toPlain(const MachineTemperature& temperature);
InspectionFeature fromMsg(const plain::InspectionFeature& message);
plain::InspectionFeature toPlain(const InspectionFeature& feature);
CuttingCondition fromMsg(const plain::CuttingCondition& message);
plain::CuttingCondition toPlain(const CuttingCondition& condition);
ForceBlock fromMsg(const plain::ForceBlock& message);
plain::ForceBlock toPlain(const ForceBlock& block, const std::string& frame_id = frames::MACHINE);
MeasuredFrf fromMsg(const plain::Frf& message);
plain::Frf toPlain(const MeasuredFrf& measured);
MeasuredModes fromMsg(const plain::ModalModel& message);
plain::ModalModel toPlain(const MeasuredModes& measured);
CoefficientSet fromMsg(const plain::CuttingCoefficients& message);
plain::CuttingCoefficients toPlain(const CoefficientSet& set);
StabilityPoint fromMsg(const plain::StabilityPoint& message);
plain::StabilityPoint toPlain(const StabilityPoint& point);
StabilityChart fromMsg(const plain::StabilityChart& message);
plain::StabilityChart toPlain(const StabilityChart& chart);
IdentifiedForceCurves fromMsg(const plain::ForceCurve& message);
plain::ForceCurve toPlain(const IdentifiedForceCurves& curves);
/// @param received [s] taken for a missing stamp; only a stamped goal replays to the last digit
MeasureFrfGoal goalFromMsg(const plain::MeasureFrfGoal& message, double received);

/// The message that carries a core type, as PlainOf<SampleBlock>::Type.
template <class Data>
struct PlainOf {};
template <>
struct PlainOf<SampleBlock> {
  using Type = plain::SampleBlock;
};
template <>
struct PlainOf<SpindleAngle> {
  using Type = plain::SpindleAngle;
};
template <>
struct PlainOf<CncState> {
  using Type = plain::CncState;
};
template <>
struct PlainOf<LoadSample> {
  using Type = plain::LoadSample;
};
template <>
struct PlainOf<MachineTemperature> {
  using Type = plain::MachineTemperature;
};
template <>
struct PlainOf<InspectionFeature> {
  using Type = plain::InspectionFeature;
};
template <>
struct PlainOf<CuttingCondition> {
  using Type = plain::CuttingCondition;
};
template <>
struct PlainOf<ForceBlock> {
  using Type = plain::ForceBlock;
};
template <>
struct PlainOf<MeasuredFrf> {
  using Type = plain::Frf;
};
template <>
struct PlainOf<MeasuredModes> {
  using Type = plain::ModalModel;
};
template <>
struct PlainOf<CoefficientSet> {
  using Type = plain::CuttingCoefficients;
};
template <>
struct PlainOf<StabilityChart> {
  using Type = plain::StabilityChart;
};
template <>
struct PlainOf<IdentifiedForceCurves> {
  using Type = plain::ForceCurve;
};

}  // namespace smartmill
