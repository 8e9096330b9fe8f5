#pragma once

#include "smartmill_core/names.h"
#include "smartmill_core/signal/feed.h"
#include "smartmill_hammer/analysis/idle_spindle.h"

namespace smartmill::hammer {

/// Connects the streams of a measurement, from a node's inputs or from a bag.
template <class Source, class Pipeline>
void connect(Source& source, Pipeline& pipeline) {
  feed<SampleBlock>(source, names::HAMMER, pipeline);
  feed<CncState>(source, names::CNC_STATE, pipeline);
  feed<SpindleAngle>(source, names::SPINDLE_ANGLE, pipeline);
}

/// Connects the streams of air cuts, except the spindle angle.
template <class Source>
void connectIdle(Source& source, IdleSpindlePipeline& idle) {
  feed<SampleBlock>(source, names::DYNAMOMETER, idle);
  feed<CuttingCondition>(source, names::CUTTING_CONDITION, idle);
  feed<LoadSample>(source, names::CNC_LOAD, idle);
}

}  // namespace smartmill::hammer
