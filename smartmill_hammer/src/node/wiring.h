#pragma once

#include "smartmill_core/names.h"
#include "smartmill_hammer/sequence/sorted_sequence.h"
#include "smartmill_ros/feed.h"

namespace smartmill {
namespace hammer {

/// The streams of a measurement, from a node's inputs or from a bag.
template <class Source>
void connect(Source& source, SortedSequence& sorted) {
  feed<smartmill_msgs::SampleBlock>(source, names::HAMMER, sorted);
  feed<smartmill_msgs::CncState>(source, names::CNC_STATE, sorted);
  feed<smartmill_msgs::SpindleAngle>(source, names::SPINDLE_ANGLE, sorted);
}

}  // namespace hammer
}  // namespace smartmill
