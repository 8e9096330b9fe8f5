#pragma once

#include <string>
#include <vector>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_launch/session/session_plan.h"

namespace smartmill::session {

/// What a session did and found, measured values only; written as JSON.
struct SessionSummary {
  struct Step {
    std::string name, detail;
    double elapsed = 0.0;  ///< [s] since the session's begin, at the step's end
    bool done = true;      ///< false: it failed, detail says why
  };
  struct Verified {
    std::string role;  ///< stable or unstable: what the chart says
    double spindle_speed = 0.0, axial_depth = 0.0, depth_limit = 0.0;  ///< [rad/s], [m], [m]
    CutVerdict verdict;
    bool as_predicted = false;
  };
  bool completed = false;  ///< every step was done
  std::string tool, material;
  std::vector<Step> steps;
  std::vector<MeasuredModes> modes;
  std::vector<CoefficientSet> coefficients;  ///< none or one
  std::vector<Verified> verified;

  /// @throws Error when the file cannot be written.
  void write(const std::string& file) const;
};

}  // namespace smartmill::session
