#pragma once

#include <string>
#include <vector>

#include "smartmill_core/io/report_page.h"
#include "smartmill_program/report/block_summary.h"
#include "smartmill_program/report/path_view.h"

namespace smartmill::program {

/// The page: summary, what should be changed, path, table of the blocks. @param remarks see remarksOn()
ReportPage programPage(const std::string& program, const std::string& summary,
                       const std::vector<std::string>& remarks, const PathView& path,
                       const std::vector<BlockSummary>& blocks);

}  // namespace smartmill::program
