#include "recordings/bag_identification.h"

#include <map>
#include <utility>

#include "node/wiring.h"
#include "smartmill_core/error.h"
#include "smartmill_loadmeter/identification/identification_pipeline.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::loadmeter {

std::vector<IdentifyResult> identifyFromBag(const std::string& path, const MachineModel& model,
                                            const NodeParameters& parameters, const BagListeners& listeners) {
  IdentificationPipeline identification(model, parameters.identification, parameters.hold_back);
  useMotors(parameters, identification.identification().forces());
  std::vector<IdentifyResult> results;
  IdentificationOutputs& outputs = identification.identification().outputs();
  if (parameters.usesMotors()) outputs.motor_force = listeners.motors;
  outputs.force = listeners.force;
  outputs.cut = listeners.cut;
  outputs.inspected = listeners.inspected;
  outputs.result = [&](const IdentifyResult& result) {
    if (!result.reset) results.push_back(result);
  };
  RecordingReader bag(path);
  if (!bag.has(names::CNC_LOAD)) throw Error(path + ": expected topic " + names::CNC_LOAD);
  connect(bag, parameters, identification);
  connectInspection(bag, identification);
  PriorKnowledge prior;
  bag.on<plain::CoefficientPrior>(names::COEFFICIENT_PRIOR, [&](const plain::CoefficientPrior& m, double) {
    prior.set(toSec(m.header.stamp), fromMsg(m.coefficients), m.ktc_kte_covariance);
  });
  bag.on<plain::IdentifyCoefficientsActionGoal>(
      names::goals(names::IDENTIFY_COEFFICIENTS),
      [&](const plain::IdentifyCoefficientsActionGoal& m, double) {
        const double stamped = toSec(m.goal.header.stamp);
        const double stamp = stamped == 0.0 ? toSec(m.goal_id.stamp) : stamped;
        IdentifyGoal goal{stamp, m.goal.tool, m.goal.material, m.goal.reset != 0, 0};
        prior.use(&goal);
        identification.push(goal);
      });
  bag.run(listeners.progress);
  identification.flush();
  if (results.empty()) {
    identification.push(IdentifyGoal{identification.newest(), "", "", false, 0});
    identification.flush();
  }
  return results;
}

ServoLoad servoLoadFromBag(const std::string& path, const std::function<void(double)>& progress) {
  RecordingReader bag(path);
  const std::string topic = names::SERVO_RECORD;
  if (!bag.has(topic)) throw Error(path + ": expected topic " + topic);
  ServoLoad load;
  bag.on<SampleBlock>(topic, [&](const SampleBlock& block, double) { load.add(block); });
  bag.run(progress);
  return load;
}

std::vector<IdentifiedForceCurves> curvesFromBag(const std::string& path, const NodeParameters& parameters,
                                                 const std::function<void(double)>& progress) {
  ForceCurvePipeline curves(parameters.curve, parameters.hold_back);
  std::map<std::pair<std::string, std::string>, IdentifiedForceCurves> last;
  std::string rejected;
  curves.identification().onCurves([&](const IdentifiedForceCurves& found) {
    last[{found.tool, found.material}] = found;
  });
  curves.identification().onRejected([&](const std::string& why) { rejected += "; " + why; });
  RecordingReader bag(path);
  for (const char* topic : {names::FORCE_COMPENSATED, names::SPINDLE_ANGLE}) {
    if (!bag.has(topic)) throw Error(path + ": expected topic " + topic);
  }
  connectCurves(bag, curves);
  bag.run(progress);
  curves.flush();
  if (last.empty()) throw Error(path + ": no force curve from its cuts" + rejected);
  std::vector<IdentifiedForceCurves> found;
  for (auto& [of, one] : last) found.push_back(std::move(one));
  return found;
}

}  // namespace smartmill::loadmeter
