#pragma once

#include "smartmill_core/names.h"
#include "smartmill_discrepancy/live/stretch_recorder.h"
#include "smartmill_ros/feed.h"

namespace smartmill::discrepancy {

/// The streams of a stretch, from a node's inputs or from a bag.
template <class Source>
void connect(Source& source, SortedStretches& stretches) {
  feed<smartmill_msgs::CuttingCondition>(source, names::CUTTING_CONDITION, stretches);
  feed<smartmill_msgs::CncState>(source, names::CNC_STATE, stretches);
  feed<smartmill_msgs::SpindleAngle>(source, names::SPINDLE_ANGLE, stretches);
  feed<smartmill_msgs::SampleBlock>(source, names::DYNAMOMETER, stretches);
  feed<smartmill_msgs::LoadSample>(source, names::CNC_LOAD, stretches);
}

}  // namespace smartmill::discrepancy
