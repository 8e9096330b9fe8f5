#pragma once

#include <string>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::session {

/// For people.
inline std::string shown(double value, int decimals = 1) {
  return formatted("%.*f", decimals, value);
}
inline std::string mm(double length) {
  return shown(length / units::MM, 2) + " mm";
}

}  // namespace smartmill::session
