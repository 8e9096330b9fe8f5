#pragma once

#include "node/parameters.h"
#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/feed.h"

namespace smartmill::stability {

/// Connects the streams of the chatter detection, except the cutting condition, from the inputs of a node or
/// from a bag. @param detection a DetectionPipeline or an object with the same push()
template <class Source, class Detection>
void connect(Source& source, const NodeParameters& parameters, Detection& detection) {
  feed<CncState>(source, names::CNC_STATE, detection);
  if (parameters.chatter.angle == "measured") feed<SpindleAngle>(source, names::SPINDLE_ANGLE, detection);
  if (parameters.chatter_signal == "force") {
    feed<ForceBlock>(source, names::FORCE_COMPENSATED, detection);
  } else {
    feed<SampleBlock>(source, names::daq(parameters.chatter_signal), detection);
  }
}

/// Connects the inputs of a chart. @param use called with each input as its core type
template <class Source, class Use>
void connectMeasured(Source& source, Use use) {
  source.template on<MeasuredFrf>(names::TOOL_FRF, [use](const MeasuredFrf& frf, double) { use(frf); });
  source.template on<MeasuredModes>(names::TOOL_MODES,
                                    [use](const MeasuredModes& modes, double) { use(modes); });
  source.template on<CoefficientSet>(names::COEFFICIENTS,
                                     [use](const CoefficientSet& set, double) { use(set); });
  source.template on<IdentifiedForceCurves>(
      names::FORCE_CURVE, [use](const IdentifiedForceCurves& curves, double) { use(curves); });
}

}  // namespace smartmill::stability
