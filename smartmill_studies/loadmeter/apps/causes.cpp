// rosrun smartmill_studies loadmeter_causes: number of tests needed to identify the cause of a machine, with
// and without the causes found before in its shop. The signature of each cause in each test comes from
// reports of `explain`; the sizes are random and scale the signatures.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <random>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_loadmeter/database/causes.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::loadmeter;  // NOLINT
using nlohmann::json;

constexpr double SAMPLES = 3840.0;  // of a record of 0.15 s at 25.6 kHz

struct Options {
  std::vector<std::string> reports;
  int shops = 200, explained = 30, newcomers = 50;
  double ratio = 0.6, scatter = 0.0;
  unsigned seed = 1;
};

/// One machine: a cause (the number of a report) of a size.
class Draw {
 public:
  Draw(const std::vector<ModelImprovement>& causes, const Options& o)
      : causes_(causes), random_(o.seed), scatter_(o.scatter) {
    for (std::size_t c = 0; c < causes.size(); ++c) weights_.push_back(std::pow(o.ratio, double(c)));
  }
  /// The frequencies of the causes differ from shop to shop.
  void newShop() { std::shuffle(weights_.begin(), weights_.end(), random_); }
  std::size_t cause() {
    return std::discrete_distribution<std::size_t>(weights_.begin(), weights_.end())(random_);
  }
  /// 0: the most frequent of this shop
  std::size_t rankOf(std::size_t cause) const {
    return static_cast<std::size_t>(
        std::count_if(weights_.begin(), weights_.end(), [&](double w) { return w > weights_[cause]; }));
  }
  /// Signature of a machine over the complete plan: the squares over the noise are proportional to the
  /// squared size, with variance 4 m / n about their mean m over n samples (noncentral chi-square). Each
  /// square may differ from the report by a random factor (log-normal).
  ModelImprovement machine(const std::string& name, std::size_t cause) {
    const double size =
        std::exp(std::uniform_real_distribution<double>(std::log(0.1), std::log(1.5))(random_));
    std::normal_distribution<double> normal;
    ModelImprovement drawn = causes_[cause];
    drawn.machine = name;
    json tests = json::parse(drawn.tests);
    for (json& test : tests) {
      for (auto& [channel, gap] : test["gaps"].items()) {
        const double before = gap[0], after = gap[1];
        double lost = std::max(0.0, before * before - after * after) * size * size;
        if (scatter_ > 0.0) lost *= std::exp(scatter_ * normal(random_));
        lost += std::sqrt(4.0 * lost / (channel == "load_meter" ? 1.0 : SAMPLES)) * normal(random_);
        gap = {std::sqrt(std::max(0.0, 1.0 + lost)), 1.0};
      }
    }
    drawn.tests = tests.dump();
    return drawn;
  }

 private:
  const std::vector<ModelImprovement>& causes_;
  std::mt19937_64 random_;
  double scatter_;  // [1] standard deviation of the logarithm
  std::vector<double> weights_;
};

/// Counts of one method to choose tests.
struct Count {
  int machines = 0, right = 0, wrong = 0;
  double tests = 0.0;  // of correctly named machines

  void print(const char* name) const {
    std::printf("%-44s %6d %6d %6d %8.2f\n", name, machines, right, wrong, right ? tests / right : 0.0);
  }
};

enum class TestOrder { fleet, alone, plan };

/// @param search initial state of the search @param expected index of the truth among the fleet's causes;
/// causes.size() + 1: none of these
void identify(CauseSearch search, const std::vector<std::string>& tests, const ModelImprovement& machine,
              std::size_t expected, TestOrder order, const std::vector<Count*>& counts) {
  std::map<std::string, Outcome> shows;
  for (const TestEvidence& t : evidenceOf(machine)) shows[t.test] = outcomeOf(t);
  for (Count* count : counts) ++count->machines;
  for (std::size_t made = 0; made <= tests.size(); ++made) {
    if (const auto alone = search.acceptedHypothesis()) {
      for (Count* count : counts) {
        (*alone == expected ? count->right : count->wrong) += 1;
        if (*alone == expected) count->tests += static_cast<double>(made);
      }
      return;
    }
    const auto test = order == TestOrder::plan ? std::optional<std::size_t>(made) : search.next();
    if (!test || *test >= tests.size()) return;
    search.addOutcome(*test, shows[tests[*test]]);
  }
}

