#pragma once

#include <array>
#include <string>
#include <vector>

#include "smartmill_core/modal/modal_model.h"

namespace smartmill::kalman {

/// The modes of a sensor along an axis.
void printSensor(const char* axis, const ModalModel& sensor);

/// Forces [N] of a cut from the tenth to the ninetieth percentile, measured and compensated.
std::string rangeLine(const std::string& name, const std::array<std::vector<double>, 3>& measured,
                      const std::array<std::vector<double>, 3>& compensated);

/// FOLDER/NAME.csv with time [s] and force [N].
void writeForce(const std::string& folder, const std::string& name, std::vector<double> time,
                std::array<std::vector<double>, 3> force);

}  // namespace smartmill::kalman
