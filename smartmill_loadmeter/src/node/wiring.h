#pragma once

#include "node/parameters.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/feed.h"
#include "smartmill_loadmeter/identification/force_curve_identification.h"
#include "smartmill_loadmeter/identification/identification_pipeline.h"

namespace smartmill::loadmeter {

/// Distributes the inputs to the identification of coefficients and, if enabled, of force curves.
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

/// Motor currents as the parameters require. @throws Error when the calibration cannot be read.
inline void useMotors(const NodeParameters& parameters, CutForces& forces) {
  if (parameters.motor_learn) forces.enableSelfCalibration();
  if (!parameters.motor_calibration.empty())
    forces.setMotors(readMotorCalibration(parameters.motor_calibration));
}

/// Connects the streams of the identification to a node's inputs or a bag.
/// @param pipeline an IdentificationPipeline, or CutStreams
template <class Source, class Pipeline>
void connect(Source& source, const NodeParameters& parameters, Pipeline& pipeline) {
  feed<CncState>(source, names::CNC_STATE, pipeline);
  feed<LoadSample>(source, names::CNC_LOAD, pipeline);
  feed<MachineTemperature>(source, names::MACHINE_TEMPERATURE, pipeline);
  feed<CuttingCondition>(source, names::CUTTING_CONDITION, pipeline);
  if (parameters.usesMotors())
    feed<SampleBlock>(source, parameters.motor_servo ? names::SERVO_RECORD : names::MOTOR_CURRENT, pipeline);
  if (parameters.force_sensor) feed<ForceBlock>(source, names::FORCE_COMPENSATED, pipeline);
}

/// Connects the measured dimensions of parts. One without a stamp has the time of its reception.
template <class Source, class Pipeline>
void connectInspection(Source& source, Pipeline& pipeline) {
  source.template on<InspectionFeature>(names::INSPECTION_FEATURE,
                                        [&pipeline](InspectionFeature feature, double received) {
                                          if (feature.stamp == 0.0) feature.stamp = received;
                                          pipeline.push(feature);
                                        });
}

/// Connects the additional streams of force curves.
template <class Source>
void connectCurves(Source& source, const NodeParameters& parameters, CutStreams& streams) {
  if (!parameters.force_curve) return;
  feed<SpindleAngle>(source, names::SPINDLE_ANGLE, streams);
  if (!parameters.force_sensor) feed<ForceBlock>(source, names::FORCE_COMPENSATED, streams);
}

/// Connects the streams of force curves without the identification.
template <class Source>
void connectCurves(Source& source, ForceCurvePipeline& curves) {
  feed<CncState>(source, names::CNC_STATE, curves);
  feed<SpindleAngle>(source, names::SPINDLE_ANGLE, curves);
  feed<CuttingCondition>(source, names::CUTTING_CONDITION, curves);
  feed<ForceBlock>(source, names::FORCE_COMPENSATED, curves);
}

}  // namespace smartmill::loadmeter
