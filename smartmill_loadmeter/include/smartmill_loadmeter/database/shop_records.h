#pragma once

#include <limits>
#include <string>
#include <vector>

#include "smartmill_core/model/reported_parameter.h"

namespace smartmill::loadmeter {

/// What a machine's database keeps beside coefficients and cuts (database.h). NaN (and an empty word): not
/// known.

/// What an explanation found that a machine's model lacked, with its evidence. Lists are JSON in the keys of
/// the report (docs/formats.md, smartmill-report/1).
struct ModelImprovement {
  static constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();

  std::string machine;     ///< name of the machine
  std::string verdict;     ///< as in the report
  std::string effects;     ///< named: parameters with deviations, BIC lost without each, confidence, rivals
  std::string rivals;      ///< not told apart, pair by pair
  std::string resembles;   ///< what did not hold
  std::string tests;       ///< each with the channel that changed most: gap before and after, condition
  std::string asked;       ///< test that would tell more; for people
  std::string report;      ///< where it stood
  std::string version;     ///< of the software
  double stamp = UNKNOWN;  ///< [s]
  double fit_before = UNKNOWN, fit_after = UNKNOWN;          ///< [1] gap of the tests fitted to
  double heldout_before = UNKNOWN, heldout_after = UNKNOWN;  ///< [1] of the others
};

/// A quantity of a spindle at two times, one row of what `hammer health` tells.
struct HealthRecord {
  static constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();

  std::string machine;   ///< name of the machine
  std::string measured;  ///< tool, point and direction, or the spindle
  std::string quantity;  ///< e.g. "damping of the mode at 930 Hz"
  std::string bag, version;
  double stamp = UNKNOWN;                 ///< [s] of the later measurement
  double days = UNKNOWN;                  ///< [day] since the first of its kind
  double first = UNKNOWN, now = UNKNOWN;  ///< in the quantity's unit
  double deviations = UNKNOWN;            ///< standard deviations of the change; NaN: came or went
  double drifted = 0.0;                   ///< 1: more than chance gives
};

/// A cause that an explanation named.
struct FoundCause {
  std::string name;  ///< as in the catalogue of effects
  std::vector<ReportedParameter> parameters;
  double delta_bic = 0.0, confidence = 0.0;  ///< [1] as in the report

  std::string text() const;  ///< "runout: offset_um 9.02 +- 0.02, angle_deg 41 +- 1"
};

/// Causes with a name. @throws Error when the record's lists are no such JSON.
std::vector<FoundCause> causesOf(const ModelImprovement& improvement);

/// A test of an explanation.
struct TestEvidence {
  struct Gap {
    std::string channel;
    double before = 0.0, after = 0.0;  ///< [1]
  };
  std::string test;  ///< name, with its condition where that is known
  std::vector<Gap> gaps;
};

/// @throws Error as causesOf().
std::vector<TestEvidence> evidenceOf(const ModelImprovement& improvement);

/// From a report of `explain` (its folder or report.json). @param campaign folder whose tests say the
/// conditions; empty: only their names. @throws Error naming file and fault.
ModelImprovement readImprovement(const std::string& report, const std::string& campaign = "");

/// From what `hammer health -o` wrote. @throws Error naming file and line.
std::vector<HealthRecord> readHealth(const std::string& file);

}  // namespace smartmill::loadmeter
