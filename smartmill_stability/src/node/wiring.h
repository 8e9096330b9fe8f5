#pragma once

#include "node/parameters.h"
#include "smartmill_core/names.h"
#include "smartmill_ros/feed.h"
#include "smartmill_ros/force_curve_message.h"

namespace smartmill::stability {

/// The streams beside the cutting condition in which chatter shows, from a node's inputs or from a bag.
/// @param detection a SortedDetection, or what stands before it
template <class Source, class Detection>
void connect(Source& source, const NodeParameters& parameters, Detection& detection) {
  feed<smartmill_msgs::CncState>(source, names::CNC_STATE, detection);
  feed<smartmill_msgs::SpindleAngle>(source, names::SPINDLE_ANGLE, detection);
  if (parameters.chatter_signal == "force") {
    feed<smartmill_msgs::ForceBlock>(source, names::FORCE_COMPENSATED, detection);
  } else {
    feed<smartmill_msgs::SampleBlock>(source, names::daq(parameters.chatter_signal), detection);
  }
}

/// What a chart is made of. @param use gets it as its core type
template <class Source, class Use>
void connectMeasured(Source& source, Use use) {
  const auto on = [&](const char* topic, auto message) {
    using Message = decltype(message);
    source.template on<Message>(topic, [use](const Message& m, double) { use(fromMsg(m)); });
  };
  on(names::TOOL_FRF, smartmill_msgs::Frf());
  on(names::TOOL_MODES, smartmill_msgs::ModalModel());
  on(names::COEFFICIENTS, smartmill_msgs::CuttingCoefficients());
  on(names::FORCE_CURVE, smartmill_msgs::ForceCurve());
}

}  // namespace smartmill::stability
