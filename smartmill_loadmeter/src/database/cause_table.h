#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_loadmeter/database/causes.h"

namespace smartmill::loadmeter {

/// Mixture components of CauseSearch's hypotheses and their predictions for every test.
struct CauseTable {
  /// Within a component each channel of each test shows the cause with its own probability.
  struct Component {
    std::size_t hypothesis = 0;
    double weight = 0.0;                     // [1] within its hypothesis
    std::vector<std::vector<double>> shows;  // [test][channel]
  };
  struct Test {
    /// Likelihood of each outcome that is the most probable one of a component, and of all others
    /// together: [outcome][component]
    std::vector<std::vector<double>> likelihood;
  };

  explicit CauseTable(const FleetCauses& fleet);
  std::vector<bool> channelsOf(const Outcome& outcome) const;
  double likelihood(const Component& component, std::size_t test, const std::vector<bool>& shows) const;

  std::vector<std::string> channels;
  std::vector<Component> components;
  std::vector<Test> tests;

 private:
  void addCause(const FleetCause& cause, std::size_t hypothesis);
  void addNoCause(std::size_t hypothesis);
  void addUnknownCause(std::size_t hypothesis);
  void tabulate(std::size_t test);

  std::size_t count_ = 0;  // of tests
};

}  // namespace smartmill::loadmeter
