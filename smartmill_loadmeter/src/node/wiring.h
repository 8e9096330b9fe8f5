#pragma once

#include "node/parameters.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/feed.h"
#include "smartmill_loadmeter/identification/curve_finder.h"
#include "smartmill_loadmeter/identification/identification_pipeline.h"

namespace smartmill::loadmeter {

/// What comes in, to both that think: coefficients, and force curves where they are asked for.
struct CutStreams {
  IdentificationPipeline& identification;
  ForceCurvePipeline& curves;
  const NodeParameters& parameters;

  template <class Data>
  void push(const Data& data) {
    identification.push(data);
  }
  void push(const CncState& state) { both(state); }
  void push(const CuttingCondition& condition) { both(condition); }
  void push(const SpindleAngle& angle) { curves.push(angle); }
  void push(const ForceBlock& block) {
    if (parameters.force_sensor) identification.push(block);
    if (parameters.force_curve) curves.push(block);
  }

 private:
  template <class Data>
  void both(const Data& data) {
    identification.push(data);
    if (parameters.force_curve) curves.push(data);
  }
};

/// The streams of an identification, from a node's inputs or from a bag.
/// @param sorted a IdentificationPipeline, or what stands before it
template <class Source, class Sorted>
void connect(Source& source, const NodeParameters& parameters, Sorted& sorted) {
  feed<CncState>(source, names::CNC_STATE, sorted);
  feed<LoadSample>(source, names::CNC_LOAD, sorted);
  feed<CuttingCondition>(source, names::CUTTING_CONDITION, sorted);
  if (parameters.readsMotors())
    feed<SampleBlock>(source, parameters.motor_servo ? names::daq("servo") : names::MOTOR_CURRENT, sorted);
  if (parameters.force_sensor) feed<ForceBlock>(source, names::FORCE_COMPENSATED, sorted);
}

/// What force curves need besides.
template <class Source>
void connectCurves(Source& source, const NodeParameters& parameters, CutStreams& streams) {
  if (!parameters.force_curve) return;
  feed<SpindleAngle>(source, names::SPINDLE_ANGLE, streams);
  if (!parameters.force_sensor) feed<ForceBlock>(source, names::FORCE_COMPENSATED, streams);
}

/// The streams of force curves alone.
template <class Source>
void connectCurves(Source& source, ForceCurvePipeline& curves) {
  feed<CncState>(source, names::CNC_STATE, curves);
  feed<SpindleAngle>(source, names::SPINDLE_ANGLE, curves);
  feed<CuttingCondition>(source, names::CUTTING_CONDITION, curves);
  feed<ForceBlock>(source, names::FORCE_COMPENSATED, curves);
}

}  // namespace smartmill::loadmeter
