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

// Squared-gap reduction that identifies a cause in a single record: `explain` names a cause from a gain of
// 100 on. A force record has thousands of samples, a load-meter record one or two independent means.
constexpr double FORCE_SQUARES = 0.05, LOAD_SQUARES = 100.0;
const double ACCEPTANCE = std::log(100.0);      // evidence against each other hypothesis
constexpr double LEAST_INFORMATION = 1e-9;      // [nat] rounding error
constexpr std::size_t NEWEST_EXPLANATIONS = 8;  // explanations of a cause that are used

double thresholdOf(const std::string& channel) {
  return channel == "load_meter" ? LOAD_SQUARES : FORCE_SQUARES;
}

double jeffreysOdds(std::size_t have, std::size_t of) {
  return (static_cast<double>(have) + 0.5) / (static_cast<double>(of - have) + 0.5);
}

/// Explanations of a cause, newest last.
struct Explanations {
  std::vector<const ModelImprovement*> by;
  bool single_cause = false;  // all of them named this cause only

  void add(const ModelImprovement& improvement, bool is_alone) {
    if (single_cause && !is_alone) return;
    if (is_alone && !single_cause) *this = {{}, true};
    by.push_back(&improvement);
    if (by.size() > NEWEST_EXPLANATIONS) by.erase(by.begin());
  }
};

EvidenceProfile profileOf(const ModelImprovement& improvement, const std::vector<std::string>& tests) {
  EvidenceProfile profile(tests.size());
  for (const TestEvidence& t : evidenceOf(improvement)) {
    const auto at = std::lower_bound(tests.begin(), tests.end(), t.test) - tests.begin();
    for (const TestEvidence::Gap& g : t.gaps)
      profile[static_cast<std::size_t>(at)][g.channel] =
          std::max(0.0, g.before * g.before - g.after * g.after) / thresholdOf(g.channel);
  }
  return profile;
}

}  // namespace

Outcome outcomeOf(const TestEvidence& test) {
  Outcome outcome;
  for (const TestEvidence::Gap& g : test.gaps) {
    if (g.before * g.before - g.after * g.after >= thresholdOf(g.channel))
      outcome += (outcome.empty() ? "" : " ") + g.channel;
  }
  return outcome;
}

