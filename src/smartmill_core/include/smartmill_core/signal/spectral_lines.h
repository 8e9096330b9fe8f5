#pragma once

#include <cstddef>
#include <vector>

namespace smartmill {

/// [lines] Position of a peak of a power spectrum: vertex of the parabola through the logarithms of three
/// lines, exact to a few percent of a line for a Hann window.
double peakPosition(const std::vector<double>& power, std::size_t peak);

/// Noise floor of a power spectrum: running median over neighbouring lines, insensitive to single lines.
/// @param reach [lines] to each side
std::vector<double> noiseFloor(const std::vector<double>& power, std::size_t reach = 40);

}  // namespace smartmill
