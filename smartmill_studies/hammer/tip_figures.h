#pragma once

#include <string>
#include <vector>

#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_stability/solvers/zero_order.h"

namespace smartmill::studies {

/// One of the FRFs [m/N] of a figure; the first is the true one.
struct TipCurve {
  std::string name;
  FrequencyResponse frf;
};

/// Real and imaginary part, 100..5000 Hz (Dunwoody figures 4.5 to 4.7). @throws Error of gnuplot
void drawParts(const std::vector<TipCurve>& curves, const std::string& png);

/// Figure 4.8: magnitudes of the FRFs, and the depth limits of a slot with four teeth in aluminium; x and y
/// are equal. @return the limits of each curve. @throws Error of gnuplot
std::vector<StabilityLimit> drawSlotLimits(const std::vector<TipCurve>& curves, const std::string& png);

}  // namespace smartmill::studies
