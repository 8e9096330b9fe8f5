#pragma once

#include "smartmill_core/names.h"
#include "smartmill_core/signal/feed.h"
#include "smartmill_discrepancy/live/stretch_recorder.h"

namespace smartmill::discrepancy {

/// The streams of a stretch, from a node's inputs or from a bag.
template <class Source>
void connect(Source& source, SegmentPipeline& stretches) {
  feed<CuttingCondition>(source, names::CUTTING_CONDITION, stretches);
  feed<CncState>(source, names::CNC_STATE, stretches);
  feed<SpindleAngle>(source, names::SPINDLE_ANGLE, stretches);
  feed<SampleBlock>(source, names::DYNAMOMETER, stretches);
  feed<LoadSample>(source, names::CNC_LOAD, stretches);
}

}  // namespace smartmill::discrepancy
