#include "steps/steps.h"

namespace smartmill::hammer {

std::vector<StepPtr> sequenceSteps(Measurement& measurement, StationControl& control) {
  std::vector<StepPtr> steps;
  for (const auto factory : {orientSpindle, moveToStation, searchFluteAtTip, lowerHalfway, searchFluteHalfway,
                             raiseToTip, turnFluteToHammer, measureFlanks, trialHit, calibrateSensor,
                             calibrateCrossSensor, repeatCalibration, collectHits, lowerToSecondHeight,
                             turnFluteAtSecondHeight, calibrateAtSecondHeight, collectHitsAtSecondHeight})
    steps.push_back(factory(measurement, control));
  return steps;
}

}  // namespace smartmill::hammer
