#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include "smartmill_core/testing/reference_case.h"
#include "smartmill_kalman/compensation/force_compensation.h"

namespace smartmill::kalman {

/// The reference record through ForceCompensation in blocks of 256 samples, with its angle and cutting
/// condition: force x and y. With track_speed there is no angle. @param model_sensor of the compensation
/// @param mode_updates number of accepted shifts of the modes; may be null
std::array<std::vector<double>, 2> runCompensation(const ReferenceCase& reference,
                                                   const ReferenceRecord& record,
                                                   const ModalModel& model_sensor,
                                                   const CompensationParameters& parameters,
                                                   std::size_t* mode_updates = nullptr);

/// RMS innovation of a filter with an input of 1 N rms noise [N]. @param from first sample that counts
template <class Filter>
double innovationUnderNoise(Filter& filter, int count, int from) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, 1.0);
  double squares = 0.0;
  for (int i = 0; i < count; ++i) {
    filter.step(noise(random));
    if (i >= from) squares += filter.innovation() * filter.innovation();
  }
  return std::sqrt(squares / (count - from));
}

}  // namespace smartmill::kalman
