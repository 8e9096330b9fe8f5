#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/range.h"

namespace smartmill {

/// One map of a YAML file, read strictly: every key at most once, every value of the required type and range,
/// every key read before finish(). Errors are one line "FILE: key.path: what", with the value.
class StrictYaml {
 public:
  /// @throws Error when the file cannot be read, is not YAML, is not a map or has a repeated key.
  static StrictYaml fromFile(const std::string& file);

  bool has(const std::string& key) const;
  bool isList(const std::string& key) const;
  std::vector<std::string> keys() const;

  /// Required values. @throws Error: missing, wrong type, NaN, out of range.
  double number(const std::string& key, const Range& range = {}) const;
  int integer(const std::string& key, int low, int high) const;
  std::string word(const std::string& key) const;
  /// A word that must be one of these.
  std::string oneOf(const std::string& key, const std::vector<std::string>& words) const;
  /// @param count required number; 0: one or more.
  std::vector<double> numbers(const std::string& key, std::size_t count, const Range& range = {}) const;
  StrictYaml map(const std::string& key) const;
  std::vector<StrictYaml> maps(const std::string& key) const;

  /// Values that may be absent.
  std::optional<double> optionalNumber(const std::string& key, const Range& range = {}) const;
  std::optional<StrictYaml> optionalMap(const std::string& key) const;

  /// @throws Error naming the first key that was not read.
  void finish() const;

  /// @throws Error "FILE: path.key: what".
  [[noreturn]] void fail(const std::string& key, const std::string& what) const;

  const std::string& file() const;
  std::string path(const std::string& key) const;  ///< e.g. tool.diameter_mm

 private:
  struct Impl;
  explicit StrictYaml(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
  std::shared_ptr<Impl> impl_;
};

/// A number for a YAML file, in a form that every reader parses as a number (1.0e-05, not 1e-05).
std::string yamlNumber(double value, int digits = 10);

/// The same with the fewest digits that read back to the exact value.
std::string yamlNumberExact(double value);

/// A word for a YAML file, quoted where necessary.
std::string yamlWord(const std::string& word);

}  // namespace smartmill
