#pragma once

#include <type_traits>
#include <utility>

#include <ros/time.h>

#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/CuttingCoefficients.h>
#include <smartmill_msgs/CuttingCondition.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/ForceCurve.h>
#include <smartmill_msgs/Frf.h>
#include <smartmill_msgs/InspectionFeature.h>
#include <smartmill_msgs/LoadSample.h>
#include <smartmill_msgs/MachineTemperature.h>
#include <smartmill_msgs/ModalModel.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>
#include <smartmill_msgs/StabilityChart.h>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/signal/inspection_feature.h"
#include "smartmill_core/signal/machine_temperature.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill {

/// Seconds of a message stamp. The resolution of a double near 1.8e9 s is 0.24 us; fromSec(toSec(t)) does not
/// change after the first conversion.
double toSec(const ros::Time& stamp);
/// Nearest nanosecond. @throws Error if not finite or negative.
ros::Time fromSec(double stamp);

// Lossless in both directions. fromMsg throws Error naming the field if the content is inconsistent (sample
// count, rate, unequal lengths, unknown enumerators); NaN samples are passed on to the estimators.
SampleBlock fromMsg(const smartmill_msgs::SampleBlock& message);
smartmill_msgs::SampleBlock toMsg(const SampleBlock& block, const std::string& frame_id = "");
SpindleAngle fromMsg(const smartmill_msgs::SpindleAngle& message);
smartmill_msgs::SpindleAngle toMsg(const SpindleAngle& angle);
CncState fromMsg(const smartmill_msgs::CncState& message);
smartmill_msgs::CncState toMsg(const CncState& state);
LoadSample fromMsg(const smartmill_msgs::LoadSample& message);
smartmill_msgs::LoadSample toMsg(const LoadSample& load);
MachineTemperature fromMsg(const smartmill_msgs::MachineTemperature& message);
smartmill_msgs::MachineTemperature toMsg(const MachineTemperature& temperature);
InspectionFeature fromMsg(const smartmill_msgs::InspectionFeature& message);
smartmill_msgs::InspectionFeature toMsg(const InspectionFeature& feature);
CuttingCondition fromMsg(const smartmill_msgs::CuttingCondition& message);
smartmill_msgs::CuttingCondition toMsg(const CuttingCondition& condition);
ForceBlock fromMsg(const smartmill_msgs::ForceBlock& message);
smartmill_msgs::ForceBlock toMsg(const ForceBlock& block, const std::string& frame_id);
MeasuredFrf fromMsg(const smartmill_msgs::Frf& message);
smartmill_msgs::Frf toMsg(const MeasuredFrf& measured);
MeasuredModes fromMsg(const smartmill_msgs::ModalModel& message);
smartmill_msgs::ModalModel toMsg(const MeasuredModes& measured);
CoefficientSet fromMsg(const smartmill_msgs::CuttingCoefficients& message);
smartmill_msgs::CuttingCoefficients toMsg(const CoefficientSet& set);
StabilityPoint fromMsg(const smartmill_msgs::StabilityPoint& message);
smartmill_msgs::StabilityPoint toMsg(const StabilityPoint& point);
StabilityChart fromMsg(const smartmill_msgs::StabilityChart& message);
smartmill_msgs::StabilityChart toMsg(const StabilityChart& chart);
IdentifiedForceCurves fromMsg(const smartmill_msgs::ForceCurve& message);
smartmill_msgs::ForceCurve toMsg(const IdentifiedForceCurves& curves);

/// A block with the frame of its sensor.
struct FramedBlock {
  std::string frame;  ///< empty: not stated
  SampleBlock block;
};

/// Message type of a core type, which toMsg() returns: MessageOf<SampleBlock>::Type; of a message the message
/// itself.
template <class Data, class = void>
struct MessageOf {
  using Type = Data;
};
template <class Data>
struct MessageOf<Data, std::void_t<decltype(toMsg(std::declval<const Data&>()))>> {
  using Type = decltype(toMsg(std::declval<const Data&>()));
};
template <>
struct MessageOf<ForceBlock> {  // whose message requires a frame
  using Type = smartmill_msgs::ForceBlock;
};
template <>
struct MessageOf<FramedBlock> {
  using Type = smartmill_msgs::SampleBlock;
};

/// @throws Error as fromMsg().
template <class Data>
Data dataOf(const typename MessageOf<Data>::Type& message) {
  if constexpr (std::is_same_v<Data, FramedBlock>) {
    return {message.header.frame_id, fromMsg(message)};
  } else if constexpr (std::is_same_v<Data, typename MessageOf<Data>::Type>) {
    return message;
  } else {
    return fromMsg(message);
  }
}

}  // namespace smartmill
