#include "search/steps/search_step.h"

namespace smartmill::discrepancy {

SearchSteps stepsOnShortenedRecords() {
  SearchSteps steps;
  steps.push_back(makeNominalFit());
  steps.push_back(makeRounds());
  return steps;
}

SearchSteps stepsOnWholeRecords(const SearchState* shortened) {
  SearchSteps steps;
  steps.push_back(shortened ? makeContinuation(*shortened) : makeNominalFit());
  steps.push_back(makeRounds());
  steps.push_back(makeGuidanceRelease());
  steps.push_back(makeFinalRefinement());
  return steps;
}

}  // namespace smartmill::discrepancy
