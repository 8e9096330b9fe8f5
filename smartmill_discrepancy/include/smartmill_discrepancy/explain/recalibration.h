#pragma once

#include <string>
#include <vector>

#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/results/explanation.h"

namespace smartmill::discrepancy {

/// Nominal values that the fitted tests determine differently than stated, most deviations first; at least
/// the one with the most.
/// @param fit without effects, with covariance
std::vector<RecalibratedValue> recalibratedValues(const NominalFreedom& freedom, const FitResult& fit);

/// One line for the machinist: which values, how far, by a common factor or not, and whether within their
/// stated uncertainty.
std::string sentenceOf(const std::vector<RecalibratedValue>& values);

}  // namespace smartmill::discrepancy
