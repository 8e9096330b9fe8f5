#include "cause_table.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

namespace smartmill::loadmeter {
namespace {

constexpr int LEVELS = 8;               // of size on each side of an explanation's own
constexpr double REACH = 20.0;          // [1] largest ratio of two sizes of one cause
constexpr double PROFILE = 0.5;         // standard deviation of the logarithm of squares between two machines
constexpr double FLUKE = 0.02;          // [1] of places that show, or do not, for no reason
constexpr double FALSE_ALARM = 0.0125;  // [1] of places where nothing is
constexpr double OTHERWISE[] = {
    0.1, 0.33};  // share of places in which what nobody met differs from what it is like
constexpr double LIKE_KNOWN = 0.5, CONSTANT = 0.25, ANYTHING = 0.25;  // weights of what nobody met
constexpr double MOSTLY = 0.9;                                        // a constant cause shows where it does

// Probability that squares, over what is due, show in a machine whose cause is larger by a factor.
double showing(double squares, double factor) {
  if (squares <= 0.0) return FLUKE;
  const double distance = std::log(squares * factor * factor) / PROFILE;
  return FLUKE + (1.0 - 2.0 * FLUKE) * 0.5 * std::erfc(-distance / std::sqrt(2.0));
}

}  // namespace

CauseTable::CauseTable(const FleetCauses& fleet) : count_(fleet.tests.size()) {
  std::set<std::string> all;
  for (const FleetCause& c : fleet.causes) {
    for (const Showing& s : c.shown) {
      for (const auto& test : s) {
        for (const auto& [channel, squares] : test) all.insert(channel);
      }
    }
  }
  channels.assign(all.begin(), all.end());
  for (std::size_t c = 0; c < fleet.causes.size(); ++c) addCause(fleet.causes[c], c);
  addUnmet(fleet.causes.size() + 1);
  addNone(fleet.causes.size());
  for (std::size_t t = 0; t < count_; ++t) tabulate(t);
}

void CauseTable::addCause(const FleetCause& cause, std::size_t hypothesis) {
  // Of two sizes evenly spread over the logarithm the ratio has a triangle's.
  for (const Showing& seen : cause.shown) {
    for (int k = 1 - LEVELS; k < LEVELS; ++k) {
      const double factor = std::pow(REACH, static_cast<double>(k) / LEVELS);
      const double triangle = (1.0 - std::abs(static_cast<double>(k)) / LEVELS) / LEVELS;
      Part part{hypothesis, triangle / static_cast<double>(cause.shown.size()), {}};
      for (std::size_t t = 0; t < count_; ++t) {
        part.shows.emplace_back(channels.size(), 0.5);  // what was not measured may show
        for (const auto& [channel, squares] : seen[t]) {
          const auto at = std::lower_bound(channels.begin(), channels.end(), channel) - channels.begin();
          part.shows.back()[static_cast<std::size_t>(at)] = showing(squares, factor);
        }
      }
      parts.push_back(part);
    }
  }
}

void CauseTable::addNone(std::size_t hypothesis) {
  parts.push_back({hypothesis, 1.0, {count_, std::vector<double>(channels.size(), FALSE_ALARM)}});
}

void CauseTable::addUnmet(std::size_t hypothesis) {
  const std::vector<Part> known = parts;
  std::set<std::vector<bool>> patterns;
  const double causes = static_cast<double>(std::max<std::size_t>(1, hypothesis - 1));
  for (const Part& like : known) {
    for (const double share : OTHERWISE) {
      Part part = like;
      part.hypothesis = hypothesis;
      part.weight *= LIKE_KNOWN / (causes * static_cast<double>(std::size(OTHERWISE)));
      for (auto& test : part.shows) {
        std::vector<bool> pattern;
        for (double& p : test) {
          pattern.push_back(p > 0.5);
          p = (1.0 - share) * p + share * 0.5;
        }
        patterns.insert(pattern);
      }
      parts.push_back(part);
    }
  }
  for (const std::vector<bool>& pattern : patterns) {
    std::vector<double> shows;
    for (const bool here : pattern) shows.push_back(here ? MOSTLY : 1.0 - MOSTLY);
    parts.push_back({hypothesis, CONSTANT / static_cast<double>(patterns.size()), {count_, shows}});
  }
  const double rest = known.empty() ? 1.0 : ANYTHING;
  parts.push_back({hypothesis, rest, {count_, std::vector<double>(channels.size(), 0.5)}});
}

void CauseTable::tabulate(std::size_t test) {
  std::set<std::vector<bool>> outcomes;
  for (const Part& part : parts) {
    std::vector<bool> expected;
    for (const double p : part.shows[test]) expected.push_back(p > 0.5);
    outcomes.insert(expected);
  }
  Test table;
  std::vector<double> rest(parts.size(), 1.0);
  for (const std::vector<bool>& outcome : outcomes) {
    std::vector<double> of;
    for (std::size_t p = 0; p < parts.size(); ++p) {
      of.push_back(likelihood(parts[p], test, outcome));
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

double CauseTable::likelihood(const Part& part, std::size_t test, const std::vector<bool>& shows) const {
  double product = 1.0;
  for (std::size_t c = 0; c < shows.size(); ++c)
    product *= shows[c] ? part.shows[test][c] : 1.0 - part.shows[test][c];
  return product;
}

}  // namespace smartmill::loadmeter
