#pragma once

#include <string>

namespace smartmill::stability {

/// Draws columns of a CSV file with gnuplot beside it (.png for .csv). @param commands gnuplot commands after
/// terminal, output, separator and grid are set, in which %FILE stands for the CSV. @throws Error.
void drawBeside(const std::string& csv, std::string commands);

}  // namespace smartmill::stability
