#pragma once

#include <optional>
#include <vector>

#include "smartmill_discrepancy/explain/nonlinear_chip_law.h"
#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/hypotheses/hypothesis.h"

namespace smartmill::discrepancy {

/// Residual of cuts that differ in feed only, as a table over one revolution, linear in the feed. Any rigid
/// geometry behind any linear sensor has such a residual if the force law is linear in the chip thickness.
/// Lines are estimated from the fitted tests, each weighted by its asynchronous part; orders are included if
/// they gain more than their values cost.
/// @param all forms of a campaign @param now fit whose residual is used; if its last member is such a table,
/// the result extends it @param curvature added to the table
/// @return nothing if fewer than three feeds at one speed, depth and immersion are fitted, or no order gains
/// enough
std::optional<Hypothesis> revolutionTable(const TwinRunner& runner, const std::vector<Hypothesis>& all,
                                          const FitResult& now, const FeedCurvature& curvature = {});

/// Fitted cuts with spindle angle; empty unless they differ in feed only, with at least three feeds.
std::vector<std::size_t> cutsOfVaryingFeed(const TwinRunner& runner);

/// Whether a state has a revolution table.
bool hasRevolutionTable(const FitState& state);

}  // namespace smartmill::discrepancy
