#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/coefficient_set.h"

namespace smartmill::loadmeter {

/// Coefficients that this machine has identified, by tool and material: a YAML file
/// (smartmill-coefficients/1), one entry an identification, later ones stand for earlier ones of the same
/// tool and material. Without a file: this run only.
class CoefficientDatabase {
 public:
  /// @param file empty: kept in memory. A file that does not exist yet is made by the first add().
  /// @throws Error naming file, key and value of a bad file.
  explicit CoefficientDatabase(std::string file);

  /// @throws Error when the file cannot be written.
  void add(const CoefficientSet& coefficients);

  /// The newest of this tool and material; empty words match any.
  std::optional<CoefficientSet> find(const std::string& tool, const std::string& material) const;

  /// "tool / material" of what is known, for messages.
  std::string contents() const;

 private:
  void write() const;

  std::string file_;
  std::vector<CoefficientSet> entries_;
};

}  // namespace smartmill::loadmeter
