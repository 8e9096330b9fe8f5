#include "recordings/axis_moves.h"

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::loadmeter {

std::size_t readAxisMoves(const std::string& recording, AxisDriveRecorder& recorder,
                          const std::function<void(double)>& progress) {
  RecordingReader reader(recording);
  if (!reader.has(names::SERVO_RECORD))
    throw Error(recording + ": no topic " + names::absolute(names::SERVO_RECORD) +
                ", expected a record of Servo Guide");
  // Messages are handled in the order of their reception; a condition precedes its motion by more than that.
  reader.on<CuttingCondition>(names::CUTTING_CONDITION,
                              [&](const CuttingCondition& condition, double) { recorder.handle(condition); });
  reader.on<SampleBlock>(names::SERVO_RECORD,
                         [&](const SampleBlock& block, double) { recorder.handle(block); });
  reader.run(progress);
  return recorder.moves();
}

}  // namespace smartmill::loadmeter