void run(const Options& o) {
  std::vector<ModelImprovement> causes;
  for (const std::string& report : o.reports) {
    const ModelImprovement i = readImprovement(report);
    const auto named = causesOf(i);
    if (named.size() != 1)
      throw Error(report + ": names " + std::to_string(named.size()) + " causes, expected one");
    causes.push_back(i);
  }
  Draw draw(causes, o);
  std::map<TestOrder, Count> all, frequent, rare, unmet;
  for (int s = 0; s < o.shops; ++s) {
    draw.newShop();
    std::vector<ModelImprovement> known;
    for (int m = 0; m < o.explained; ++m)
      known.push_back(draw.machine("m" + std::to_string(m), draw.cause()));
    const FleetCauses fleet = fleetCauses(known, "");
    std::vector<double> odds;
    for (const FleetCause& c : fleet.causes) odds.push_back(c.odds);
    const CauseSearch by_fleet(fleet, odds),
        by_none(fleet, std::vector<double>(odds.size(), 1.0 / static_cast<double>(odds.size())));
    for (int m = 0; m < o.newcomers; ++m) {
      const std::size_t truth = draw.cause();
      const ModelImprovement machine = draw.machine("new", truth);
      const std::string name = causesOf(causes[truth]).at(0).name;
      const auto at = std::find_if(fleet.causes.begin(), fleet.causes.end(),
                                   [&](const FleetCause& c) { return c.name == name; });
      const bool met = at != fleet.causes.end();
      const auto expected =
          met ? static_cast<std::size_t>(at - fleet.causes.begin()) : fleet.causes.size() + 1;
      for (const TestOrder order : {TestOrder::fleet, TestOrder::alone, TestOrder::plan}) {
        identify(order == TestOrder::fleet ? by_fleet : by_none, fleet.tests, machine, expected, order,
                 {&all[order], &(!met                     ? unmet
                                 : draw.rankOf(truth) < 2 ? frequent
                                                          : rare)[order]});
      }
    }
  }
  std::printf(
      "%zu causes, %d shops, %d machines explained in each, %d more to identify\n%-44s %6s %6s %6s %8s\n",
      causes.size(), o.shops, o.explained, o.newcomers, "", "all", "right", "wrong", "tests");
  struct Group {
    std::string name;
    std::map<TestOrder, Count>& counts;
  };
  for (const Group& group : {Group{"all", all}, Group{"the two most frequent causes", frequent},
                             Group{"rarer ones", rare}, Group{"never met before", unmet}}) {
    group.counts[TestOrder::fleet].print((group.name + ", tests by the fleet's prior").c_str());
    group.counts[TestOrder::alone].print((group.name + ", each cause as likely").c_str());
    group.counts[TestOrder::plan].print((group.name + ", in the plan's order").c_str());
  }
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  CommandLine line(
      "Number of tests needed to identify the cause of a machine, with and without the causes found in its "
      "shop.");
  line.option("REPORT", o.reports, "of `explain`, each naming one cause").required();
  line.option("--shops", o.shops).showDefault().within(1, 100000);
  line.option("--explained", o.explained, "machines of a shop explained before")
      .showDefault()
      .within(1, 1000);
  line.option("--newcomers", o.newcomers, "machines of a shop to identify").showDefault().within(1, 1000);
  line.option("--ratio", o.ratio, "frequency of each cause to the next more frequent one")
      .showDefault()
      .within(0.01, 1.0);
  line.option("--scatter", o.scatter,
              "standard deviation of the logarithm of a machine's squares over the report's")
      .showDefault()
      .within(0.0, 3.0);
  line.option("--seed", o.seed, "of the draws").showDefault();
  return runProgram(line, argc, argv, [&] { run(o); });
}
