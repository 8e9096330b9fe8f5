#pragma once

#include "node/parameters.h"
#include "smartmill_core/names.h"
#include "smartmill_loadmeter/identification/sorted_identification.h"
#include "smartmill_ros/feed.h"

namespace smartmill::loadmeter {

/// The streams of an identification, from a node's inputs or from a bag.
template <class Source>
void connect(Source& source, const NodeParameters& parameters, SortedIdentification& identification) {
  feed<smartmill_msgs::CncState>(source, names::CNC_STATE, identification);
  feed<smartmill_msgs::LoadSample>(source, names::CNC_LOAD, identification);
  feed<smartmill_msgs::CuttingCondition>(source, names::CUTTING_CONDITION, identification);
  if (!parameters.motor_calibration.empty())
    feed<smartmill_msgs::SampleBlock>(source, names::MOTOR_CURRENT, identification);
  if (parameters.force_sensor)
    feed<smartmill_msgs::ForceBlock>(source, names::FORCE_COMPENSATED, identification);
}

}  // namespace smartmill::loadmeter
