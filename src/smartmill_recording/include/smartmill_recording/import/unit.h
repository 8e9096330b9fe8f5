#pragma once

#include <optional>
#include <string>

namespace smartmill::recording {

enum class Quantity { time, force, acceleration, length, angle, voltage, frequency, full_scale };

struct Unit {
  Quantity quantity;
  double si;  ///< SI value of one
};

/// Unit by its symbol, e.g. N, kN, lbf, g, m/s2, m/s^2, um, mV, deg. @return nothing for an unknown symbol
std::optional<Unit> unitOf(const std::string& symbol);

/// The symbols of a quantity for a message, e.g. "N, kN, mN, daN or lbf".
std::string unitsFor(Quantity quantity);

}  // namespace smartmill::recording
