#pragma once

#include <string>
#include <vector>

#include "smartmill_program/prediction/tool_models.h"
#include "smartmill_program/report/block_summary.h"

namespace smartmill::program {

/// What should be changed in a program, a line each: chatter, torque, power and speed beyond the spindle's,
/// feeds beyond the rapid feed of the axes. Each names the first block and the number of blocks.
std::vector<std::string> remarksOn(const std::vector<BlockSummary>& blocks, ToolModels& models);

}  // namespace smartmill::program
