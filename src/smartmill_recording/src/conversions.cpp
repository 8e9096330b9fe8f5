#include "smartmill_recording/conversions.h"

#include "smartmill_recording/conversion_templates.h"

namespace smartmill {

double toSec(const plain::Time& stamp) {
  return conversion::secondsOf(stamp);
}

SampleBlock fromMsg(const plain::SampleBlock& message) {
  return conversion::from<SampleBlock>(message);
}
plain::SampleBlock toPlain(const SampleBlock& data, const std::string& frame_id) {
  return conversion::to<plain::SampleBlock>(data, frame_id);
}
SpindleAngle fromMsg(const plain::SpindleAngle& message) {
  return conversion::from<SpindleAngle>(message);
}
plain::SpindleAngle toPlain(const SpindleAngle& data) {
  return conversion::to<plain::SpindleAngle>(data);
}
CncState fromMsg(const plain::CncState& message) {
  return conversion::from<CncState>(message);
}
plain::CncState toPlain(const CncState& data) {
  return conversion::to<plain::CncState>(data);
}
LoadSample fromMsg(const plain::LoadSample& message) {
  return conversion::from<LoadSample>(message);
}
plain::LoadSample toPlain(const LoadSample& data) {
  return conversion::to<plain::LoadSample>(data);
}
MachineTemperature fromMsg(const plain::MachineTemperature& message) {
  return conversion::from<MachineTemperature>(message);
}
plain::MachineTemperature toPlain(const MachineTemperature& data) {
  return conversion::to<plain::MachineTemperature>(data);
}
InspectionFeature fromMsg(const plain::InspectionFeature& message) {
  return conversion::from<InspectionFeature>(message);
}
plain::InspectionFeature toPlain(const InspectionFeature& data) {
  return conversion::to<plain::InspectionFeature>(data);
}
CuttingCondition fromMsg(const plain::CuttingCondition& message) {
  return conversion::from<CuttingCondition>(message);
}
plain::CuttingCondition toPlain(const CuttingCondition& data) {
  return conversion::to<plain::CuttingCondition>(data);
}
ForceBlock fromMsg(const plain::ForceBlock& message) {
  return conversion::from<ForceBlock>(message);
}
plain::ForceBlock toPlain(const ForceBlock& data, const std::string& frame_id) {
  return conversion::to<plain::ForceBlock>(data, frame_id);
}
MeasuredFrf fromMsg(const plain::Frf& message) {
  return conversion::from<MeasuredFrf>(message);
}
plain::Frf toPlain(const MeasuredFrf& data) {
  return conversion::to<plain::Frf>(data);
}
MeasuredModes fromMsg(const plain::ModalModel& message) {
  return conversion::from<MeasuredModes>(message);
}
plain::ModalModel toPlain(const MeasuredModes& data) {
  return conversion::to<plain::ModalModel>(data);
}
CoefficientSet fromMsg(const plain::CuttingCoefficients& message) {
  return conversion::from<CoefficientSet>(message);
}
plain::CuttingCoefficients toPlain(const CoefficientSet& data) {
  return conversion::to<plain::CuttingCoefficients>(data);
}
StabilityPoint fromMsg(const plain::StabilityPoint& message) {
  return conversion::from<StabilityPoint>(message);
}
plain::StabilityPoint toPlain(const StabilityPoint& data) {
  return conversion::to<plain::StabilityPoint>(data);
}
StabilityChart fromMsg(const plain::StabilityChart& message) {
  return conversion::from<StabilityChart>(message);
}
plain::StabilityChart toPlain(const StabilityChart& data) {
  return conversion::to<plain::StabilityChart>(data);
}
IdentifiedForceCurves fromMsg(const plain::ForceCurve& message) {
  return conversion::from<IdentifiedForceCurves>(message);
}
plain::ForceCurve toPlain(const IdentifiedForceCurves& data) {
  return conversion::to<plain::ForceCurve>(data);
}
MeasureFrfGoal goalFromMsg(const plain::MeasureFrfGoal& message, double received) {
  MeasureFrfGoal goal;
  conversion::read(message, received, goal);
  return goal;
}

}  // namespace smartmill
