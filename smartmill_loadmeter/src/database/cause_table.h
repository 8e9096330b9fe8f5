#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_loadmeter/database/causes.h"

namespace smartmill::loadmeter {

struct CauseTableOptions {
  /// @{ Sizes of one cause on two machines: largest ratio [1], and steps of its logarithm on each side.
  double largest_size_ratio = 20.0;
  int size_steps = 8;
  /// @}
  double profile_std = 0.5;     ///< [1] of the logarithm of squares between two machines
  double channel_error = 0.02;  ///< [1] probability of a random error in a channel
  double false_alarm = 0.0125;  ///< [1] probability that a channel shows something without a cause
  /// @{ An unknown cause: weights of its components, and the shares of channels in which it differs from a
  /// known one.
  double like_known = 0.5, same_in_all_tests = 0.25, any_channels = 0.25;
  std::vector<double> changed_shares{0.1, 0.33};
  /// @}
  double shows = 0.9;  ///< [1] probability in the channels of a cause that shows alike in every test
};

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

  explicit CauseTable(const FleetCauses& fleet, const CauseTableOptions& options = {});
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
  double showProbability(double squares, double factor) const;

  CauseTableOptions options_;
  std::size_t count_ = 0;  // of tests
};

}  // namespace smartmill::loadmeter
