#include "smartmill_ros/conversions.h"

#include "smartmill_recording/conversion_templates.h"

namespace smartmill {

double toSec(const ros::Time& stamp) {
  return stamp.toSec();
}

ros::Time fromSec(double stamp) {
  return conversion::timeOf<ros::Time>(stamp);
}

SampleBlock fromMsg(const smartmill_msgs::SampleBlock& message) {
  return conversion::from<SampleBlock>(message);
}
smartmill_msgs::SampleBlock toMsg(const SampleBlock& data, const std::string& frame_id) {
  return conversion::to<smartmill_msgs::SampleBlock>(data, frame_id);
}
SpindleAngle fromMsg(const smartmill_msgs::SpindleAngle& message) {
  return conversion::from<SpindleAngle>(message);
}
smartmill_msgs::SpindleAngle toMsg(const SpindleAngle& data) {
  return conversion::to<smartmill_msgs::SpindleAngle>(data);
}
CncState fromMsg(const smartmill_msgs::CncState& message) {
  return conversion::from<CncState>(message);
}
smartmill_msgs::CncState toMsg(const CncState& data) {
  return conversion::to<smartmill_msgs::CncState>(data);
}
LoadSample fromMsg(const smartmill_msgs::LoadSample& message) {
  return conversion::from<LoadSample>(message);
}
smartmill_msgs::LoadSample toMsg(const LoadSample& data) {
  return conversion::to<smartmill_msgs::LoadSample>(data);
}
MachineTemperature fromMsg(const smartmill_msgs::MachineTemperature& message) {
  return conversion::from<MachineTemperature>(message);
}
smartmill_msgs::MachineTemperature toMsg(const MachineTemperature& data) {
  return conversion::to<smartmill_msgs::MachineTemperature>(data);
}
InspectionFeature fromMsg(const smartmill_msgs::InspectionFeature& message) {
  return conversion::from<InspectionFeature>(message);
}
smartmill_msgs::InspectionFeature toMsg(const InspectionFeature& data) {
  return conversion::to<smartmill_msgs::InspectionFeature>(data);
}
CuttingCondition fromMsg(const smartmill_msgs::CuttingCondition& message) {
  return conversion::from<CuttingCondition>(message);
}
smartmill_msgs::CuttingCondition toMsg(const CuttingCondition& data) {
  return conversion::to<smartmill_msgs::CuttingCondition>(data);
}
ForceBlock fromMsg(const smartmill_msgs::ForceBlock& message) {
  return conversion::from<ForceBlock>(message);
}
smartmill_msgs::ForceBlock toMsg(const ForceBlock& data, const std::string& frame_id) {
  return conversion::to<smartmill_msgs::ForceBlock>(data, frame_id);
}
MeasuredFrf fromMsg(const smartmill_msgs::Frf& message) {
  return conversion::from<MeasuredFrf>(message);
}
smartmill_msgs::Frf toMsg(const MeasuredFrf& data) {
  return conversion::to<smartmill_msgs::Frf>(data);
}
MeasuredModes fromMsg(const smartmill_msgs::ModalModel& message) {
  return conversion::from<MeasuredModes>(message);
}
smartmill_msgs::ModalModel toMsg(const MeasuredModes& data) {
  return conversion::to<smartmill_msgs::ModalModel>(data);
}
CoefficientSet fromMsg(const smartmill_msgs::CuttingCoefficients& message) {
  return conversion::from<CoefficientSet>(message);
}
smartmill_msgs::CuttingCoefficients toMsg(const CoefficientSet& data) {
  return conversion::to<smartmill_msgs::CuttingCoefficients>(data);
}
StabilityPoint fromMsg(const smartmill_msgs::StabilityPoint& message) {
  return conversion::from<StabilityPoint>(message);
}
smartmill_msgs::StabilityPoint toMsg(const StabilityPoint& data) {
  return conversion::to<smartmill_msgs::StabilityPoint>(data);
}
StabilityChart fromMsg(const smartmill_msgs::StabilityChart& message) {
  return conversion::from<StabilityChart>(message);
}
smartmill_msgs::StabilityChart toMsg(const StabilityChart& data) {
  return conversion::to<smartmill_msgs::StabilityChart>(data);
}
IdentifiedForceCurves fromMsg(const smartmill_msgs::ForceCurve& message) {
  return conversion::from<IdentifiedForceCurves>(message);
}
smartmill_msgs::ForceCurve toMsg(const IdentifiedForceCurves& data) {
  return conversion::to<smartmill_msgs::ForceCurve>(data);
}

}  // namespace smartmill
