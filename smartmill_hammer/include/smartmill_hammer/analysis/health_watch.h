#pragma once

#include <map>
#include <string>
#include <vector>

#include "smartmill_core/modal/results.h"
#include "smartmill_hammer/analysis/idle_spindle.h"

namespace smartmill {
namespace hammer {

/// What the node warns of while it runs: each good measurement against the one before of the same tool, point
/// and direction, cuts in air against the first of the same tool at the same speed, where the sensor's
/// dynamics fall out.
class HealthWatch {
 public:
  void measured(const MeasuredModes& modes);
  void turned(const std::string& tool, const IdleRecord& seen);

  /// One line each; empty: nothing has drifted.
  std::vector<std::string> warnings() const;

 private:
  std::map<std::string, MeasuredModes> last_;      // by tool, point and direction
  std::map<std::string, std::string> drift_;       // of these; empty: none
  std::map<std::string, IdleRecord> first_;        // by tool
  std::map<std::string, std::string> idle_drift_;  // of these
};

}  // namespace hammer
}  // namespace smartmill
