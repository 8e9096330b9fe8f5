#include "smartmill_discrepancy/explain/verdict.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_discrepancy/search/unidentifiable_pair.h"
#include "smartmill_discrepancy/search/validation.h"

namespace smartmill::discrepancy {
namespace {

struct NamingOptions {
  /// Squares over the noise at one standard deviation of the prior from which a value is identifiable.
  double identifiable = 1.0;
  double separating_share = 0.5;  ///< [1] of an effect's gain that separates it from an alternative at most
};

// Parameters of a member with its values moved along a direction, within their bounds.
std::vector<std::pair<std::string, double>> numbersAt(const Member& member, const Eigen::VectorXd& shift) {
  std::vector<double> moved = member.values;
  for (std::size_t c = 0; c < moved.size(); ++c) {
    const Coordinate& limits = member.hypothesis->coordinates[c];
    moved[c] = std::clamp(moved[c] + shift[static_cast<Eigen::Index>(c)], limits.low, limits.high);
  }
  return numbersOf(member.hypothesis->entry(moved));
}

// Standard deviations of the keys of a member's entry: RMS difference at points with the covariance of the
// coordinates. Linear propagation would give no deviation of the magnitude of a vector of which only one
// direction is identifiable.
std::vector<FoundParameter> parametersOf(const Member& member, const Eigen::MatrixXd& covariance,
                                         double angle_modulo) {
  const auto numbers = numbersOf(member.hypothesis->entry(member.values));
  const EffectKind& kind = *findEffect(member.hypothesis->effect);
  const Eigen::Index count = covariance.cols();
  const linear::SymmetricEigensystem axes = linear::symmetricEigensystem(covariance);
  std::vector<double> variance(numbers.size(), 0.0);
  for (Eigen::Index k = 0; k < count; ++k) {
    const double reach = std::sqrt(static_cast<double>(count) * std::max(axes.values[k], 0.0));
    for (const double sign : {-1.0, 1.0}) {
      const auto other = numbersAt(member, sign * reach * axes.vectors.col(k));
      if (other.size() != numbers.size()) continue;
      for (std::size_t n = 0; n < numbers.size(); ++n) {
        const double difference =
            parameterOf(kind, numbers[n].first).difference(other[n].second, numbers[n].second);
        variance[n] += difference * difference / (2.0 * static_cast<double>(count));
      }
    }
  }
  std::vector<FoundParameter> parameters;
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    const auto& [key, value] = numbers[k];
    const EffectParameter& parameter = parameterOf(kind, key);
    const double own = TWIN_ACCURACY * parameter.scale(value);
    parameters.push_back({key, value, std::sqrt(variance[k] + own * own)});
    if (parameter.on_spindle) parameters.back().modulo = angle_modulo;
  }
  return parameters;
}

// [deg] Multiples of it are added to all angles on the spindle by another choice of the first tooth, which no
// record shows without a spindle angle; 0: a record or the model distinguishes the teeth.
double angleModulo(const Dataset& data) {
  const MachineModel& nominal = data.nominal;
  const bool shown = std::any_of(data.tests.begin(), data.tests.end(), [](const TestData& t) {
    return t.test.kind == TestKind::cut && !t.phase_estimated;
  });
  const bool distinguished =
      std::any_of(nominal.effects.begin(), nominal.effects.end(),
                  [](const EffectEntry& e) { return findEffect(e.name)->stage == EffectStage::geometry; });
  if (shown || distinguished || !nominal.tool || !nominal.tool->pitch.empty()) return 0.0;
  return 360.0 / nominal.tool->teeth;
}

// Differences of angles that are known up to the same multiples.
void noteAngleDifferences(const std::vector<FoundEffect>& effects, std::vector<std::string>* notes) {
  const FoundParameter* first = nullptr;
  std::string name;
  for (const FoundEffect& effect : effects) {
    for (const FoundParameter& p : effect.parameters) {
      if (p.modulo == 0.0) continue;
      if (first)
        notes->push_back(p.key + " of " + effect.name + " minus that of " + name +
                         formatted(": %.2f +- %.2g deg", std::remainder(p.value - first->value, 360.0),
                                   std::hypot(p.std_dev, first->std_dev)));
      else
        std::tie(first, name) = std::pair(&p, effect.name);
    }
  }
}

void writeStdDevs(EffectEntry& entry, const std::vector<FoundParameter>& parameters) {
  for (const FoundParameter& p : parameters) entry.std_devs[p.key] = p.std_dev;
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

// Number of identifiable directions of a member's values, e.g. one for the runout of a two-tooth tool.
std::size_t identifiableValues(const Fitter& fitter, const FitState& state, std::size_t member) {
  const std::vector<Coordinate>& coordinates = state.members[member].hypothesis->coordinates;
  Eigen::VectorXd prior(static_cast<Eigen::Index>(coordinates.size()));
  for (std::size_t c = 0; c < coordinates.size(); ++c)
    prior[static_cast<Eigen::Index>(c)] = coordinates[c].prior_std;
  SimulatedChannels base;
  const Eigen::MatrixXd gram =
      prior.asDiagonal() * memberTangents(fitter, state, {member}, &base).gram() * prior.asDiagonal();
  return static_cast<std::size_t>(
      (linear::symmetricEigensystem(gram).values.array() > NamingOptions().identifiable).count());
}

// Manual test that separates two effects equal in every cut; empty if unknown.
std::string manualSeparation(const std::string& one, const std::string& other) {
  const std::set<std::string> both{one, other};
  if (both != std::set<std::string>{"runout", "tooth_radius"}) return "";
  return "the same cuts with the tool rotated in its holder: runout stays with the holder, tooth radii "
         "rotate "
         "with the tool; no cut with the tool as it is clamped separates them";
}

// Alternatives of a member.
void addAlternatives(const Workbench& bench, const SearchOptions& options, const SearchResult& found,
                     std::size_t member, FoundEffect* effect,
                     std::vector<UnidentifiablePair>* unidentifiable) {
  const NamingOptions limits;
  const Fitter& exact = bench.exact();
  const FitState& best = found.best.state;
  for (const Alternative& alternative : found.alternatives) {
    if (alternative.member != member) continue;
    const auto compare = [&] {
      effect->confidence =
          std::min(effect->confidence, validate(bench, best, alternative.state).confidence());
    };
    const Member& rival = alternative.state.members.back();
    std::vector<FoundParameter> parameters;
    for (const auto& [key, value] : numbersOf(rival.hypothesis->entry(rival.values)))
      parameters.push_back({key, value, 0.0, 0.0});
    effect->alternatives.push_back({alternative.effect, alternative.delta_bic, parameters, {}});
    // A gain too small for naming an effect does not separate it from another.
    const double threshold = std::min(options.min_gain, limits.separating_share * effect->delta_bic);
    const double gain = effect->delta_bic - alternative.delta_bic;
    if (gain >= threshold) {
      compare();
      continue;
    }
    const auto test = separatingTest(bench.data(), exact.model(best), exact.model(alternative.state));
    const bool is_distinct = test && test->difference > MIN_SEPARATION;
    // With more identifiable values and no other prediction it is only a more general effect.
    if (!is_distinct &&
        identifiableValues(bench.quick(), alternative.state, alternative.state.members.size() - 1) >
            identifiableValues(bench.quick(), best, member))
      continue;
    if (is_distinct) compare();  // one that predicts the same shares the confidence, as not separable
    unidentifiable->push_back({effect->name, alternative.effect, gain / threshold, {}});
    if (is_distinct) unidentifiable->back().test = test;
    if (options.prior)
      effect->confidence =
          std::min(effect->confidence, nameProbability(unidentifiable->back(), *options.prior));
  }
}

// Unidentifiable pairs and the most informative test.
void reportUnidentifiable(const std::vector<UnidentifiablePair>& unidentifiable,
                          const std::optional<CauseOdds>& prior, Explanation* result) {
  for (const UnidentifiablePair& pair : unidentifiable) {
    result->not_separable.push_back({pair.name, pair.alternative});
    if (prior)
      result->notes.push_back(formatted("prior of %zu other machines: odds of %s %.3g, of %s %.3g",
                                        prior->machines, pair.name.c_str(), prior->of(pair.name),
                                        pair.alternative.c_str(), prior->of(pair.alternative)));
  }
  if (const UnidentifiablePair* const informative = mostInformative(unidentifiable, prior)) {
    result->suggested_test = informative->test->text;
    result->suggested_cut = informative->test->test;
    result->outcome = informative->test->outcome;
    result->outcome->first = informative->name;
    result->outcome->second = informative->alternative;
    return;
  }
  for (const UnidentifiablePair& pair : unidentifiable) {
    const std::string manual = manualSeparation(pair.name, pair.alternative);
    if (!manual.empty()) result->suggested_test = manual;
  }
}

}  // namespace

MachineModel nameEffects(const Workbench& bench, const SearchOptions& options, const SearchResult& found,
                         Explanation* result) {
  const FitResult& best = found.best;
  MachineModel model = bench.exact().model(best.state);
  const Eigen::MatrixXd& covariance = best.covariance;
  std::vector<double> nominal_std;
  std::vector<UnidentifiablePair> unidentifiable;
  auto first = static_cast<Eigen::Index>(best.state.nominal.size());
  for (Eigen::Index i = 0; i < first; ++i) nominal_std.push_back(std::sqrt(covariance(i, i)));
  bench.freedom().writeStdDevs(model, nominal_std);
  const double modulo = angleModulo(bench.data());
  const std::size_t first_entry = model.effects.size() - best.state.members.size();
  for (std::size_t m = 0; m < best.state.members.size(); ++m) {
    const Member& member = best.state.members[m];
    const auto own = static_cast<Eigen::Index>(member.values.size());
    EffectEntry& entry = model.effects[first_entry + m];
    FoundEffect effect;
    effect.name = member.hypothesis->effect;
    effect.variant = member.hypothesis->variant;
    effect.words = entry.words;
    effect.parameters = parametersOf(member, covariance.block(first, first, own, own), modulo);
    first += own;
    if (const EffectKind& kind = *findEffect(effect.name); kind.remark) {
      const std::string remark = kind.remark(entry);
      if (!remark.empty()) result->notes.push_back(remark);
    }
    writeStdDevs(entry, effect.parameters);
    effect.delta_bic = found.contribution[m];
    effect.presence = validate(bench, best.state, found.without_member[m]).confidence();
    effect.confidence = effect.presence;
    addAlternatives(bench, options, found, m, &effect, &unidentifiable);
    result->effects.push_back(std::move(effect));
  }
  noteAngleDifferences(result->effects, &result->notes);
  reportUnidentifiable(unidentifiable, options.prior, result);
  return model;
}

Verdict verdictOf(const Explanation& result, double negligible_excess) {
  const auto empirical = static_cast<std::size_t>(
      std::count_if(result.effects.begin(), result.effects.end(),
                    [](const FoundEffect& f) { return findEffect(f.name)->empirical(); }));
  const bool all_known = result.unexplained.empty() && empirical == 0;
  if (result.effects.size() == empirical) {
    if (!all_known) return Verdict::unknown_effect;
    const auto squares = [](double gap) { return gap * gap; };
    return squares(result.before.fit) - squares(result.after.fit) < negligible_excess
               ? Verdict::no_disagreement
               : Verdict::recalibrated;
  }
  return all_known ? Verdict::explained : Verdict::partly_explained;
}

}  // namespace smartmill::discrepancy
