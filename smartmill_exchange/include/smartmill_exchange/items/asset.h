#pragma once

#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace smartmill::exchange {

/// A number of an asset with its standard deviation.
struct Quantity {
  std::string name, unit;  ///< unit in SI, e.g. N/m2; "1": none
  double value = 0.0;
  double std_dev = std::numeric_limits<double>::quiet_NaN();  ///< NaN: unknown
};

/// Numbers that belong together, e.g. one mode.
struct QuantityGroup {
  std::string name;
  std::vector<Quantity> quantities;
};

/// A thing with a longer life than a measurement: coefficients, modes, a chart. Numbers that are not finite
/// are left out of documents.
struct Asset {
  std::string id, type;  ///< type: CuttingCoefficients, ToolModes, StabilityChart
  double time = 0.0;     ///< [s] since 1970
  std::vector<std::pair<std::string, std::string>> labels = {};  ///< e.g. tool, material
  std::vector<Quantity> quantities = {};
  std::vector<QuantityGroup> groups = {};
};

/// Letters, digits, points, hyphens and underscores of the words, joined by points; others become
/// underscores.
std::string assetId(const std::vector<std::string>& words);

}  // namespace smartmill::exchange
