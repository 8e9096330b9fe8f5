#pragma once

#include <cstdio>
#include <string>

#include "smartmill_core/units.h"

namespace smartmill::session {

/// For people.
inline std::string shown(double value, int decimals = 1) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}
inline std::string mm(double length) {
  return shown(length / units::MM, 2) + " mm";
}

}  // namespace smartmill::session
