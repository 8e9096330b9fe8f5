#include "smartmill_loadmeter/identification/runout_torque.h"

#include <cmath>

namespace smartmill::loadmeter {
namespace {

CuttingLaw unitLaw() {
  CuttingLaw law;
  law.coefficients.ktc = law.coefficients.kte = 1.0;
  return law;
}

}  // namespace

RunoutTorque::RunoutTorque(const ToolGeometry& tool, const Engagement& engagement, double x, double y)
    : cut_(tool, unitLaw(), engagement, runoutRadii(tool, std::hypot(x, y), std::atan2(y, x))) {
}

std::array<double, 2> RunoutTorque::at(double spindle_angle) const {
  const auto parts = cut_.termsAt(spindle_angle);
  return {parts[0].torque, parts[1].torque};
}

std::array<double, 2> RunoutTorque::mean() const {
  const auto parts = cut_.meanTerms();
  return {parts[0].torque, parts[1].torque};
}

}  // namespace smartmill::loadmeter
