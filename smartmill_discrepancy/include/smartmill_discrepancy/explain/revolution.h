#pragma once

#include <optional>
#include <vector>

#include "smartmill_discrepancy/explain/bent_law.h"
#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/hypotheses/hypothesis.h"

namespace smartmill::discrepancy {

/// What is left of cuts that differ in feed only, as a table over one revolution that is straight over the
/// feed: any rigid geometry and any linear sensor give such a rest beside a law that is straight over the
/// chip. Its lines are found from the fit tests, each weighted by what in it does not come again with the
/// revolution; only orders that tell more than they cost are kept.
/// @param all forms of a campaign @param now its residual; where its last member is such a table already,
/// that one with what it leaves beside it @param bend of the table besides
/// @return nothing where no three feeds at one speed, depth and immersion are fitted, or no order tells
/// enough
std::optional<Hypothesis> revolutionLeft(const TwinRunner& runner, const std::vector<Hypothesis>& all,
                                         const Fit& now, const Bend& bend = {});

/// Fit cuts with an angle; empty unless they differ in feed only, in three feeds or more.
std::vector<std::size_t> cutsOfOneKind(const TwinRunner& runner);

/// Whether a state has such a table.
bool hasRevolution(const FitState& state);

}  // namespace smartmill::discrepancy
