#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_loadmeter/database/causes.h"

namespace smartmill::loadmeter {

/// The parts of which CauseSearch's hypotheses are mixed, and what each says of every test.
struct CauseTable {
  /// Within it each channel of each test shows with a probability of its own.
  struct Part {
    std::size_t hypothesis = 0;
    double weight = 0.0;                     // [1] of its hypothesis
    std::vector<std::vector<double>> shows;  // [test][channel]
  };
  struct Test {
    /// Of each outcome that some part expects most, and of all others together: [outcome][part]
    std::vector<std::vector<double>> likelihood;
  };

  explicit CauseTable(const FleetCauses& fleet);
  std::vector<bool> channelsOf(const Outcome& outcome) const;
  double likelihood(const Part& part, std::size_t test, const std::vector<bool>& shows) const;

  std::vector<std::string> channels;
  std::vector<Part> parts;
  std::vector<Test> tests;

 private:
  void addCause(const FleetCause& cause, std::size_t hypothesis);
  void addNone(std::size_t hypothesis);
  void addUnmet(std::size_t hypothesis);
  void tabulate(std::size_t test);

  std::size_t count_ = 0;  // of tests
};

}  // namespace smartmill::loadmeter
