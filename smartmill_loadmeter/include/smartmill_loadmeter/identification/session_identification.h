#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/identification/load_test.h"

namespace smartmill::loadmeter {

/// Goal of the action IdentifyCoefficients.
struct IdentifyGoal {
  double stamp = 0.0;    ///< [s]
  std::string tool;      ///< empty: any
  std::string material;  ///< empty: any
  bool reset = false;    ///< discard earlier tests
  std::uint64_t id = 0;  ///< returned with the result
  /// Independent earlier knowledge of this pair with covariance, combined with the tests if it agrees.
  std::optional<CoefficientRecord> prior = std::nullopt;
};

/// Latest message material/prior for the goals that follow. Its stamp decides, not the order of arrival.
class PriorKnowledge {
 public:
  /// @param set without tool: withdraws the knowledge. @param ktc_kte_covariance [N2/m3]
  void set(double stamp, const CoefficientSet& set, double ktc_kte_covariance);
  /// Gives a goal of the same pair the knowledge; a goal with reset discards what is older.
  void use(IdentifyGoal* goal);

 private:
  CoefficientRecord prior_;
  double stamp_ = 0.0, reset_ = 0.0;  // [s]
};

struct IdentifyResult {
  enum class Code : std::uint8_t { ok = 0, cancelled = 1, too_few_tests = 2, bad_data = 3 };
  Code code = Code::ok;
  std::string message;          ///< one line
  CoefficientSet coefficients;  ///< with the goal's prior if the tests agree with it (names::WITH_STORED)
  CoefficientRecord record;  ///< from the tests alone, with tool, engagement and covariance, for the database
  bool reset = false;        ///< reply to a goal with reset, without coefficients
  std::uint64_t id = 0;      ///< of the goal
};

/// Coefficients from the tests of a session.
struct SessionResult {
  CoefficientRecord record;  ///< with covariance, and means of tool and engagement
  std::string found;         ///< terms added by evidence, runout and notes, for messages; may be empty
};
/// Coefficients by the estimator of campaign_identification.h, each test a mean of steady readings
/// (eq. 3.5, 3.19 for any engagement), with the runout from the cuts' means and the ripple of their readings.
/// @param largest_runout [m]; 0: none. @param least_feeds of the cuts; 2 if the result is compared with
/// earlier knowledge
/// @throws Error with what is missing.
SessionResult identifyFromTests(std::vector<LoadTest> air_cuts, std::vector<LoadTest> cuts,
                                const Spindle& spindle, double spindle_uncertainty_percent,
                                double largest_runout = 0.0, std::size_t least_feeds = 3);

/// For example "1 cut", "2 cuts".
std::string countOf(std::size_t n, const char* what);

/// Tests since the last goal with reset, of which production without one has no end: the newest MOST of each
/// kind.
struct SessionTests {
  static constexpr std::size_t MOST = 500;  ///< [1] of about 15 kB

  std::vector<LoadTest> air_cuts, cuts;
  std::vector<std::string> rejected;  ///< tests that are not used, each with the reason
  std::size_t unknown_loads = 0;      ///< load samples of the tests that are not numbers
  std::size_t dropped = 0;            ///< older tests that are not kept

  void add(const LoadTest& test);
  void reject(const std::string& reason);
  void clear() { *this = {}; }
};

/// Coefficients of a goal's tool and material: identifyFromTests(), with radial and axial coefficients where
/// the cuts' motors show them. Never throws: the result has code and message.
IdentifyResult identifySession(const SessionTests& session, const IdentifyGoal& goal, const Spindle& spindle,
                               double spindle_uncertainty_percent, double largest_runout);

}  // namespace smartmill::loadmeter
