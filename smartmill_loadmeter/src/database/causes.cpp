#include "smartmill_loadmeter/database/causes.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "smartmill_core/formatted.h"

namespace smartmill::loadmeter {

namespace {

// Squares over the noise that a record must lose: explain names from a gain of 100 on. A force has thousands
// of samples a record, a load meter a mean or two.
constexpr double FORCE_SQUARES = 0.05, LOAD_SQUARES = 100.0;
constexpr double SUBSETS = 16.0;       // outcomes there may be: of fx, fy, fz, load_meter
constexpr double SILENT = 0.95;        // [1] of a machine's tests that show nothing where nothing is
const double ALONE = std::log(100.0);  // evidence against each rival
constexpr double TELLS = 1e-9;         // [nat] what rounding leaves

double oddsOf(std::size_t have, std::size_t of) {
  return (static_cast<double>(have) + 0.5) / (static_cast<double>(of - have) + 0.5);
}

/// What tests showed of a cause.
struct Shown {
  std::map<std::string, Outcomes> counts;  // by test
  bool alone = false;                      // from explanations that named it only
};

void count(const ModelImprovement& improvement, bool alone, Shown* shown) {
  if (shown->alone && !alone) return;
  if (alone && !shown->alone) *shown = {{}, true};
  for (const TestEvidence& t : evidenceOf(improvement)) shown->counts[t.test][outcomeOf(t)] += 1.0;
}

}  // namespace

Outcome outcomeOf(const TestEvidence& test) {
  Outcome outcome;
  for (const TestEvidence::Gap& g : test.gaps) {
    const double due = g.channel == "load_meter" ? LOAD_SQUARES : FORCE_SQUARES;
    if (g.before * g.before - g.after * g.after >= due) outcome += (outcome.empty() ? "" : " ") + g.channel;
  }
  return outcome;
}

FleetCauses fleetCauses(const std::vector<ModelImprovement>& improvements, const std::string& except) {
  std::set<std::string> explained, tests;
  std::map<std::string, std::set<std::string>> machines;
  std::map<std::string, Shown> shown;
  std::map<std::string, FoundCause> newest;
  for (const ModelImprovement& i : improvements) {
    if (i.machine == except) continue;
    explained.insert(i.machine);
    const std::vector<FoundCause> causes = causesOf(i);
    for (const FoundCause& cause : causes) {
      machines[cause.name].insert(i.machine);
      newest[cause.name] = cause;
      count(i, causes.size() == 1, &shown[cause.name]);
    }
  }
  FleetCauses fleet;
  fleet.explained = explained.size();
  fleet.other_odds = oddsOf(0, explained.size());
  for (const auto& [name, s] : shown) {
    for (const auto& [test, counts] : s.counts) tests.insert(test);
  }
  fleet.tests.assign(tests.begin(), tests.end());
  for (const auto& [name, who] : machines) {
    FleetCause cause{name, {who.begin(), who.end()}, oddsOf(who.size(), explained.size()), newest[name], {}};
    for (const std::string& test : fleet.tests) cause.outcomes.push_back(shown[name].counts[test]);
    fleet.causes.push_back(cause);
  }
  std::stable_sort(fleet.causes.begin(), fleet.causes.end(),
                   [](const FleetCause& a, const FleetCause& b) { return a.odds > b.odds; });
  return fleet;
}

CauseSearch::CauseSearch(const FleetCauses& fleet, const std::vector<double>& odds)
    : fleet_(fleet), probability_(odds), made_(fleet.tests.size(), false) {
  // Each beside none: probabilities in the ratio of their odds, and none as 1.
  probability_.push_back(1.0);
  probability_.push_back(fleet.other_odds);
  double sum = 0.0;
  for (const double p : probability_) sum += p;
  for (double& p : probability_) p /= sum;
  evidence_.assign(probability_.size(), 0.0);
}

double CauseSearch::likelihood(std::size_t hypothesis, std::size_t test, const Outcome& outcome) const {
  const std::size_t causes = fleet_.causes.size();
  if (hypothesis == causes) return (outcome.empty() ? SILENT : 0.0) + (1.0 - SILENT) / SUBSETS;
  // Perks' prior of a share; of few explanations little is known.
  const auto of = [&](const Outcomes& counts) {
    double sum = 0.0;
    for (const auto& [o, n] : counts) sum += n;
    const auto at = counts.find(outcome);
    return ((at == counts.end() ? 0.0 : at->second) + 1.0 / SUBSETS) / (sum + 1.0);
  };
  if (hypothesis < causes) return of(fleet_.causes[hypothesis].outcomes[test]);
  // One that nobody has met shows what the others do, each as likely, or anything.
  double mean = 1.0 / SUBSETS;
  for (const FleetCause& c : fleet_.causes) mean += of(c.outcomes[test]);
  return mean / static_cast<double>(causes + 1);
}

double CauseSearch::information(std::size_t test) const {
  std::set<Outcome> outcomes{""};
  for (const FleetCause& c : fleet_.causes) {
    for (const auto& [outcome, share] : c.outcomes[test]) outcomes.insert(outcome);
  }
  double gained = 0.0;
  for (const Outcome& o : outcomes) {
    double mixed = 0.0;
    for (std::size_t h = 0; h < probability_.size(); ++h) mixed += probability_[h] * likelihood(h, test, o);
    for (std::size_t h = 0; h < probability_.size(); ++h) {
      const double l = likelihood(h, test, o);
      if (probability_[h] > 0.0) gained += probability_[h] * l * std::log(l / mixed);
    }
  }
  return gained;
}

std::optional<std::size_t> CauseSearch::next() const {
  std::optional<std::size_t> best;
  double most = TELLS;
  for (std::size_t t = 0; t < made_.size(); ++t) {
    if (made_[t]) continue;
    const double gained = information(t);
    if (gained <= most) continue;
    most = gained;
    best = t;
  }
  return best;
}

void CauseSearch::saw(std::size_t test, const Outcome& outcome) {
  made_[test] = true;
  double sum = 0.0;
  for (std::size_t h = 0; h < probability_.size(); ++h) {
    const double l = likelihood(h, test, outcome);
    evidence_[h] += std::log(l);
    sum += probability_[h] *= l;
  }
  for (double& p : probability_) p /= sum;
}

std::optional<std::size_t> CauseSearch::alone() const {
  const auto best =
      static_cast<std::size_t>(std::max_element(evidence_.begin(), evidence_.end()) - evidence_.begin());
  if (best > fleet_.causes.size()) return std::nullopt;
  for (std::size_t h = 0; h < evidence_.size(); ++h) {
    if (h != best && evidence_[best] - evidence_[h] < ALONE) return std::nullopt;
  }
  return best;
}

std::vector<Proposal> proposalsFor(const std::string& machine,
                                   const std::vector<ModelImprovement>& improvements) {
  std::set<std::string> own;
  for (const ModelImprovement& i : improvements) {
    if (i.machine != machine) continue;
    for (const FoundCause& cause : causesOf(i)) own.insert(cause.name);
  }
  FleetCauses fleet = fleetCauses(improvements, machine);
  auto& causes = fleet.causes;
  causes.erase(std::remove_if(causes.begin(), causes.end(),
                              [&](const FleetCause& c) { return own.count(c.name) > 0; }),
               causes.end());
  std::vector<double> odds;
  for (const FleetCause& c : causes) odds.push_back(c.odds);
  CauseSearch search(fleet, odds);
  std::vector<Proposal> proposals;
  while (const auto test = search.alone() ? std::nullopt : search.next()) {
    Proposal p{fleet.tests[*test], search.information(*test), {}};
    for (std::size_t c = 0; c < causes.size(); ++c) {
      for (const auto& [outcome, share] : causes[c].outcomes[*test]) {
        if (outcome.empty()) continue;
        p.reasons.push_back(formatted("%s would show in %s (probability %.3f; %zu of %zu machines have it)",
                                      causes[c].newest.text().c_str(), outcome.c_str(),
                                      search.probabilities()[c], causes[c].machines.size(), fleet.explained));
      }
    }
    proposals.push_back(p);
    search.saw(*test, "");
  }
  return proposals;
}

}  // namespace smartmill::loadmeter
