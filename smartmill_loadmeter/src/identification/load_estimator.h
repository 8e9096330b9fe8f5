#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "load_record.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_loadmeter/calibration/fit.h"
#include "smartmill_loadmeter/calibration/friction_law.h"
#include "smartmill_loadmeter/identification/campaign_identification.h"

namespace smartmill::loadmeter {

/// Ktc and Kte from condensed records of air cuts and cuts, those of a campaign or of the running machine:
/// friction, wear, runout and lag chosen by evidence.
class LoadEstimator {
 public:
  /// @param spindle_uncertainty [%] as the model states it. @param noise [V] of means; 0: found in the
  /// samples.
  /// @param timed every record knows its start time. @param where names the source in messages; may be empty.
  /// @throws Error when air cuts or feeds do not do.
  LoadEstimator(std::vector<LoadRecord> records, const Spindle& spindle, double spindle_uncertainty,
                const LoadRecordOptions& options, double noise, bool timed, const std::string& where);

  LoadRecordResult estimate();

 private:
  /// Which unknowns take part beyond viscous, coulomb, Ktc, Kte.
  struct Terms {
    FrictionShape friction;
    bool growth = false, runout = false, lag = false;
    std::size_t count() const;
    std::size_t ktcAt() const { return friction.unknowns(); }
  };
  struct Prior {
    std::size_t unknown;
    double value, std_dev;
  };
  struct Solution {
    Terms terms;
    FitResult fit;
    double bic = 0.0;
    double freedom = 1.0;
    double misfit = 0.0;  // chi2 per degree of freedom
    double share = 0.0;   // [1] RMS of what the records disagree by, of the RMS of their voltages
    double ktc() const { return fit.value[terms.ktcAt()]; }
    double kte() const { return fit.value[terms.ktcAt() + 1]; }
    bool disagrees() const;
  };
  /// Coefficients averaged over what a runout of unknown angle may be.
  struct RunoutAverage {
    double offset = 0.0;  // [m]
    bool shown = false;   // the records say that there is some
    double ktc = 0.0, kte = 0.0;
    double variance_tc = 0.0, variance_te = 0.0, covariance = 0.0;  // between the offsets
  };
  struct RunoutPoint;

  void checkPlan() const;
  void setPriors();
  std::size_t residualCount() const;
  void residuals(const Terms& terms, const std::vector<double>& value, double* out) const;
  FrictionLaw lawOf(const Solution& s) const;
  Solution solve(const Terms& terms, const FrictionLaw& start) const;
  void condenseAll();
  Solution settle(const Terms& terms);
  bool addTerm();
  std::vector<Terms> furtherTerms() const;
  Solution bestStart(const Terms& terms) const;

  bool averages() const { return !ripple_ && largest_runout_ > 0.0; }
  void tabulateRunout();
  double scatterEvidence(const RunoutPoint& point) const;
  std::vector<RunoutPoint> tryOffsets(double low, double high) const;
  RunoutAverage averageOverRunout() const;
  void takeRunout();
  void widenLocked();

  Eigen::MatrixXd jacobian() const;
  Eigen::MatrixXd covariance() const;
  LoadRecordResult result() const;
  void describe(LoadRecordResult* result) const;

  std::vector<LoadRecord> records_;
  Spindle spindle_;
  double stated_;  // [1] uncertainty of the spindle section
  LoadRecordOptions options_;
  bool known_noise_, timed_;
  std::string where_;

  double noise_;  // [V]
  double slowest_ = 0.0, fastest_ = 0.0;
  std::size_t cuts_ = 0, airs_ = 0, air_speeds_ = 0, ages_ = 0;
  bool ripple_ = false;  // the angle is known: a tooth's own share shows
  std::vector<Prior> friction_priors_;
  double runout_prior_ = 0.0;          // [m] of each component; 0: none
  double lag_prior_ = 0.0;             // std of the log time constant; 0: none
  double largest_runout_ = 0.0;        // [m] averaged over, without the angle
  std::vector<RunoutEffect> effects_;  // of the cuts, in order
  double air_variance_ = 0.0;          // [V2] scatter without a cut
  bool air_known_ = false;

  // What the records are condensed about, and where a fit starts.
  LoadPoint about_;
  double log_lag_ = 0.0;  // log of (time constant / the model's)
  double growth_ = 0.0;   // [1/s]
  FrictionLaw start_;
  Solution chosen_;
  RunoutAverage average_;
};

}  // namespace smartmill::loadmeter
