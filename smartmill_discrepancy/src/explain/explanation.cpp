#include "smartmill_discrepancy/explain/explanation.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>

#include <Eigen/Eigenvalues>

#include "smartmill_core/error.h"
#include "smartmill_discrepancy/data/labels.h"
#include "smartmill_discrepancy/data/phase.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

constexpr double TWIN_ACCURACY = 2e-4;  // share of a value by which two faithful simulations differ

double squaresOf(const std::vector<double>& v) {
  double s = 0.0;
  for (const double x : v) s += x * x;
  return s;
}

std::vector<double> residualOf(const TwinRunner& runner, const MachineModel& model) {
  std::vector<double> r = runner.simulate(model);
  for (std::size_t i = 0; i < r.size(); ++i) r[i] = runner.measured()[i] - r[i];
  return r;
}

double gapOf(const std::vector<double>& residual) {
  return residual.empty() ? 0.0 : std::sqrt(squaresOf(residual) / static_cast<double>(residual.size()));
}

// How an effect shows: squares of its trace by channel, and how evenly the tests agree on its size.
struct Trace {
  std::vector<double> values;
  double total = 0.0, evenness = 0.0;
};

Trace traceOf(const Fitter& fitter, const Fit& fit, std::size_t member) {
  FitState less = fit.state;
  less.members.erase(less.members.begin() + static_cast<std::ptrdiff_t>(member));
  const auto simulated = fitter.runner().simulate({fitter.model(fit.state), fitter.model(less)});
  Trace trace;
  trace.values.resize(fitter.runner().size());
  std::map<std::size_t, std::pair<double, double>> by_test;  // squares, product with the residual
  for (const Block& b : fitter.runner().blocks()) {
    for (std::size_t i = b.offset; i < b.offset + b.size; ++i) {
      const double s = simulated[0][i] - simulated[1][i];
      trace.values[i] = s;
      trace.total += s * s;
      by_test[b.test].first += s * s;
      by_test[b.test].second += s * fit.residual[i];
    }
  }
  if (trace.total <= 0.0) return trace;
  double variance = 0.0, count = 0.0;
  for (const auto& [test, sums] : by_test) {
    if (sums.first < 1e-6 * trace.total) continue;
    variance += sums.second * sums.second / sums.first;
    count += 1.0;
  }
  trace.evenness = std::max(0.0, (variance - count) / trace.total);
  return trace;
}

// Vuong's comparison of two models over the tests that tell them apart.
double confidenceBetween(const Fitter& fitter, const FitState& better, const FitState& other) {
  const TwinRunner& runner = fitter.runner();
  const auto simulated = runner.simulate({fitter.model(better), fitter.model(other)});
  std::map<std::size_t, std::pair<double, double>> by_test;  // gain, squares between the two
  for (const Block& b : runner.blocks()) {
    auto& [gain, between] = by_test[b.test];
    for (std::size_t i = b.offset; i < b.offset + b.size; ++i) {
      const double m = runner.measured()[i], x = simulated[0][i], y = simulated[1][i];
      gain += (m - y) * (m - y) - (m - x) * (m - x);
      between += (x - y) * (x - y);
    }
  }
  // A gain of one test that is far beyond the others' counts no more than they do.
  double sum = 0.0, squares = 0.0;
  for (const auto& [test, values] : by_test) {
    if (values.second < 4.0) continue;  // nothing that the noise would not hide
    const double vote = values.first / std::sqrt(values.second * (4.0 + values.second));
    sum += vote;
    squares += vote * vote;
  }
  return squares > 0.0 ? 0.5 * std::erfc(-sum / std::sqrt(2.0 * squares)) : 0.5;
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
    for (const Finding& place : places) {
      if (place.channel != f.channel || place.domain != f.domain || place.squares < SHARE * trace.total)
        continue;
      const auto near = [&](const char* key, double tolerance) {
        const auto a = place.location.find(key), b = f.location.find(key);
        return a == place.location.end() || b == f.location.end() ||
               std::abs(a->second / b->second - 1.0) < tolerance;
      };
      if (near("order", 1e-6) && near("frequency_hz", 0.05)) {
        left += f.squares;
        break;
      }
    }
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

FitState without(const FitState& state, std::size_t member) {
  FitState less = state;
  less.members.erase(less.members.begin() + static_cast<std::ptrdiff_t>(member));
  return less;
}

// Standard deviations of the keys of a member's entry: root mean square of what they differ by at points that
// have the covariance of the coordinates. Straight tangents would say nothing of the size of a vector of
// which only one direction is known.
std::vector<FoundParameter> parametersOf(const Member& member, const Eigen::MatrixXd& covariance) {
  const auto numbers = numbersOf(member.hypothesis->entry(member.values));
  const Eigen::Index count = covariance.cols();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(covariance);
  Eigen::VectorXd variance = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(numbers.size()));
  for (Eigen::Index k = 0; k < count; ++k) {
    const double reach = std::sqrt(static_cast<double>(count) * std::max(axes.eigenvalues()[k], 0.0));
    for (const double sign : {-1.0, 1.0}) {
      std::vector<double> moved = member.values;
      for (std::size_t c = 0; c < moved.size(); ++c) {
        const Coordinate& limits = member.hypothesis->coordinates[c];
        moved[c] = std::clamp(moved[c] + sign * reach * axes.eigenvectors()(static_cast<Eigen::Index>(c), k),
                              limits.low, limits.high);
      }
      const auto other = numbersOf(member.hypothesis->entry(moved));
      if (other.size() != numbers.size()) continue;
      for (std::size_t n = 0; n < numbers.size(); ++n) {
        double difference = other[n].second - numbers[n].second;
        if (numbers[n].first == "angle_deg") difference = std::remainder(difference, 360.0);
        variance[static_cast<Eigen::Index>(n)] +=
            difference * difference / (2.0 * static_cast<double>(count));
      }
    }
  }
  std::vector<FoundParameter> parameters;
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    const double own = TWIN_ACCURACY * (numbers[k].first == "angle_deg" ? 57.3 : numbers[k].second);
    parameters.push_back(
        {numbers[k].first, numbers[k].second, std::sqrt(variance[static_cast<Eigen::Index>(k)] + own * own)});
  }
  return parameters;
}

