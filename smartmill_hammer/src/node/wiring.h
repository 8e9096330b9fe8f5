#pragma once

#include "smartmill_core/names.h"
#include "smartmill_core/signal/feed.h"
#include "smartmill_hammer/analysis/idle_spindle.h"

namespace smartmill {
namespace hammer {

/// The streams of a measurement, from a node's inputs or from a bag.
template <class Source, class Sorted>
void connect(Source& source, Sorted& sorted) {
  feed<SampleBlock>(source, names::HAMMER, sorted);
  feed<CncState>(source, names::CNC_STATE, sorted);
  feed<SpindleAngle>(source, names::SPINDLE_ANGLE, sorted);
}

/// What the spindle shows in air, beside its angle.
template <class Source>
void connectIdle(Source& source, IdleSpindlePipeline& idle) {
  feed<SampleBlock>(source, names::DYNAMOMETER, idle);
  feed<CuttingCondition>(source, names::CUTTING_CONDITION, idle);
  feed<LoadSample>(source, names::CNC_LOAD, idle);
}

}  // namespace hammer
}  // namespace smartmill
