#pragma once

#include <string>
#include <vector>

#include "smartmill_core/io/csv.h"
#include "smartmill_program/plan/feed_planner.h"
#include "smartmill_program/plan/speed_planner.h"

namespace smartmill::program {

/// Unified diff of a program and its plan. @param name, name_of_plan files
std::string planDiff(const std::string& text, const std::string& planned, const std::string& name,
                     const std::string& name_of_plan);

/// plan.csv (docs/nc_program.md).
CsvWriter planTable(const FeedPlan& plan);

/// The planned speeds on standard output, a line each.
std::string speedSummary(const std::vector<PlannedSpeed>& speeds);

/// The summary of a plan on standard output.
std::string planSummary(const FeedPlan& plan, const FeedLimits& limits);

}  // namespace smartmill::program
