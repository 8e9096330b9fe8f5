#pragma once

#include <string>
#include <vector>

#include "smartmill_core/io/report_page.h"
#include "smartmill_program/report/block_summary.h"
#include "smartmill_program/report/path_view.h"

namespace smartmill::program {

/// The page: path, summary and the table of the blocks.
ReportPage programPage(const std::string& program, const std::string& summary, const PathView& path,
                       const std::vector<BlockSummary>& blocks);

}  // namespace smartmill::program
