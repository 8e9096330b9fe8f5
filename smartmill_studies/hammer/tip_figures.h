#pragma once

#include <string>
#include <vector>

#include "smartmill_core/signal/frequency_response.h"
#include "smartmill_stability/solvers/zero_order.h"

namespace smartmill::studies {

/// One of the FRFs [m/N] that a figure compares; the first is the true one.
struct TipCurve {
  std::string name;
  FrequencyResponse frf;
};

/// Real and imaginary part, 100..5000 Hz (Dunwoody figures 4.5 to 4.7). @throws Error of gnuplot
void drawParts(const std::vector<TipCurve>& curves, const std::string& png);

/// Figure 4.8: the limit of a slot, of four teeth in aluminium, by each FRF; above it their sizes. x and y
/// are alike. @return the limits, curve by curve. @throws Error of gnuplot
std::vector<StabilityLimit> drawSlotLimits(const std::vector<TipCurve>& curves, const std::string& png);

}  // namespace smartmill::studies
