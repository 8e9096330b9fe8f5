#pragma once

#include <string>
#include <vector>

#include "smartmill_core/formatted.h"

namespace smartmill {

/// A parameter of an effect as in a report of `explain` (docs/formats.md, smartmill-report/2), in the unit of
/// its key.
struct ReportedParameter {
  std::string key;
  double value = 0.0, std_dev = 0.0;
  std::string word;  ///< instead of a number

  std::string text() const {  ///< "offset_um 9.02 +- 0.02"
    return key + " " + (word.empty() ? formatted("%.5g +- %.2g", value, std_dev) : word);
  }
};

/// @param parameters of an effect, read by the JSON library
/// @throws exceptions of that library when the format is not as documented
template <typename Json>
std::vector<ReportedParameter> reportedParameters(const Json& parameters) {
  std::vector<ReportedParameter> found;
  for (const auto& [key, content] : parameters.items()) {
    ReportedParameter p;
    p.key = key;
    if (content.at("value").is_string()) {
      p.word = content.at("value");
    } else {
      p.value = content.at("value");
      p.std_dev = content.value("std", 0.0);
    }
    found.push_back(p);
  }
  return found;
}

/// "offset_um 9.02 +- 0.02, angle_deg 41 +- 1"
inline std::string textOf(const std::vector<ReportedParameter>& parameters) {
  std::string text;
  for (const ReportedParameter& p : parameters) text += (text.empty() ? "" : ", ") + p.text();
  return text;
}

}  // namespace smartmill
