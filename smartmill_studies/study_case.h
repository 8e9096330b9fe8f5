#pragma once

#include <cstdint>
#include <cstdio>
#include <fstream>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/program.h"

namespace smartmill {

/// Lines of JSON; an incomplete line is skipped.
inline std::vector<nlohmann::json> readJsonLines(const std::string& file) {
  std::vector<nlohmann::json> lines;
  std::ifstream in(file);
  for (std::string text; std::getline(in, text);) {
    nlohmann::json line = nlohmann::json::parse(text, nullptr, false);
    if (!line.is_discarded()) lines.push_back(std::move(line));
  }
  return lines;
}

/// Options of one case of a study, as used by smartmill_studies/runner/run: --case K --cases N --seed S
/// prints one line of JSON, which is the same in every run on every host. --score LINES prints the figures of
/// the study from the lines of all cases.
struct StudyCase {
  int number = -1;  ///< -1: all cases
  std::string lines;

  bool one() const { return number >= 0; }
  bool scores() const { return !lines.empty(); }

  /// @param cases number of cases
  void addTo(const CommandLine& line, const std::string& names, int& cases, const std::string& help) {
    line.option(names, cases, help).showDefault().within(1, 1000000);
    line.option("--case", number, "only this case (0..): prints its line of JSON");
  }
  void addScore(const CommandLine& line) {
    line.option("--score", lines, "only prints the figures from a file with the lines of all cases")
        .existingFile();
  }
  /// @throws UsageError when the case is out of range.
  void check(int cases) const {
    if (number >= cases) throw UsageError("--case: expected 0.." + std::to_string(cases - 1));
  }
  void print(const nlohmann::json& line) const { std::printf("%s\n", line.dump().c_str()); }

  /// Runs the one case, or all of them with the figures at the end; with --score only the figures.
  /// @param line of a case by its number @param score prints the figures
  template <class Line, class Score>
  void run(int cases, const Line& line, const Score& score) const {
    if (scores()) return score(readJsonLines(lines));
    check(cases);
    if (one()) return print(line(number));
    std::vector<nlohmann::json> all;
    for (int k = 0; k < cases; ++k) {
      all.push_back(line(k));
      print(all.back());
      std::fflush(stdout);
    }
    score(all);
  }
};

/// Seed of one case of a study.
inline std::uint64_t seedOfCase(std::uint64_t seed, int number) {
  std::seed_seq mixed{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32),
                      static_cast<std::uint32_t>(number)};
  std::vector<std::uint32_t> words(2);
  mixed.generate(words.begin(), words.end());
  return (static_cast<std::uint64_t>(words[0]) << 32) | words[1];
}

/// A number of a line; NaN for null, which represents NaN and infinity.
inline double numberOf(const nlohmann::json& line, const char* name) {
  const nlohmann::json& value = line.at(name);
  return value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>();
}

}  // namespace smartmill
