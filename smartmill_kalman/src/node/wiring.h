#pragma once

#include "node/parameters.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/feed.h"
#include "smartmill_kalman/compensation/compensation_pipeline.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibration.h"
#include "smartmill_kalman/sensor/tap_file.h"

namespace smartmill::kalman {

/// The streams beside the sensor's own blocks, from a node's inputs or from a bag.
template <class Source>
void connect(Source& source, CompensationPipeline& sorted) {
  source.template on<SampleBlock>(names::HAMMER,
                                  [&sorted](const SampleBlock& block, double) { sorted.pushHammer(block); });
  feed<SpindleAngle>(source, names::SPINDLE_ANGLE, sorted);
}

/// What the parameters say of the sensor beyond its modes. @throws Error on a bad file.
inline void useFiles(CompensationPipeline& sorted, const NodeParameters& parameters) {
  if (!parameters.sensor_matrix.empty()) sorted.useMatrix(readSensorMatrix(parameters.sensor_matrix));
  if (!parameters.plate_taps.empty()) {
    const TapRecords records = readTapFile(parameters.plate_taps);
    sorted.useTransferMatrix(identifyTransferMatrix(records.taps, records.rate),
                             parameters.compensation.filter.bandwidth);
  }
  sorted.setSpindleSensorLength(parameters.spindle_sensor_length);
  if (!parameters.spindle_sensor.empty()) {
    sorted.useSpindleSensor(readSpindleSensor(parameters.spindle_sensor), parameters.spindle_sensor_length);
  }
}

}  // namespace smartmill::kalman
