#include "smartmill_discrepancy/search/standing.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>
#include <vector>

namespace smartmill::discrepancy {
namespace {

std::vector<AskedTest> askedBy(const TwinRunner& runner, const std::vector<double>& better,
                               const std::vector<double>& other) {
  std::vector<double> between(runner.size()), left(runner.size());
  for (std::size_t i = 0; i < between.size(); ++i) {
    between[i] = better[i] - other[i];
    left[i] = runner.measured()[i] - better[i];
  }
  return askedIn(runner, between.data(), left.data());
}

// What a state says of the fit tests, its records where they lie by its own turns, while the bench's lie by
// those of another: its other values were found with them.
std::vector<double> saidWhereItLies(const Workbench& bench, const FitState& state, const FitState& turned) {
  const TwinRunner& runner = bench.fitted();
  const MachineModel model = bench.exact().model(state);
  SimulatedBlocks said = runner.simulateBlocks({model}).front();
  const std::vector<Fitter::TurnOf>& turns = bench.quick().turns();
  const auto at = [](const FitState& s, std::size_t k) { return s.turns.empty() ? 0.0 : s.turns[k]; };
  std::map<std::size_t, Turn> by_test;
  for (std::size_t k = 0; k < turns.size(); ++k) {
    const double by = at(state, k) - at(turned, k);
    if (by != 0.0) by_test[turns[k].chosen].*turns[k].freedom.value = by;
  }
  const std::vector<std::pair<std::size_t, Turn>> moved(by_test.begin(), by_test.end());
  const SimulatedBlocks base = said;
  runParallel(moved.size(), runner.threads(), [&](std::size_t m) {
    const auto& [chosen, by] = moved[m];
    const SimulatedBlocks there = runner.turned(model, base, chosen, by);
    for (std::size_t b = 0; b < there.size(); ++b) {
      if (runner.blocks()[b].test == runner.tests()[chosen]) said[b] = there[b];
    }
  });
  return runner.joined(said);
}

// Where structure is left, stated values are pulled by it too: its variance is that of the residuals.
AskedTest askedByStated(const NominalFreedom& freedom, const FitState& better, const FitState& other,
                        double variance) {
  AskedTest asked;
  const std::vector<Coordinate>& free = freedom.coordinates();
  for (std::size_t c = 0; c < free.size(); ++c) {
    const double d = (better.nominal[c] - other.nominal[c]) / free[c].prior_std;
    asked.squares += d * d;
    asked.product += d * (free[c].null - better.nominal[c]) / free[c].prior_std;
  }
  asked.variance = variance * asked.squares;
  return asked;
}

}  // namespace

AskedShare sharedBy(const std::vector<AskedTest>& tests) {
  double squares = 0.0, product = 0.0;
  for (const AskedTest& t : tests) {
    squares += t.squares;
    product += t.product;
  }
  if (squares <= 0.0) return {0.5, std::numeric_limits<double>::infinity()};
  return {1.0 + product / squares, std::sqrt(varianceOfProducts(tests)) / squares};
}

std::vector<AskedTest> askedIn(const TwinRunner& runner, const double* between, const double* left) {
  std::map<std::size_t, AskedTest> by_test;
  for (const Block& b : runner.blocks()) by_test[b.test].add(between + b.offset, left + b.offset, b.size);
  std::vector<AskedTest> all;
  for (const auto& [test, asked] : by_test) all.push_back(asked);
  return all;
}

AskedShare fittedShare(const Fitter& fitter, const Fit& better, const Fit& other) {
  std::vector<double> between(better.residual.size());
  for (std::size_t i = 0; i < between.size(); ++i) between[i] = other.residual[i] - better.residual[i];
  std::vector<AskedTest> tests = askedIn(fitter.runner(), between.data(), better.residual.data());
  const double variance = std::max(1.0, better.chi2 / static_cast<double>(fitter.runner().size()));
  tests.push_back(askedByStated(fitter.freedom(), better.state, other.state, variance));
  return sharedBy(tests);
}

const AskedShare& Standing::weaker() const {
  if (!std::isfinite(heldout.std_dev)) return fitted;
  return heldout.beyond() / HELDOUT_BEYOND < fitted.beyond() / FITTED_BEYOND ? heldout : fitted;
}

double Standing::confidence() const {
  const double beyond =
      std::isfinite(heldout.std_dev) ? std::min(heldout.beyond(), fitted.beyond()) : fitted.beyond();
  return 0.5 * std::erfc(-beyond / std::sqrt(2.0));
}

bool Standing::holds() const {
  const bool told = std::isfinite(heldout.std_dev);
  return holdsInFitted(fitted) && (!told || heldout.beyond() > HELDOUT_BEYOND);
}

Standing standingOf(const Workbench& bench, const FitState& better, const FitState& other) {
  constexpr double TELLS = 25.0;  // squares over the noise
  const auto held = bench.heldout().simulate({bench.exact().model(better), bench.exact().model(other)});
  const std::vector<AskedTest> heldout = askedBy(bench.heldout(), held[0], held[1]);
  const std::vector<double> said = bench.fitted().simulate(bench.exact().model(better));
  std::vector<AskedTest> fitted = askedBy(bench.fitted(), said, saidWhereItLies(bench, other, better));
  const double variance = std::max(1.0, squaresLeft(bench.fitted(), said) / bench.samples());
  fitted.push_back(askedByStated(bench.freedom(), better, other, variance));
  const double squares = std::accumulate(heldout.begin(), heldout.end(), 0.0,
                                         [](double sum, const AskedTest& t) { return sum + t.squares; });
  return {sharedBy(squares < TELLS ? std::vector<AskedTest>{} : heldout), sharedBy(fitted)};
}

double heldoutReduction(const Workbench& bench, const FitState& better, const FitState& other) {
  const TwinRunner& heldout = bench.heldout();
  const auto above = [&](const FitState& state) {
    return squaresLeft(heldout, heldout.simulate(bench.exact().model(state))) -
           static_cast<double>(heldout.size());
  };
  const double with = above(better), without_it = above(other);
  return without_it > 0.0 ? std::clamp(1.0 - std::max(with, 0.0) / without_it, -1.0, 1.0) : 0.0;
}

}  // namespace smartmill::discrepancy
