#pragma once

#include <cstdint>
#include <fstream>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/program.h"

namespace smartmill {

/// One case of a study, as smartmill_studies/runner/run asks for it: --case K --cases N --seed S prints one line of JSON, the
/// same whenever and wherever it runs. The program's own --seed stays its own. --score LINES: the study's
/// figures from all cases' lines.
struct StudyCase {
  int number = -1;  ///< -1: all of them, as the program does without the engine
  std::string lines;

  bool one() const { return number >= 0; }
  bool scores() const { return !lines.empty(); }

  /// @param cases what the program counts them in
  void addTo(const CommandLine& line, const std::string& names, int& cases, const std::string& help) {
    line.option(names, cases, help).showDefault().within(1, 1000000);
    line.option("--case", number, "only this one of them, 0.., its line of JSON on standard output");
  }
  void addScore(const CommandLine& line) {
    line.option("--score", lines, "figures from a file of all cases' lines, nothing else is done")
        .existingFile();
  }
  /// @throws Error when the case is none of these.
  void check(int cases) const {
    if (number >= cases) throw UsageError("--case: 0.." + std::to_string(cases - 1) + " is due");
  }
  void print(const nlohmann::json& line) const { std::printf("%s\n", line.dump().c_str()); }
};

/// A seed of its own for each case of a study.
inline std::uint64_t seedOfCase(std::uint64_t seed, int number) {
  std::seed_seq mixed{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32),
                      static_cast<std::uint32_t>(number)};
  std::vector<std::uint32_t> words(2);
  mixed.generate(words.begin(), words.end());
  return (static_cast<std::uint64_t>(words[0]) << 32) | words[1];
}

/// Lines of JSON; one that was cut off by an end is left out.
inline std::vector<nlohmann::json> readJsonLines(const std::string& file) {
  std::vector<nlohmann::json> lines;
  std::ifstream in(file);
  for (std::string text; std::getline(in, text);) {
    nlohmann::json line = nlohmann::json::parse(text, nullptr, false);
    if (!line.is_discarded()) lines.push_back(std::move(line));
  }
  return lines;
}

/// A number of a line; null, as NaN and infinity are written: NaN.
inline double numberOf(const nlohmann::json& line, const char* name) {
  const nlohmann::json& value = line.at(name);
  return value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>();
}

}  // namespace smartmill
