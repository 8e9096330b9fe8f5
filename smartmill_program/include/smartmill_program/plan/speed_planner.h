#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_program/engagement/cut_simulation.h"
#include "smartmill_program/prediction/chatter_risk.h"
#include "smartmill_program/prediction/tool_models.h"

namespace smartmill::program {

struct SpeedLimits {
  double low = 0.0, high = 0.0;      ///< [rad/s] range of the planned speeds
  stability::RiskOptions risk = {};  ///< accepted probability of chatter

  /// @throws Error on an empty range
  void validate() const;
};

/// The speed of an operation: all cuts under one S word.
struct PlannedSpeed {
  int line = 0, tool = 0;             ///< of the S word; T
  double old_speed = 0.0;             ///< [rad/s]
  std::optional<double> new_speed;    ///< [rad/s] empty: the S word stays
  std::optional<double> probability;  ///< [1] largest of chatter at the new speed
  std::string reason;                 ///< why the S word stays
};

/// Chooses the highest speed of each operation at which each of its cuts chatters with at most the accepted
/// probability. At constant feed per tooth it removes most.
class SpeedPlanner {
 public:
  SpeedPlanner(ToolModels& models, const SpeedLimits& limits);

  const SpeedLimits& limits() const { return limits_; }
  /// Takes a step of the analysis of the program.
  void add(const Step& step);
  /// @param progress [1] share of the search; false ends it, with an empty result
  std::vector<PlannedSpeed> plan(const std::function<bool(double share)>& progress = {});

 private:
  struct Operation {
    int tool = 0;
    double speed = 0.0;                      // [rad/s]
    bool several = false;                    // tools or speeds
    std::map<EngagementCell, double> depth;  // [m] largest
  };
  /// @param goes_on called with the share of the range that was searched. @return false: it ended the search
  bool choose(const Operation& operation, const std::function<bool(double)>& goes_on,
              PlannedSpeed& planned) const;

  ToolModels& models_;
  SpeedLimits limits_;
  std::map<int, Operation> operations_;  // by the line of the S word
};

/// The text of a program with planned speeds, and new over old speed [1] by the line of the S word.
struct SpeedText {
  std::string text;
  std::map<int, double> ratios;
};
/// @throws Error "line N: ..." on a comment within the S word
SpeedText withSpeeds(const std::string& text, const std::vector<PlannedSpeed>& speeds);

}  // namespace smartmill::program
