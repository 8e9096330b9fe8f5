#include "smartmill_loadmeter/identification/identification_pipeline.h"

#include <algorithm>

#include "smartmill_core/names.h"

namespace smartmill::loadmeter {

IdentificationPipeline::IdentificationPipeline(const MachineModel& model,
                                               const IdentificationParameters& parameters, double hold_back)
    : identification_(model, parameters), sorter_(hold_back) {
  states_ = sorter_.addRegular(names::CNC_STATE);
  loads_ = sorter_.addRegular(names::CNC_LOAD);
  motors_ = sorter_.addOptional(names::MOTOR_CURRENT);
  forces_ = sorter_.addOptional(names::FORCE_COMPENSATED);
  conditions_ = sorter_.addLatched(names::CUTTING_CONDITION);
  goals_ = sorter_.addEvents(names::IDENTIFY_COEFFICIENTS);
  sorter_.onRestart([this] {
    identification_.reset();
    newest_ = 0.0;
  });
}

template <typename Input>
void IdentificationPipeline::sort(StreamSorter::Stream stream, const Input& input) {
  sorter_.push(stream, input.stamp, [this, input] { identification_.handle(input); });
  newest_ = std::max(newest_, input.stamp);
}

void IdentificationPipeline::push(const CncState& state) {
  sort(states_, state);
}
void IdentificationPipeline::push(const LoadSample& sample) {
  sort(loads_, sample);
}
void IdentificationPipeline::push(const SampleBlock& block) {
  sort(motors_, block);
}
void IdentificationPipeline::push(const ForceBlock& block) {
  sort(forces_, block);
}
void IdentificationPipeline::push(const CuttingCondition& condition) {
  sort(conditions_, condition);
}
void IdentificationPipeline::push(const IdentifyGoal& goal) {
  sort(goals_, goal);
}

}  // namespace smartmill::loadmeter
