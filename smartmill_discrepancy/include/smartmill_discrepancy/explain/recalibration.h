#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/results/explanation.h"
#include "smartmill_discrepancy/search/search.h"
#include "smartmill_discrepancy/search/separating_test.h"

namespace smartmill::discrepancy {

/// All nominal values that are free within their stated uncertainty, most deviations first.
/// @param fit with covariance
std::vector<RecalibratedValue> calibratedValues(const NominalFreedom& freedom, const FitResult& fit);

/// Nominal values that the fitted tests determine differently than stated, most deviations first; at least
/// the one with the most.
/// @param fit without effects, with covariance
std::vector<RecalibratedValue> recalibratedValues(const NominalFreedom& freedom, const FitResult& fit);

/// An effect that does the same as moved nominal values.
struct Equivalent {
  std::string effect, text;            ///< text: its name and values
  std::optional<SeparatingTest> test;  ///< that separates both; no value: none is known
};

/// Effects each of which, with the nominal values nearer to the stated ones, fits the tests as well as the
/// moved nominal values do. When cancelled, those found so far.
/// @param moved fit without effects
std::vector<Equivalent> equivalentEffects(Workbench& bench, const std::vector<Hypothesis>& hypotheses,
                                          const SearchOptions& options, const FitResult& moved);

/// One line for the machinist: which values, how far, by a common factor or not, whether within their
/// stated uncertainty, and which effects do the same.
std::string sentenceOf(const std::vector<RecalibratedValue>& values,
                       const std::vector<Equivalent>& equivalents);

}  // namespace smartmill::discrepancy
