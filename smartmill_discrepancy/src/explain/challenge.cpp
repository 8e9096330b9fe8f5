#include "smartmill_discrepancy/explain/challenge.h"

#include <algorithm>
#include <cmath>

#include "smartmill_discrepancy/explain/evidence_of_members.h"
#include "smartmill_discrepancy/results/formatted.h"
#include "smartmill_discrepancy/search/refinement.h"

namespace smartmill::discrepancy {
namespace {

// Whether two findings tell of the same place.
bool samePlace(const Finding& a, const Finding& b) {
  const auto near = [&](const char* key, double tolerance) {
    const auto x = a.location.find(key), y = b.location.find(key);
    return x == a.location.end() || y == b.location.end() ||
           std::abs(x->second / y->second - 1.0) < tolerance;
  };
  return a.channel == b.channel && a.domain == b.domain && near("order", 1e-6) && near("frequency_hz", 0.05);
}

// Squares of what is left at the very places (order, frequency, level, trend of a channel) where the trace
// lies.
double leftWhere(const TwinRunner& runner, const Trace& trace, const std::vector<Finding>& unexplained,
                 const StructureOptions& options) {
  constexpr double SHARE = 0.03;  // of the trace's squares, to count as its place
  StructureOptions of_trace = options;
  of_trace.squares_of_gap = 0.0;
  double left = 0.0;
  const std::vector<Finding> places = findStructure(runner, trace.values, of_trace);
  for (const Finding& f : unexplained) {
    if (std::any_of(places.begin(), places.end(), [&](const Finding& place) {
          return place.squares >= SHARE * trace.total && samePlace(place, f);
        }))
      left += f.squares;
  }
  return left;
}

// One cause that is missing shows at one place; what is left at many places, none of which stands out, speaks
// of a model too coarse, and not of an effect that stands for another.
bool atOnePlace(const std::vector<Finding>& unexplained) {
  constexpr double SHARE = 0.3;
  double all = 0.0, largest = 0.0;
  for (const Finding& f : unexplained) {
    all += f.squares;
    largest = std::max(largest, f.squares);
  }
  return largest > SHARE * all;
}

// How much speaks against a member; above 1 it stands for another cause.
double doubtOf(const Workbench& bench, const ExplainOptions& options, const StructureOptions& structure,
               const SearchResult& found, const std::vector<Finding>& unexplained, std::size_t member) {
  const Trace trace = traceOf(bench.exact(), found.best, member);
  const double rest = leftWhere(bench.fitted(), trace, unexplained, structure);
  const bool helps = heldoutReduction(bench, found.best.state, member) > options.least_heldout_reduction;
  options.search.say(formatted("  %s: tests differ by %.3g, left where it acts %.3g, contribution %.3g%s",
                               found.best.state.members[member].hypothesis->title().c_str(), trace.evenness,
                               rest, found.contribution[member],
                               helps ? ", helps where it was not fitted" : ""));
  const double uneven = helps ? 0.0 : trace.evenness / options.least_evenness;
  const double in_its_place =
      atOnePlace(unexplained) ? 2.0 * rest / std::max(found.contribution[member], 1.0) : 0.0;
  return std::max(uneven, in_its_place);
}

}  // namespace

void challenge(Workbench& bench, const ExplainOptions& options, const StructureOptions& structure,
               SearchResult* found, std::vector<Finding>* unexplained) {
  while (!unexplained->empty() && !found->best.state.members.empty()) {
    const std::vector<Member>& members = found->best.state.members;
    std::size_t worst = members.size();
    double most_doubt = 1.0;
    for (std::size_t m = 0; m < members.size(); ++m) {
      const double doubt = doubtOf(bench, options, structure, *found, *unexplained, m);
      if (doubt > most_doubt) {
        most_doubt = doubt;
        worst = m;
      }
    }
    if (worst == members.size()) return;
    options.search.say("  stands for another cause: " + members[worst].hypothesis->title());
    if (!refine(bench, without(found->best.state, worst), options.search, found)) return;
    *unexplained = findStructure(bench.fitted(), found->best.residual, structure);
  }
}

}  // namespace smartmill::discrepancy
