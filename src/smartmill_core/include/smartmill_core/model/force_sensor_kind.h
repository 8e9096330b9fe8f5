#pragma once

#include <string>
#include <vector>

namespace smartmill {

/// Where a machine measures its force.
enum class ForceSensorKind {
  table,    ///< dynamometer on the table, forces along x, y, z
  spindle,  ///< six sensors in the spindle (Burzoni ch. 3), to be calibrated
  plate,    ///< plate of 3 or 6 channels under the workpiece (Bachrathy and Stepan), to be calibrated
};

/// Their words in parameters and messages, in the order of the enumeration.
inline const std::vector<std::string>& forceSensorWords() {
  static const std::vector<std::string> words{"table", "spindle", "plate"};
  return words;
}

/// @param word one of forceSensorWords()
inline ForceSensorKind forceSensorKind(const std::string& word) {
  return word == "spindle" ? ForceSensorKind::spindle
         : word == "plate" ? ForceSensorKind::plate
                           : ForceSensorKind::table;
}

}  // namespace smartmill
