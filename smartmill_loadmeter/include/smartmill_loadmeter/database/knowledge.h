#pragma once

#include <optional>
#include <string>

#include "smartmill_loadmeter/database/database.h"

namespace smartmill::loadmeter {

/// Two independent estimates of the coefficients of one tool and material, combined.
struct CombinedRecord {
  CoefficientRecord record;  ///< weighted by the inverse covariances; conditions and stamp of the newer one
  bool agree = false;        ///< the difference lies within the 99 % region of its covariance
  double deviation = 0.0;    ///< [1] root of chi2 of the difference per coefficient; 1 is expected
};

/// Combines the coefficients that have standard deviations; an unknown covariance counts as zero.
CombinedRecord combine(const CoefficientRecord& newer, const CoefficientRecord& older);

/// Smallest and largest value of the records; NaN: unknown.
struct CoveredRange {
  double low = CoefficientRecord::UNKNOWN, high = CoefficientRecord::UNKNOWN;
  void add(double value);
};

/// Content of the database about a tool in a material (database that compiles itself, document 004, section
/// 4).
struct CoefficientKnowledge {
  CoefficientRecord combined;   ///< values, standard deviations, covariance; tests of all combined records
  int identifications = 0;      ///< combined; 0: production cuts only
  int production_cuts = 0;      ///< stored cuts of the pair
  int superseded = 0;           ///< identifications before one that disagrees with the newer ones, not used
  CoveredRange cutting_speed;   ///< [m/s] of identifications and cuts
  CoveredRange feed_per_tooth;  ///< [m]
  CoveredRange axial_depth;     ///< [m]
  CoveredRange edge_age;        ///< [s]
};

/// Combines the identifications of the pair, newest first, up to one that disagrees with the newer ones (the
/// process has changed). Identifications that share tests with a newer one are not counted twice; those of
/// which the first test is unknown (files before schema 3) are used alone. Cuts of the same tests are in the
/// identification and are used only without one. Empty: no record of the pair. @throws Error when the
/// database cannot be read.
std::optional<CoefficientKnowledge> knowledgeOf(const CoefficientDatabase& database, const std::string& tool,
                                                const std::string& material);

}  // namespace smartmill::loadmeter
