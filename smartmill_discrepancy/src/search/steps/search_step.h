#pragma once

#include <memory>
#include <vector>

#include "search/search_state.h"

namespace smartmill::discrepancy {

/// One step of a search. Steps know each other only by the state that they read and change; their order is in
/// step_list.cpp.
class SearchStep {
 public:
  virtual ~SearchStep() = default;
  virtual void run(SearchState& state) = 0;
};

using SearchSteps = std::vector<std::unique_ptr<SearchStep>>;

/// Steps on shortened records, which are quick to simulate.
SearchSteps stepsOnShortenedRecords();
/// Steps on whole records.
/// @param shortened state after the search on shortened records, which is continued; nullptr: none. It must
/// outlive the steps.
SearchSteps stepsOnWholeRecords(const SearchState* shortened);

}  // namespace smartmill::discrepancy
