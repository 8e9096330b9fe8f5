#pragma once

#include <optional>
#include <string>
#include <vector>

#include "load_record.h"
#include "load_regression.h"
#include "runout_average.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_loadmeter/identification/campaign_identification.h"

namespace smartmill::loadmeter {

/// Ktc and Kte from records of air cuts and cuts of a campaign or the running machine: a fit, averaged over
/// an unknown runout, with the further terms that TermSearch selects.
class LoadEstimator {
 public:
  /// @param spindle_uncertainty [%] stated by the model. @param noise [V] of means; 0: estimated from the
  /// samples. @param timed every record has its start time. @param where source, for messages; may be empty.
  /// @throws Error with too few air cuts or feeds.
  LoadEstimator(std::vector<LoadRecord> records, const Spindle& spindle, double spindle_uncertainty,
                const LoadRecordOptions& options, double noise, bool timed, const std::string& where);

  LoadRecordResult estimate();

 private:
  void averageOverRunout(const RunoutAveraging& averaging);
  LoadRecordResult result() const;
  void addDetails(LoadRecordResult* result) const;

  LoadRecordOptions options_;
  double spindle_uncertainty_;  // [1]
  std::string where_;
  LoadPlan plan_;
  LoadRegression regression_;
  LoadState state_;
  std::optional<RunoutAverage> average_;  // without the spindle angle
};

}  // namespace smartmill::loadmeter
