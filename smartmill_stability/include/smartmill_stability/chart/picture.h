#pragma once

#include <string>

namespace smartmill::stability {

/// Draws columns of a CSV file with gnuplot, to a file of the same name with .png.
/// @param commands gnuplot commands after terminal, output, separator and grid are set; %FILE is replaced by
/// the name of the CSV file. @throws Error when gnuplot fails.
void drawPicture(const std::string& csv, std::string commands);

}  // namespace smartmill::stability
