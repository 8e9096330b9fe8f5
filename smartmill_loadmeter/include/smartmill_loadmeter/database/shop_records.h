#pragma once

#include <limits>
#include <string>
#include <vector>

#include "smartmill_core/model/reported_parameter.h"

namespace smartmill::loadmeter {

/// Records of a machine's database in addition to coefficients (database.h). NaN and empty text: unknown.

/// Effects that an explanation found missing in a machine's model, with their evidence. Lists are JSON with
/// the keys of the report (docs/formats.md, smartmill-report/2).
struct ModelImprovement {
  static constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();

  std::string machine;  ///< name of the machine
  std::string verdict;  ///< as in the report
  std::string
      effects;  ///< named effects: parameters, standard deviations, BIC gain of each, confidence, rivals
  std::string rivals;      ///< unidentifiable pairs
  std::string resembles;   ///< effects that failed validation
  std::string tests;       ///< each with its condition and its channels' gaps before and after
  std::string asked;       ///< suggested test, as text
  std::string report;      ///< path of the report
  std::string version;     ///< of the software
  double stamp = UNKNOWN;  ///< [s]
  double fit_before = UNKNOWN, fit_after = UNKNOWN;          ///< [1] gap of the fitted tests
  double heldout_before = UNKNOWN, heldout_after = UNKNOWN;  ///< [1] gap of the held-out tests
};

/// Quantity of a spindle at two times, one row of `hammer health`.
struct HealthRecord {
  static constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();

  std::string machine;   ///< name of the machine
  std::string measured;  ///< tool, point and direction, or the spindle
  std::string quantity;  ///< for example "damping of the mode at 930 Hz"
  std::string bag, version;
  double stamp = UNKNOWN;                 ///< [s] of the later measurement
  double days = UNKNOWN;                  ///< [day] since the first measurement
  double first = UNKNOWN, now = UNKNOWN;  ///< first and present value, in the quantity's unit
  double deviations = UNKNOWN;            ///< change in standard deviations; NaN: appeared or disappeared
  double drifted = 0.0;                   ///< 1: significant change
};

/// Measured dimension of a part with what is known of the cut that made it (topic inspection/feature,
/// smartmill-inspection/1). The same value of a cut is one record, whenever it was entered.
struct InspectionRecord {
  static constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();

  std::string machine;          ///< name of the machine
  std::string tool, material;   ///< of the cut
  std::string condition;        ///< name of the cut
  std::string kind, direction;  ///< as InspectionFeature
  std::string bag, version;
  double stamp = UNKNOWN;                                           ///< [s] of the inspection
  double diameter = UNKNOWN;                                        ///< [m] stated, of the tool
  double nominal = UNKNOWN, measured = UNKNOWN, std_dev = UNKNOWN;  ///< [m]
  /// @{ [m] by which forced vibration of the tool widens the slot, and its standard deviation.
  double deflection = UNKNOWN, deflection_std = UNKNOWN;
  /// @}
  double cut_time = UNKNOWN;             ///< [s]
  double machine_temperature = UNKNOWN;  ///< [K] of the motor during the cut
  double part_temperature = UNKNOWN;     ///< [K] during the inspection; NaN: 20 deg C
  double part_expansion = UNKNOWN;       ///< [1/K]
  double edge_age = UNKNOWN;             ///< [s] cutting time of the edge

  double deviation() const;  ///< [m] measured at 20 deg C, minus nominal
};

/// Cause named by an explanation.
struct FoundCause {
  std::string name;  ///< as in the catalogue of effects
  std::vector<ReportedParameter> parameters;
  double delta_bic = 0.0, confidence = 0.0;  ///< [1] as in the report

  std::string text() const;  ///< "runout: offset_um 9.02 +- 0.02, angle_deg 41 +- 1"
};

/// Named causes. @throws Error when the record's lists are not valid JSON of this form.
std::vector<FoundCause> causesOf(const ModelImprovement& improvement);

/// A test of an explanation.
struct TestEvidence {
  struct Gap {
    std::string channel;
    double before = 0.0, after = 0.0;  ///< [1]
  };
  std::string test;  ///< name, with its condition where known
  std::vector<Gap> gaps;
};

/// @throws Error as causesOf().
std::vector<TestEvidence> evidenceOf(const ModelImprovement& improvement);

/// Reads a report of `explain` (its folder or report.json). @param campaign folder that defines the tests'
/// conditions; empty: names only. @throws Error with file and reason.
ModelImprovement readImprovement(const std::string& report, const std::string& campaign = "");

/// Reads a file of `hammer health -o`. @throws Error with file and line.
std::vector<HealthRecord> readHealth(const std::string& file);

}  // namespace smartmill::loadmeter
