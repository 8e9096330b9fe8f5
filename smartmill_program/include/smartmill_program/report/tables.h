#pragma once

#include <string>
#include <vector>

#include "smartmill_core/io/csv.h"
#include "smartmill_program/report/block_summary.h"

namespace smartmill::program {

/// blocks.csv (docs/nc_program.md).
CsvWriter blockTable(const std::vector<BlockSummary>& blocks);

/// steps.csv (docs/nc_program.md), row by row: the steps of feed motions.
class StepTable {
 public:
  StepTable();
  void add(const Step& step, const StepPrediction& prediction);
  const CsvWriter& csv() const { return csv_; }

 private:
  CsvWriter csv_;
  double time_ = 0.0;  // [s] at the end of the last step
};

/// The summary on standard output.
std::string summaryOf(const std::vector<BlockSummary>& blocks);

}  // namespace smartmill::program
