#pragma once

#include <string>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::session {

/// For messages to the operator.
inline std::string numberText(double value, int decimals = 1) {
  return formatted("%.*f", decimals, value);
}
inline std::string mm(double length) {
  return numberText(length / units::MM, 2) + " mm";
}

}  // namespace smartmill::session
