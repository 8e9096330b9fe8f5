#include "recordings/bag_replay.h"

#include <cstdio>

#include "node/wiring.h"
#include "smartmill_hammer/sequence/hammer_pipeline.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::hammer {

std::vector<MeasureFrfResult> replayBag(const std::string& bag, const std::string& model,
                                        const NodeParameters& parameters) {
  std::vector<MeasureFrfResult> results;
  // The recorded streams answer the commands.
  HammerPipeline pipeline(
      parameters.measurement, readMachineModel(model), parameters.hold_back,
      {{},
       [](const Feedback& feedback) { std::fprintf(stderr, "%s\n", feedback.stage.c_str()); },
       [&results](const MeasureFrfResult& result) { results.push_back(result); },
       {}});
  RecordingReader reader(bag);
  connect(reader, pipeline);
  reader.on<plain::MeasureFrfActionGoal>(names::goals(names::MEASURE_TOOL_FRF),
                                         [&pipeline](const plain::MeasureFrfActionGoal& m, double received) {
                                           pipeline.push(goalFromMsg(m.goal, received));
                                         });
  reader.run();
  pipeline.flush();
  return results;
}

}  // namespace smartmill::hammer
