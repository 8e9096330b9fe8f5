#include "search/steps/continuation.h"
#include "search/steps/final_refinement.h"
#include "search/steps/guidance_release.h"
#include "search/steps/nominal_fit.h"
#include "search/steps/rounds.h"
#include "search/steps/search_step.h"

namespace smartmill::discrepancy {

SearchSteps stepsOnShortenedRecords() {
  SearchSteps steps;
  steps.push_back(std::make_unique<NominalFit>());
  steps.push_back(std::make_unique<Rounds>());
  return steps;
}

SearchSteps stepsOnWholeRecords(const SearchState* shortened) {
  SearchSteps steps;
  if (shortened) {
    steps.push_back(std::make_unique<Continuation>(*shortened));
  } else {
    steps.push_back(std::make_unique<NominalFit>());
  }
  steps.push_back(std::make_unique<Rounds>());
  steps.push_back(std::make_unique<GuidanceRelease>());
  steps.push_back(std::make_unique<FinalRefinement>());
  return steps;
}

}  // namespace smartmill::discrepancy
