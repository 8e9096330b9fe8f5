#pragma once

#include <optional>
#include <string>
#include <vector>

#include <smartmill_msgs/ForceSensorState.h>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_launch/session/control_verdict.h"

namespace smartmill::session {

/// Steps and measured values of a session, written as JSON.
struct SessionSummary {
  struct Step {
    std::string name, detail;
    double elapsed = 0.0;  ///< [s] from the start of the session to the end of the step
    bool done = true;      ///< false: failed, with the reason in detail
  };
  struct Verified {
    std::string role;  ///< prediction of the chart: stable or unstable
    double spindle_speed = 0.0, axial_depth = 0.0, depth_limit = 0.0;  ///< [rad/s], [m], [m]
    CutVerdict verdict;
    bool as_predicted = false;
  };
  /// A cut from which a machine without a hammer learns its stability.
  struct Probing {
    std::string name;
    double spindle_speed = 0.0, axial_depth = 0.0;  ///< [rad/s], [m]
    double probability = NOT_A_NUMBER;  ///< [1] that it is stable, before it was made; NaN: it was not chosen
    CutVerdict verdict;
  };
  /// The cut that these recommend.
  struct RecommendedCut {
    double spindle_speed = 0.0, axial_depth = 0.0;    ///< [rad/s], [m]
    double probability = 0.0, probability_std = 0.0;  ///< [1] that it is stable
  };
  /// Test plan with the knowledge of the database.
  struct TestPlan {
    std::size_t planned = 0, made = 0;            ///< air cuts and cuts: in the full plan, made
    std::size_t planned_cuts = 0, made_cuts = 0;  ///< of these cuts in the stock
    double planned_time = 0.0, made_time = 0.0;   ///< [s] without rapid motion
    std::string stored;                           ///< what the database knew, in one line
    std::vector<CoefficientSet> known;            ///< none or one
    bool used = false;                            ///< the tests agree with it
    /// A cut that was chosen for its information (test_cuts `informative`).
    struct Chosen {
      std::string name;
      double gain = 0.0;                    ///< [1/s] of cutting
      double ktc_std = 0.0, kte_std = 0.0;  ///< [N/m2], [N/m] expected after it
    };
    std::vector<Chosen> chosen;         ///< in order
    std::vector<std::string> excluded;  ///< candidates beyond a limit, each with the reason
    bool target_reached = false;        ///< expected standard deviations of the chosen cuts

    std::string text() const;
  };
  bool completed = false;  ///< all steps are done
  std::string tool, material;
  std::vector<Step> steps;
  std::vector<MeasuredModes> modes;
  std::vector<CoefficientSet> coefficients;  ///< none or one
  std::vector<Verified> verified;
  std::vector<Probing> probing;               ///< without a hammer, the slot tests first
  std::optional<RecommendedCut> recommended;  ///< without a hammer
  std::optional<ControlVerdict> control;      ///< of the cut under chatter control; empty: none was made
  std::optional<smartmill_msgs::ForceSensorState> sensor;
  double calibration_time = 0.0;  ///< [s] of the force sensor, taps included
  TestPlan test_plan;
  /// Summary of the interrupted session that this one continues, as JSON: results that are not measured again
  /// are taken from it; empty: none.
  std::string before;

  std::string text() const;  ///< JSON
  /// @throws Error when the file cannot be written.
  void write(const std::string& file) const;
};

}  // namespace smartmill::session