FleetCauses fleetCauses(const std::vector<ModelImprovement>& improvements, const std::string& except) {
  std::set<std::string> explained, tests;
  std::map<std::string, std::set<std::string>> machines;
  std::map<std::string, Explanations> profiles;
  std::map<std::string, FoundCause> newest;
  for (const ModelImprovement& i : improvements) {
    if (i.machine == except) continue;
    explained.insert(i.machine);
    const std::vector<FoundCause> causes = causesOf(i);
    for (const FoundCause& cause : causes) {
      machines[cause.name].insert(i.machine);
      newest[cause.name] = cause;
      profiles[cause.name].add(i, causes.size() == 1);
    }
  }
  FleetCauses fleet;
  fleet.explained = explained.size();
  fleet.other_odds = jeffreysOdds(0, explained.size());
  for (const auto& [name, s] : profiles) {
    for (const ModelImprovement* i : s.by) {
      for (const TestEvidence& t : evidenceOf(*i)) tests.insert(t.test);
    }
  }
  fleet.tests.assign(tests.begin(), tests.end());
  for (const auto& [name, who] : machines) {
    FleetCause cause{
        name, {who.begin(), who.end()}, jeffreysOdds(who.size(), explained.size()), newest[name], {}};
    for (const ModelImprovement* i : profiles[name].by) cause.profiles.push_back(profileOf(*i, fleet.tests));
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
    : table_(std::make_shared<CauseTable>(fleet)), prior_(odds), is_done_(fleet.tests.size(), false) {
  // Prior probabilities in the ratio of the odds; the hypothesis of no cause has odds 1.
  prior_.push_back(1.0);
  prior_.push_back(fleet.other_odds);
  const double sum = std::accumulate(prior_.begin(), prior_.end(), 0.0);
  for (double& p : prior_) p /= sum;
  for (const CauseTable::Component& component : table_->components)
    log_weights_.push_back(std::log(component.weight));
  updateProbabilities();
}

// Updates the evidence and the probabilities of hypotheses and components.
void CauseSearch::updateProbabilities() {
  evidence_.assign(prior_.size(), -std::numeric_limits<double>::infinity());
  std::vector<double> most = evidence_;
  for (std::size_t p = 0; p < log_weights_.size(); ++p) {
    double& m = most[table_->components[p].hypothesis];
    m = std::max(m, log_weights_[p]);
  }
  std::vector<double> sums(prior_.size(), 0.0);
  for (std::size_t p = 0; p < log_weights_.size(); ++p) {
    const std::size_t h = table_->components[p].hypothesis;
    sums[h] += std::exp(log_weights_[p] - most[h]);
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
  component_probability_.clear();
  for (std::size_t p = 0; p < log_weights_.size(); ++p) {
    const std::size_t h = table_->components[p].hypothesis;
    component_probability_.push_back(probability_[h] * std::exp(log_weights_[p] - evidence_[h]));
  }
}

double CauseSearch::information(std::size_t test) const {
  const CauseTable::Test& of = table_->tests[test];
  double gained = 0.0;
  for (const std::vector<double>& likelihoods : of.likelihood) {
    std::vector<double> joint(probability_.size(), 0.0);
    for (std::size_t p = 0; p < component_probability_.size(); ++p)
      joint[table_->components[p].hypothesis] += component_probability_[p] * likelihoods[p];
    const double mixed = std::accumulate(joint.begin(), joint.end(), 0.0);
    for (std::size_t h = 0; h < joint.size(); ++h) {
      if (joint[h] > 0.0) gained += joint[h] * std::log(joint[h] / (mixed * probability_[h]));
    }
  }
  return gained;
}

std::optional<std::size_t> CauseSearch::next() const {
  std::optional<std::size_t> best;
  double most = LEAST_INFORMATION;
  for (std::size_t t = 0; t < is_done_.size(); ++t) {
    if (is_done_[t]) continue;
    const double gained = information(t);
    if (gained <= most) continue;
    most = gained;
    best = t;
  }
  return best;
}

void CauseSearch::addOutcome(std::size_t test, const Outcome& outcome) {
  is_done_[test] = true;
  const std::vector<bool> shows = table_->channelsOf(outcome);
  for (std::size_t p = 0; p < log_weights_.size(); ++p)
    log_weights_[p] += std::log(table_->likelihood(table_->components[p], test, shows));
  updateProbabilities();
}

std::optional<std::size_t> CauseSearch::acceptedHypothesis() const {
  const auto best =
      static_cast<std::size_t>(std::max_element(evidence_.begin(), evidence_.end()) - evidence_.begin());
  if (best + 1 == evidence_.size()) return std::nullopt;
  for (std::size_t h = 0; h < evidence_.size(); ++h) {
    if (h != best && evidence_[best] - evidence_[h] < ACCEPTANCE) return std::nullopt;
  }
  return best;
}

namespace {

// Distinct nonempty outcomes of a cause's explanations in a test.
std::set<Outcome> outcomesOf(const FleetCause& cause, std::size_t test) {
  std::set<Outcome> all;
  for (const EvidenceProfile& profile : cause.profiles) {
    Outcome outcome;
    for (const auto& [channel, squares] : profile[test]) {
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
  while (const auto test = search.acceptedHypothesis() ? std::nullopt : search.next()) {
    Proposal p{fleet.tests[*test], search.information(*test), {}};
    for (std::size_t c = 0; c < causes.size(); ++c) {
      for (const Outcome& outcome : outcomesOf(causes[c], *test)) {
        p.reasons.push_back(formatted("%s would show in %s (probability %.3f; found on %zu of %zu machines)",
                                      causes[c].newest.text().c_str(), outcome.c_str(),
                                      search.probabilities()[c], causes[c].machines.size(), fleet.explained));
      }
    }
    proposals.push_back(p);
    search.addOutcome(*test, "");
  }
  return proposals;
}

}  // namespace smartmill::loadmeter
