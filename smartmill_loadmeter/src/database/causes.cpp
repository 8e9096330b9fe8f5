#include "smartmill_loadmeter/database/causes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>

#include "cause_table.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/model/effect_catalogue.h"

namespace smartmill::loadmeter {

namespace {

// Squares over the noise that a record must lose: explain names from a gain of 100 on. A force has thousands
// of samples a record, a load meter a mean or two.
constexpr double FORCE_SQUARES = 0.05, LOAD_SQUARES = 100.0;
const double ALONE = std::log(100.0);  // evidence against each rival
constexpr double TELLS = 1e-9;         // [nat] what rounding leaves
constexpr std::size_t NEWEST = 8;      // explanations of a cause that are looked at

double dueOf(const std::string& channel) {
  return channel == "load_meter" ? LOAD_SQUARES : FORCE_SQUARES;
}

double jeffreys(std::size_t have, std::size_t of) {
  return (static_cast<double>(have) + 0.5) / (static_cast<double>(of - have) + 0.5);
}

/// Explanations of a cause, the newest last.
struct Shown {
  std::vector<const ModelImprovement*> by;
  bool alone = false;  // those that named it only

  void add(const ModelImprovement& improvement, bool is_alone) {
    if (alone && !is_alone) return;
    if (is_alone && !alone) *this = {{}, true};
    by.push_back(&improvement);
    if (by.size() > NEWEST) by.erase(by.begin());
  }
};

Showing showingOf(const ModelImprovement& improvement, const std::vector<std::string>& tests) {
  Showing showing(tests.size());
  for (const TestEvidence& t : evidenceOf(improvement)) {
    const auto at = std::lower_bound(tests.begin(), tests.end(), t.test) - tests.begin();
    for (const TestEvidence::Gap& g : t.gaps)
      showing[static_cast<std::size_t>(at)][g.channel] =
          std::max(0.0, g.before * g.before - g.after * g.after) / dueOf(g.channel);
  }
  return showing;
}

}  // namespace

Outcome outcomeOf(const TestEvidence& test) {
  Outcome outcome;
  for (const TestEvidence::Gap& g : test.gaps) {
    if (g.before * g.before - g.after * g.after >= dueOf(g.channel))
      outcome += (outcome.empty() ? "" : " ") + g.channel;
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
      shown[cause.name].add(i, causes.size() == 1);
    }
  }
  FleetCauses fleet;
  fleet.explained = explained.size();
  fleet.other_odds = jeffreys(0, explained.size());
  for (const auto& [name, s] : shown) {
    for (const ModelImprovement* i : s.by) {
      for (const TestEvidence& t : evidenceOf(*i)) tests.insert(t.test);
    }
  }
  fleet.tests.assign(tests.begin(), tests.end());
  for (const auto& [name, who] : machines) {
    FleetCause cause{
        name, {who.begin(), who.end()}, jeffreys(who.size(), explained.size()), newest[name], {}};
    for (const ModelImprovement* i : shown[name].by) cause.shown.push_back(showingOf(*i, fleet.tests));
    fleet.causes.push_back(cause);
  }
  std::stable_sort(fleet.causes.begin(), fleet.causes.end(),
                   [](const FleetCause& a, const FleetCause& b) { return a.odds > b.odds; });
  return fleet;
}

CauseOdds oddsOf(const FleetCauses& fleet) {
  CauseOdds odds;
  odds.machines = fleet.explained;
  odds.other = fleet.other_odds;
  for (const FleetCause& c : fleet.causes) {
    if (findEffect(c.name)) odds.listed[c.name] = c.odds;
  }
  return odds;
}

CauseSearch::CauseSearch(const FleetCauses& fleet, const std::vector<double>& odds)
    : table_(std::make_shared<CauseTable>(fleet)), prior_(odds), made_(fleet.tests.size(), false) {
  // Each beside none: probabilities in the ratio of their odds, and none as 1.
  prior_.push_back(1.0);
  prior_.push_back(fleet.other_odds);
  const double sum = std::accumulate(prior_.begin(), prior_.end(), 0.0);
  for (double& p : prior_) p /= sum;
  for (const CauseTable::Part& part : table_->parts) parts_.push_back(std::log(part.weight));
  weigh();
}

// From the parts' likelihoods: of the hypotheses, and what is probable now.
void CauseSearch::weigh() {
  evidence_.assign(prior_.size(), -std::numeric_limits<double>::infinity());
  std::vector<double> most = evidence_;
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    double& m = most[table_->parts[p].hypothesis];
    m = std::max(m, parts_[p]);
  }
  std::vector<double> sums(prior_.size(), 0.0);
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    const std::size_t h = table_->parts[p].hypothesis;
    sums[h] += std::exp(parts_[p] - most[h]);
  }
  for (std::size_t h = 0; h < sums.size(); ++h) evidence_[h] = most[h] + std::log(sums[h]);
  const double largest = *std::max_element(evidence_.begin(), evidence_.end());
  probability_.clear();
  double sum = 0.0;
  for (std::size_t h = 0; h < sums.size(); ++h) {
    probability_.push_back(prior_[h] * std::exp(evidence_[h] - largest));
    sum += probability_.back();
  }
  for (double& p : probability_) p /= sum;
  now_.clear();
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    const std::size_t h = table_->parts[p].hypothesis;
    now_.push_back(probability_[h] * std::exp(parts_[p] - evidence_[h]));
  }
}

double CauseSearch::information(std::size_t test) const {
  const CauseTable::Test& of = table_->tests[test];
  double gained = 0.0;
  for (const std::vector<double>& likelihoods : of.likelihood) {
    std::vector<double> joint(probability_.size(), 0.0);
    for (std::size_t p = 0; p < now_.size(); ++p)
      joint[table_->parts[p].hypothesis] += now_[p] * likelihoods[p];
    const double mixed = std::accumulate(joint.begin(), joint.end(), 0.0);
    for (std::size_t h = 0; h < joint.size(); ++h) {
      if (joint[h] > 0.0) gained += joint[h] * std::log(joint[h] / (mixed * probability_[h]));
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
  const std::vector<bool> shows = table_->channelsOf(outcome);
  for (std::size_t p = 0; p < parts_.size(); ++p)
    parts_[p] += std::log(table_->likelihood(table_->parts[p], test, shows));
  weigh();
}

std::optional<std::size_t> CauseSearch::alone() const {
  const auto best =
      static_cast<std::size_t>(std::max_element(evidence_.begin(), evidence_.end()) - evidence_.begin());
  if (best + 1 == evidence_.size()) return std::nullopt;
  for (std::size_t h = 0; h < evidence_.size(); ++h) {
    if (h != best && evidence_[best] - evidence_[h] < ALONE) return std::nullopt;
  }
  return best;
}

namespace {

// What its explanations showed in a test, each once; not where they showed nothing.
std::set<Outcome> outcomesOf(const FleetCause& cause, std::size_t test) {
  std::set<Outcome> all;
  for (const Showing& showing : cause.shown) {
    Outcome outcome;
    for (const auto& [channel, squares] : showing[test]) {
      if (squares >= 1.0) outcome += (outcome.empty() ? "" : " ") + channel;
    }
    if (!outcome.empty()) all.insert(outcome);
  }
  return all;
}

}  // namespace

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
      for (const Outcome& outcome : outcomesOf(causes[c], *test)) {
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
