#pragma once

#include "node/parameters.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/feed.h"
#include "smartmill_kalman/compensation/compensation_pipeline.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibration.h"
#include "smartmill_kalman/sensor/tap_file.h"

namespace smartmill::kalman {

/// Connects hammer, tachometer and controller, from the inputs of a node or from a recording.
template <class Source>
void connect(Source& source, CompensationPipeline& pipeline) {
  source.template on<SampleBlock>(
      names::HAMMER, [&pipeline](const SampleBlock& block, double) { pipeline.pushHammer(block); });
  feed<SpindleAngle>(source, names::SPINDLE_ANGLE, pipeline);
  feed<CncState>(source, names::CNC_STATE, pipeline);
}

/// Reads the sensor files that the parameters name. @throws Error on an invalid file.
inline void loadSensorFiles(CompensationPipeline& pipeline, const NodeParameters& parameters) {
  pipeline.useKind(parameters.kind());
  if (!parameters.sensor_matrix.empty())
    pipeline.forces().useMatrix(readSensorMatrix(parameters.sensor_matrix));
  if (!parameters.plate_taps.empty()) {
    const TapRecords records = readTapFile(parameters.plate_taps);
    pipeline.useTransferMatrix(identifyTransferMatrix(records.taps, records.rate),
                               parameters.compensation.filter.bandwidth);
  }
  if (!parameters.memory_over_speed.empty())
    pipeline.forces().useMemory(readMemorySchedule(parameters.memory_over_speed));
  pipeline.forces().spindle().setLength(parameters.spindle_sensor_length);
  if (!parameters.spindle_sensor.empty()) {
    pipeline.useSpindleSensor(readSpindleSensor(parameters.spindle_sensor), parameters.spindle_sensor_length);
  }
}

}  // namespace smartmill::kalman