void writeStdDevs(EffectEntry& entry, const std::vector<FoundParameter>& parameters) {
  for (const FoundParameter& p : parameters) {
    if (entry.numbers.count(p.key)) entry.std_devs[p.key] = p.std_dev;
  }
  const auto setModes = [&](const std::string& axis, ModalModel& modes) {
    for (std::size_t k = 0; k < modes.modes.size(); ++k) {
      const std::string name = axis + "[" + std::to_string(k) + "].";
      for (const FoundParameter& p : parameters) {
        if (p.key == name + "frequency_hz") modes.modes[k].frequency_std = p.std_dev;
        if (p.key == name + "damping_ratio") modes.modes[k].damping_ratio_std = p.std_dev;
        if (p.key == name + "stiffness_n_per_um")
          modes.modes[k].gain_std = modes.modes[k].gain * p.std_dev / p.value;
      }
    }
  };
  setModes("x", entry.flexibility.x);
  setModes("y", entry.flexibility.y);
}

// Chi-square statistic of noise alone varies by sqrt(2 / n).
double floorDeviation(std::size_t samples) {
  return samples ? std::sqrt(0.5 / static_cast<double>(samples)) : 0.0;
}

// Cuts that chatter speak for a model that chatters in them.
void addChatter(const Dataset& data, Explanation* result) {
  sim::SimulationOptions options;
  options.noise = false;
  for (const ChatteringTest& c : data.chattering) {
    const auto chatters = [&](const MachineModel& model) {
      const Record simulated = sim::simulateTest(model, c.data.test, c.data.record, options);
      return findChatter(simulated, c.data.test, c.data.first_cut).has_value();
    };
    if (chatters(data.nominal)) continue;
    Finding f;
    f.channel = "fx";
    f.tests = {c.data.test.name};
    f.domain = "frequency";
    f.location["frequency_hz"] = c.chatter.frequency;
    f.depends_on = {"cutting"};
    f.amplitude = c.chatter.amplitude;
    f.p_value = 1e-300;
    result->where.push_back(f);
    if (!chatters(result->model)) result->unexplained.push_back(f);
  }
}

}  // namespace

