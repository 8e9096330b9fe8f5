#include "smartmill_kalman_testing/reference_case.h"

#include <cmath>

#include "smartmill_core/testing/force_block.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {

std::array<std::vector<double>, 2> runCompensation(const ReferenceCase& reference,
                                                   const ReferenceRecord& record,
                                                   const ModalModel& model_sensor,
                                                   const CompensationParameters& parameters,
                                                   std::size_t* mode_updates) {
  constexpr std::size_t BLOCK = 256;
  std::array<std::vector<double>, 2> force;
  ForceCompensation compensation(parameters, false, {{}, [&](const ForceBlock& compensated) {
                                                       for (std::size_t axis = 0; axis < 2; ++axis) {
                                                         force[axis].insert(force[axis].end(),
                                                                            compensated.force[axis].begin(),
                                                                            compensated.force[axis].end());
                                                       }
                                                     }});
  compensation.setSensor(0, model_sensor);
  compensation.setSensor(1, model_sensor);
  ModalModel ideal;
  ideal.direct = 1.0;
  compensation.setSensor(2, ideal);
  CuttingCondition condition;
  condition.kind = CuttingCondition::Kind::cut;
  condition.tool = ReferenceCase::tool();
  condition.engagement = ReferenceCase::slot();
  condition.spindle_speed = reference.spindle_speed * (1.0 + reference.nominal_off);
  compensation.handle(condition);
  for (std::size_t at = 0; at + BLOCK <= record.time.size(); at += BLOCK) {
    compensation.handle(SpindleAngle{record.time[at],
                                     std::fmod(reference.angleAt(record.time[at]), units::TWO_PI),
                                     reference.speedAt(record.time[at])});
    SampleBlock block = forceBlock(record.time[at], reference.sample_rate, at);
    for (std::size_t i = at; i < at + BLOCK; ++i)
      block.samples.insert(block.samples.end(), {record.measured[0][i], record.measured[1][i], 0.0});
    compensation.handle(block);
  }
  compensation.flush();
  if (mode_updates) *mode_updates = compensation.health().mode_updates;
  return force;
}

}  // namespace smartmill::kalman
