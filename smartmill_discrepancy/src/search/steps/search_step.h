#pragma once

#include <memory>
#include <vector>

#include "search/search_state.h"

namespace smartmill::discrepancy {

/// One step of a search. Steps depend on the state alone; a new one is a class with a factory below and its
/// position in step_list.cpp.
class SearchStep {
 public:
  virtual ~SearchStep() = default;
  virtual void run(SearchState& state) = 0;
};

std::unique_ptr<SearchStep> makeNominalFit();
/// @param shortened state after the search on shortened records
std::unique_ptr<SearchStep> makeContinuation(const SearchState& shortened);
std::unique_ptr<SearchStep> makeRounds();
std::unique_ptr<SearchStep> makeGuidanceRelease();
std::unique_ptr<SearchStep> makeFinalRefinement();

using SearchSteps = std::vector<std::unique_ptr<SearchStep>>;

/// Steps on shortened records, which are quick to simulate.
SearchSteps stepsOnShortenedRecords();
/// Steps on whole records.
/// @param shortened state after the search on shortened records, which is continued; nullptr: none. It must
/// outlive the steps.
SearchSteps stepsOnWholeRecords(const SearchState* shortened);

}  // namespace smartmill::discrepancy
