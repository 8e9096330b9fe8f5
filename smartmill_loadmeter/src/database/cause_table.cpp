#include "cause_table.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

namespace smartmill::loadmeter {
namespace {

constexpr int SIZE_STEPS = 8;                // size steps on each side of the size of an explanation
constexpr double LARGEST_SIZE_RATIO = 20.0;  // [1] largest ratio of two sizes of one cause
constexpr double PROFILE_STD = 0.5;     // standard deviation of the logarithm of squares between two machines
constexpr double CHANNEL_ERROR = 0.02;  // [1] probability of a random error in a channel
constexpr double FALSE_ALARM = 0.0125;  // [1] probability that a channel shows something without a cause
constexpr double CHANGED_SHARES[] = {
    0.1, 0.33};  // [1] shares of channels in which an unknown cause differs from a known one
constexpr double WEIGHT_LIKE_KNOWN = 0.5, WEIGHT_SAME_IN_ALL_TESTS = 0.25,
                 WEIGHT_ANY_CHANNELS = 0.25;  // weights of the components of an unknown cause
constexpr double SHOWS_PROBABILITY =
    0.9;  // probability in the channels of a cause that shows alike in every test

// Probability that a channel shows a cause whose size is larger by a factor. @param squares squared-gap
// reduction over the threshold
double showProbability(double squares, double factor) {
  if (squares <= 0.0) return CHANNEL_ERROR;
  const double distance = std::log(squares * factor * factor) / PROFILE_STD;
  return CHANNEL_ERROR + (1.0 - 2.0 * CHANNEL_ERROR) * 0.5 * std::erfc(-distance / std::sqrt(2.0));
}

}  // namespace

CauseTable::CauseTable(const FleetCauses& fleet) : count_(fleet.tests.size()) {
  std::set<std::string> all;
  for (const FleetCause& c : fleet.causes) {
    for (const EvidenceProfile& s : c.profiles) {
      for (const auto& test : s) {
        for (const auto& [channel, squares] : test) all.insert(channel);
      }
    }
  }
  channels.assign(all.begin(), all.end());
  for (std::size_t c = 0; c < fleet.causes.size(); ++c) addCause(fleet.causes[c], c);
  addUnknownCause(fleet.causes.size() + 1);
  addNoCause(fleet.causes.size());
  for (std::size_t t = 0; t < count_; ++t) tabulate(t);
}

void CauseTable::addCause(const FleetCause& cause, std::size_t hypothesis) {
  // The ratio of two sizes that are uniform in the logarithm has a triangular distribution.
  for (const EvidenceProfile& profile : cause.profiles) {
    for (int k = 1 - SIZE_STEPS; k < SIZE_STEPS; ++k) {
      const double factor = std::pow(LARGEST_SIZE_RATIO, static_cast<double>(k) / SIZE_STEPS);
      const double triangle = (1.0 - std::abs(static_cast<double>(k)) / SIZE_STEPS) / SIZE_STEPS;
      Component component{hypothesis, triangle / static_cast<double>(cause.profiles.size()), {}};
      for (std::size_t t = 0; t < count_; ++t) {
        component.shows.emplace_back(channels.size(), 0.5);  // unknown for channels that were not measured
        for (const auto& [channel, squares] : profile[t]) {
          const auto at = std::lower_bound(channels.begin(), channels.end(), channel) - channels.begin();
          component.shows.back()[static_cast<std::size_t>(at)] = showProbability(squares, factor);
        }
      }
      components.push_back(component);
    }
  }
}

void CauseTable::addNoCause(std::size_t hypothesis) {
  components.push_back({hypothesis, 1.0, {count_, std::vector<double>(channels.size(), FALSE_ALARM)}});
}

void CauseTable::addUnknownCause(std::size_t hypothesis) {
  const std::vector<Component> known = components;
  std::set<std::vector<bool>> patterns;
  const double causes = static_cast<double>(std::max<std::size_t>(1, hypothesis - 1));
  for (const Component& like : known) {
    for (const double share : CHANGED_SHARES) {
      Component component = like;
      component.hypothesis = hypothesis;
      component.weight *= WEIGHT_LIKE_KNOWN / (causes * static_cast<double>(std::size(CHANGED_SHARES)));
      for (auto& test : component.shows) {
        std::vector<bool> pattern;
        for (double& p : test) {
          pattern.push_back(p > 0.5);
          p = (1.0 - share) * p + share * 0.5;
        }
        patterns.insert(pattern);
      }
      components.push_back(component);
    }
  }
  for (const std::vector<bool>& pattern : patterns) {
    std::vector<double> shows;
    for (const bool here : pattern) shows.push_back(here ? SHOWS_PROBABILITY : 1.0 - SHOWS_PROBABILITY);
    components.push_back(
        {hypothesis, WEIGHT_SAME_IN_ALL_TESTS / static_cast<double>(patterns.size()), {count_, shows}});
  }
  const double rest = known.empty() ? 1.0 : WEIGHT_ANY_CHANNELS;
  components.push_back({hypothesis, rest, {count_, std::vector<double>(channels.size(), 0.5)}});
}

void CauseTable::tabulate(std::size_t test) {
  std::set<std::vector<bool>> outcomes;
  for (const Component& component : components) {
    std::vector<bool> expected;
    for (const double p : component.shows[test]) expected.push_back(p > 0.5);
    outcomes.insert(expected);
  }
  Test table;
  std::vector<double> rest(components.size(), 1.0);
  for (const std::vector<bool>& outcome : outcomes) {
    std::vector<double> of;
    for (std::size_t p = 0; p < components.size(); ++p) {
      of.push_back(likelihood(components[p], test, outcome));
      rest[p] -= of.back();
    }
    table.likelihood.push_back(of);
  }
  for (double& r : rest) r = std::max(0.0, r);
  table.likelihood.push_back(rest);
  tests.push_back(table);
}

std::vector<bool> CauseTable::channelsOf(const Outcome& outcome) const {
  std::vector<bool> shows(channels.size(), false);
  std::istringstream words(outcome);
  for (std::string channel; words >> channel;) {
    const auto at = std::lower_bound(channels.begin(), channels.end(), channel);
    if (at != channels.end() && *at == channel) shows[static_cast<std::size_t>(at - channels.begin())] = true;
  }
  return shows;
}

double CauseTable::likelihood(const Component& component, std::size_t test,
                              const std::vector<bool>& shows) const {
  double product = 1.0;
  for (std::size_t c = 0; c < shows.size(); ++c)
    product *= shows[c] ? component.shows[test][c] : 1.0 - component.shows[test][c];
  return product;
}

}  // namespace smartmill::loadmeter
