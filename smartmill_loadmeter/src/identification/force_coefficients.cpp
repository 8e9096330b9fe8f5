#include "smartmill_loadmeter/identification/force_coefficients.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/model/machine_model.h"

namespace smartmill::loadmeter {

void addForceCoefficients(const JointResult& joint, CoefficientRecord* record) {
  constexpr std::size_t KTC = 0, KTE = 3;
  const auto& keys = cuttingKeys();
  for (std::size_t i = 0; i < keys.size(); ++i) {
    if (i == KTC || i == KTE) continue;
    const auto coefficient = keys[i].coefficient;
    record->set.value.*coefficient = joint.value.*coefficient;
    record->set.std_dev.*coefficient = joint.std_dev.*coefficient;
    for (std::size_t j = 0; j < keys.size(); ++j) {
      if (const double c = joint.covariance[6 * i + j]; std::isfinite(c))
        record->covariance[CoefficientRecord::covarianceIndex(std::min(i, j), std::max(i, j))] = c;
    }
  }
}

}  // namespace smartmill::loadmeter
