#pragma once

#include <cstddef>
#include <map>
#include <string>

namespace smartmill {

/// Prior odds of each effect of the catalogue for a machine, from similar machines (docs/formats.md,
/// smartmill-causes/1).
struct CauseOdds {
  std::size_t machines = 0;              ///< that contribute
  double other = 1.0;                    ///< odds of each effect that is not listed, > 0
  std::map<std::string, double> listed;  ///< by the effect's name, > 0

  double of(const std::string& effect) const;
};

/// YAML, format smartmill-causes/1. @throws Error.
void writeCauseOdds(const CauseOdds& odds, const std::string& file);
/// @throws Error naming file, key and the expected value.
CauseOdds readCauseOdds(const std::string& file);

}  // namespace smartmill
