#pragma once

#include "smartmill_core/names.h"
#include "smartmill_core/signal/feed.h"
#include "smartmill_discrepancy/live/segment_recorder.h"

namespace smartmill::discrepancy {

/// Connects the streams of a segment, from a node's inputs or from a bag.
template <class Source>
void connect(Source& source, SegmentPipeline& segments) {
  feed<CuttingCondition>(source, names::CUTTING_CONDITION, segments);
  feed<CncState>(source, names::CNC_STATE, segments);
  feed<SpindleAngle>(source, names::SPINDLE_ANGLE, segments);
  if (segments.compared() == ComparedForce::measured) {
    feed<SampleBlock>(source, names::DYNAMOMETER, segments);
  } else {
    feed<ForceBlock>(source, names::FORCE_COMPENSATED, segments);
  }
  feed<LoadSample>(source, names::CNC_LOAD, segments);
}

}  // namespace smartmill::discrepancy
