#include "cause_table.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include "smartmill_core/math/normal.h"

namespace smartmill::loadmeter {
// Probability that a channel shows a cause whose size is larger by a factor. @param squares squared-gap
// reduction over the threshold
double CauseTable::showProbability(double squares, double factor) const {
  if (squares <= 0.0) return options_.channel_error;
  const double distance = std::log(squares * factor * factor) / options_.profile_std;
  return options_.channel_error + (1.0 - 2.0 * options_.channel_error) * normalCdf(distance);
}

CauseTable::CauseTable(const FleetCauses& fleet, const CauseTableOptions& options)
    : options_(options), count_(fleet.tests.size()) {
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
    for (int k = 1 - options_.size_steps; k < options_.size_steps; ++k) {
      const double factor =
          std::pow(options_.largest_size_ratio, static_cast<double>(k) / options_.size_steps);
      const double triangle =
          (1.0 - std::abs(static_cast<double>(k)) / options_.size_steps) / options_.size_steps;
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
  components.push_back(
      {hypothesis, 1.0, {count_, std::vector<double>(channels.size(), options_.false_alarm)}});
}

void CauseTable::addUnknownCause(std::size_t hypothesis) {
  const std::vector<Component> known = components;
  std::set<std::vector<bool>> patterns;
  const double causes = static_cast<double>(std::max<std::size_t>(1, hypothesis - 1));
  for (const Component& like : known) {
    for (const double share : options_.changed_shares) {
      Component component = like;
      component.hypothesis = hypothesis;
      component.weight *=
          options_.like_known / (causes * static_cast<double>(options_.changed_shares.size()));
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
    for (const bool here : pattern) shows.push_back(here ? options_.shows : 1.0 - options_.shows);
    components.push_back(
        {hypothesis, options_.same_in_all_tests / static_cast<double>(patterns.size()), {count_, shows}});
  }
  const double rest = known.empty() ? 1.0 : options_.any_channels;
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
