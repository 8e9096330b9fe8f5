#pragma once

#include <string>
#include <vector>

namespace smartmill::kalman {

/// Columns of a CSV file with a header, numbers only, in the order asked for; others are not read.
/// @throws Error naming file, line and column: missing column, no number, no rows.
std::vector<std::vector<double>> readNumericTable(const std::string& file,
                                                  const std::vector<std::string>& due);

}  // namespace smartmill::kalman
