#include "smartmill_loadmeter/identification/identification_pipeline.h"

#include "smartmill_core/names.h"

namespace smartmill::loadmeter {

IdentificationPipeline::IdentificationPipeline(const MachineModel& model,
                                               const IdentificationParameters& parameters, double hold_back)
    : identification_(model, parameters), sorter_(hold_back) {
  states_ = sorter_.addRegular(names::CNC_STATE);
  loads_ = sorter_.addRegular(names::CNC_LOAD);
  temperatures_ = sorter_.addEvents(names::MACHINE_TEMPERATURE);
  motors_ = sorter_.addOptional(names::MOTOR_CURRENT);
  forces_ = sorter_.addOptional(names::FORCE_COMPENSATED);
  conditions_ = sorter_.addLatched(names::CUTTING_CONDITION);
  goals_ = sorter_.addEvents(names::IDENTIFY_COEFFICIENTS);
  sorter_.onRestart([this] {
    identification_.reset();
    newest_ = 0.0;
  });
}

}  // namespace smartmill::loadmeter
