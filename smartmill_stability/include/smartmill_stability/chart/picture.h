#pragma once

#include <cstddef>
#include <string>

namespace smartmill::stability {

/// Draws columns of a CSV file with gnuplot, to a file of the same name with .png.
/// @param commands gnuplot commands after terminal, output, separator and grid are set; %FILE is replaced by
/// the name of the CSV file. @throws Error when gnuplot fails.
void drawPicture(const std::string& csv, std::string commands);

/// Draws a map of the probability of chatter from a CSV file with the columns rpm, depth_mm, probability and
/// a limit [mm], one row per depth at each speed. @param depths rows per speed @param deepest [m]
/// @param title of the limit @param marks gnuplot commands before the map
void drawProbabilities(const std::string& csv, std::size_t depths, double deepest, const std::string& title,
                       const std::string& marks = {});

}  // namespace smartmill::stability