Explanation explain(const Dataset& loaded, const ExplainOptions& options, const std::string& folder) {
  const auto begin = std::chrono::steady_clock::now();
  const auto say = [&](const std::string& line) {
    if (options.search.progress) options.search.progress(line);
  };
  Dataset data = loaded;  // its records without spindle angle are turned as the model becomes better
  Explanation result;
  result.notes = data.notes;
  const auto refuse = [&](const std::vector<std::string>& reasons) {
    std::string all;
    for (const std::string& r : reasons) all += (all.empty() ? "" : "; ") + r;
    if (!reasons.empty()) throw Error(data.campaign.folder + ": " + all);
  };
  const Labels labels = checkLabels(data, options.search.threads);
  refuse(labels.wrong);
  const std::vector<Hypothesis> hypotheses = catalogueHypotheses(data, &result.notes);
  std::vector<std::size_t> fitted, heldout;
  for (std::size_t t = 0; t < data.tests.size(); ++t) (data.tests[t].heldout ? heldout : fitted).push_back(t);
  SearchOptions s = options.search;
  if (!labels.doubtful.empty()) s.most_effects = std::min<std::size_t>(s.most_effects, 2);
  const NominalFreedom freedom(data.nominal);
  TwinRunner quick_runner(data, fitted, s.threads, s.screening_substeps);
  TwinRunner exact_runner(data, fitted, s.threads, s.final_substeps);
  TwinRunner heldout_runner(data, heldout, s.threads, s.final_substeps);
  const Fitter quick(quick_runner, freedom), exact(exact_runner, freedom);

  const std::vector<double> before = residualOf(exact_runner, data.nominal);
  const std::vector<double> before_heldout = residualOf(heldout_runner, data.nominal);
  result.before = {gapOf(before), gapOf(before_heldout)};
  char line[200];
  std::snprintf(line, sizeof line, "gap of the nominal model: %.4f, held out %.4f", result.before.fit,
                result.before.heldout);
  say(line);

  if (std::any_of(data.tests.begin(), data.tests.end(),
                  [](const TestData& t) { return t.phase_estimated; })) {
    s.turn_phases = [&](const MachineModel& model) {
      const double turn = turnPhases(data, model);
      for (TwinRunner* runner : {&quick_runner, &exact_runner, &heldout_runner}) runner->readPhases();
      return turn;
    };
  }
  SearchResult found = search(quick_runner, quick, exact, hypotheses, s);
  result.ladder = found.ladder;
  StructureOptions structure = options.structure;
  structure.squares_of_gap = std::max(found.null.chi2 - static_cast<double>(exact_runner.size()), 1.0);
  result.unexplained = findStructure(exact_runner, found.best.residual, structure);
  // What the calibration of the nominal values takes away is no disagreement of their kind.
  result.where = findStructure(exact_runner, found.null.residual, structure);
  // Of its share of the held-out squares above the noise.
  const auto heldoutReduction = [&](const FitState& state, std::size_t m) {
    const double with = squaresOf(residualOf(heldout_runner, exact.model(state)));
    const double without_it = squaresOf(residualOf(heldout_runner, exact.model(without(state, m))));
    const auto floor = static_cast<double>(heldout_runner.size());
    return without_it > floor
               ? std::clamp(1.0 - std::max(with - floor, 0.0) / (without_it - floor), -1.0, 1.0)
               : 0.0;
  };
  // An effect stands for another cause when the tests do not agree on its size, unless it helps in those that
  // it never saw; or when it leaves much at the very places where it acts.
  while (!result.unexplained.empty() && !found.best.state.members.empty()) {
    std::size_t worst = 0;
    double worst_score = 1.0;
    const bool one_place = atOnePlace(result.unexplained);
    for (std::size_t m = 0; m < found.best.state.members.size(); ++m) {
      const Trace trace = traceOf(exact, found.best, m);
      const double rest = leftWhere(exact_runner, trace, result.unexplained, structure);
      const bool helps = heldoutReduction(found.best.state, m) > options.least_heldout_reduction;
      const double score = std::max(helps ? 0.0 : trace.evenness / options.least_evenness,
                                    one_place ? 2.0 * rest / std::max(found.contribution[m], 1.0) : 0.0);
      std::snprintf(line, sizeof line,
                    "  %s: tests differ by %.3g, left where it acts %.3g, contribution %.3g%s",
                    found.best.state.members[m].hypothesis->title().c_str(), trace.evenness, rest,
                    found.contribution[m], helps ? ", helps where it was not fitted" : "");
      say(line);
      if (score > worst_score) {
        worst_score = score;
        worst = m;
      }
    }
    if (worst_score <= 1.0) break;
    say("  stands for another cause: " + found.best.state.members[worst].hypothesis->title());
    refine(quick_runner, quick, exact, without(found.best.state, worst), s, &found);
    result.unexplained = findStructure(exact_runner, found.best.residual, structure);
  }

  const Fit& best = found.best;
  MachineModel model = exact.model(best.state);
  // Where structure is left, the noise does not tell how well the values are known.
  const double scale = std::max(1.0, best.chi2 / static_cast<double>(exact_runner.size()));
  const Eigen::MatrixXd covariance = scale * best.covariance;
  const std::size_t nominal = freedom.coordinates().size();
  std::vector<double> nominal_std;
  for (std::size_t c = 0; c < nominal; ++c) {
    const auto i = static_cast<Eigen::Index>(c);
    nominal_std.push_back(std::sqrt(covariance(i, i)));
  }
  freedom.writeStdDevs(model, nominal_std);
  auto first = static_cast<Eigen::Index>(nominal);
  for (std::size_t m = 0; m < best.state.members.size(); ++m) {
    const Member& member = best.state.members[m];
    const auto own = static_cast<Eigen::Index>(member.values.size());
    FoundEffect effect;
    effect.name = member.hypothesis->effect;
    effect.variant = member.hypothesis->variant;
    effect.parameters = parametersOf(member, covariance.block(first, first, own, own));
    first += own;
    EffectEntry& entry = model.effects[data.nominal.effects.size() + m];
    effect.words = entry.words;
    writeStdDevs(entry, effect.parameters);
    effect.delta_bic = found.contribution[m];
    effect.evenness = traceOf(exact, best, m).evenness;
    effect.heldout_gap_reduction = heldoutReduction(best.state, m);
    effect.confidence = confidenceBetween(exact, best.state, without(best.state, m));
    for (const Rival& rival : found.rivals) {
      if (rival.member != m) continue;
      effect.confidence = std::min(effect.confidence, confidenceBetween(exact, best.state, rival.state));
      effect.alternatives.emplace_back(rival.effect, rival.delta_bic);
      // What would not be enough to name an effect is not enough to tell it from another.
      const double alike = std::min(s.least_gain, 0.5 * effect.delta_bic);
      if (rival.delta_bic > effect.delta_bic - alike) {
        result.not_separable.push_back({effect.name, rival.effect});
        if (!result.suggested_test)
          result.suggested_test = separatingTest(data, exact.model(best.state), exact.model(rival.state));
      }
    }
    result.effects.push_back(std::move(effect));
  }

  const std::string file = folder + "/model.yaml";
  writeMachineModel(model, file);
  result.model = readMachineModel(file);
  const std::vector<double> after = residualOf(exact_runner, result.model);
  const std::vector<double> after_heldout = residualOf(heldout_runner, result.model);
  result.after = {gapOf(after), gapOf(after_heldout)};
  const auto addGaps = [&](const TwinRunner& runner, const std::vector<double>& b,
                           const std::vector<double>& a, bool held) {
    for (const Block& block : runner.blocks()) {
      const auto from = static_cast<std::ptrdiff_t>(block.offset),
                 to = from + static_cast<std::ptrdiff_t>(block.size);
      result.gaps.push_back({data.tests[block.test].test.name, block.channel, held,
                             gapOf({b.begin() + from, b.begin() + to}),
                             gapOf({a.begin() + from, a.begin() + to}), floorDeviation(block.size)});
    }
  };
  addGaps(exact_runner, before, after, false);
  addGaps(heldout_runner, before_heldout, after_heldout, true);

  addCurves(exact_runner, before, after, &result);
  addChatter(data, &result);

  if (result.effects.empty()) {
    result.verdict = result.unexplained.empty() ? "no_disagreement" : "unknown_effect";
  } else {
    result.verdict = result.unexplained.empty() ? "explained" : "partly_explained";
  }
  if (result.verdict == "no_disagreement") result.where.clear();
  // An effect that acts in one test most may look like another test's label; one that explains all clears it.
  if (!result.unexplained.empty()) refuse(labels.doubtful);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  std::snprintf(line, sizeof line, "verdict %s; gap %.4f -> %.4f, held out %.4f -> %.4f",
                result.verdict.c_str(), result.before.fit, result.after.fit, result.before.heldout,
                result.after.heldout);
  say(line);
  return result;
}

}  // namespace smartmill::discrepancy
