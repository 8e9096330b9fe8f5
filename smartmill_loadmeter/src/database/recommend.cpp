#include "smartmill_loadmeter/database/recommend.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/database/oblique.h"

namespace smartmill::loadmeter {
namespace {

constexpr double PAIR_SCATTER = 0.03;  // [1] one pair departs from what tool and material say, at least
constexpr double NORMAL_95 = 1.959964;

/// Knowledge of one pair: every record, combined.
struct Pair {
  std::string tool, material;
  CoefficientSet set;
  int records = 0;
  double rake = CoefficientRecord::UNKNOWN, helix = CoefficientRecord::UNKNOWN;  // [rad]
};

std::vector<Pair> pairsOf(const CoefficientDatabase& database) {
  std::map<std::pair<std::string, std::string>, Pair> pairs;
  std::map<std::string, std::pair<double, double>>
      edges;  // rake and helix of the tools, whichever record tells
  const auto learn = [](double& known, double told) {
    if (std::isfinite(told)) known = told;
  };
  for (const CoefficientRecord& record : database.records("", "")) {
    Pair& pair = pairs[{record.set.tool, record.set.material}];
    pair.tool = record.set.tool;
    pair.material = record.set.material;
    ++pair.records;
    auto& [rake, helix] =
        edges.emplace(pair.tool, std::pair{CoefficientRecord::UNKNOWN, CoefficientRecord::UNKNOWN})
            .first->second;
    learn(rake, record.rake);
    learn(helix, record.helix);
  }
  std::vector<Pair> known;
  for (auto& [key, pair] : pairs) {
    CoefficientQuery query;
    query.tool = pair.tool;
    query.material = pair.material;
    const auto estimate = database.estimate(query);
    if (!estimate || !(estimate->set.value.ktc > 0.0)) continue;
    pair.set = estimate->set;
    std::tie(pair.rake, pair.helix) = edges.at(pair.tool);
    known.push_back(std::move(pair));
  }
  return known;
}

double shareOf(const CoefficientSet& set, double CuttingCoefficients::*coefficient) {
  const double share = set.std_dev.*coefficient / std::abs(set.value.*coefficient);
  return std::isfinite(share) ? share : 0.1;
}

std::optional<WayAnswer> byShearZone(const std::vector<Pair>& pairs, const CoefficientQuery& query) {
  double rake = query.rake, helix = query.helix;
  std::vector<ObliqueSet> sets;
  WayAnswer answer;
  answer.way = AnswerWay::shear_zone;
  for (const Pair& pair : pairs) {
    if (pair.tool == query.tool) {
      if (!std::isfinite(rake)) rake = pair.rake;
      if (!std::isfinite(helix)) helix = pair.helix;
    }
    if (pair.material != query.material || pair.tool == query.tool) continue;
    if (!std::isfinite(pair.rake) || !std::isfinite(pair.helix)) continue;
    sets.push_back({pair.rake, pair.helix, pair.set.value, pair.set.std_dev});
    answer.records += pair.records;
  }
  if (sets.empty() || !std::isfinite(rake) || !std::isfinite(helix)) return std::nullopt;
  answer.set = predict(semiInverse(sets), rake, helix);
  answer.set.std_dev.ktc = std::hypot(answer.set.std_dev.ktc, PAIR_SCATTER * answer.set.value.ktc);
  return answer;
}

/// log K = tool + material, by weighted least squares over all pairs, and what a pair departs from it.
class AdditiveModel {
 public:
  AdditiveModel(const std::vector<Pair>& pairs, double CuttingCoefficients::*coefficient)
      : coefficient_(coefficient) {
    for (const Pair& pair : pairs) {
      if (!(pair.set.value.*coefficient > 0.0)) continue;
      used_.push_back(&pair);
      tools_.emplace(pair.tool, tools_.size());
    }
    for (const Pair* pair : used_) materials_.emplace(pair->material, tools_.size() + materials_.size());
  }

  /// Log and its standard deviation. Nothing where no chain of common cuts joins the two.
  std::optional<std::pair<double, double>> at(const std::string& tool, const std::string& material) {
    const auto t = tools_.find(tool), m = materials_.find(material);
    if (t == tools_.end() || m == materials_.end() || !joined(tool, material)) return std::nullopt;
    // Twice: the scatter of pairs about the model enters the weights.
    double scatter = PAIR_SCATTER;
    for (int i = 0; i < 2; ++i) scatter = solve(scatter);
    const auto a = static_cast<Eigen::Index>(t->second), b = static_cast<Eigen::Index>(m->second);
    const double variance = inverse_(a, a) + inverse_(b, b) + 2.0 * inverse_(a, b);
    // The scatter itself is known from few pairs: Student's distribution is that much wider.
    const double wider = (freedom_ + BELIEF) / (freedom_ + BELIEF - 2.0);
    return std::pair{value_(a) + value_(b), std::sqrt(wider * (variance + scatter * scatter))};
  }

 private:
  bool joined(const std::string& tool, const std::string& material) const {
    std::set<std::string> tools{tool}, materials;
    for (std::size_t before = 0; before != tools.size() + materials.size();) {
      before = tools.size() + materials.size();
      for (const Pair* pair : used_) {
        if (tools.count(pair->tool)) materials.insert(pair->material);
        if (materials.count(pair->material)) tools.insert(pair->tool);
      }
    }
    return materials.count(material) > 0;
  }

  double solve(double scatter) {
    const auto n = static_cast<Eigen::Index>(tools_.size() + materials_.size());
    // Held loosely at the mean: only sums of a tool and a material are asked for.
    constexpr double LOOSE = 1e-6;
    Eigen::MatrixXd normal = LOOSE * Eigen::MatrixXd::Identity(n, n);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
    for (const Pair* pair : used_) {
      const double share = shareOf(pair->set, coefficient_),
                   weight = 1.0 / (share * share + scatter * scatter);
      const auto a = static_cast<Eigen::Index>(tools_[pair->tool]),
                 b = static_cast<Eigen::Index>(materials_[pair->material]);
      const double log = std::log(pair->set.value.*coefficient_);
      normal(a, a) += weight, normal(b, b) += weight;
      normal(a, b) += weight, normal(b, a) += weight;
      right(a) += weight * log, right(b) += weight * log;
    }
    inverse_ = linear::inverseSymmetric(normal);
    value_ = inverse_ * right;
    // What the records' own scatter leaves of it: as much as the unknowns could not follow.
    const double count = static_cast<double>(used_.size());
    freedom_ = std::max(0.0, count - static_cast<double>(n) + 1.0);
    double squares = 0.0;
    for (const Pair* pair : used_) {
      const double model = value_(static_cast<Eigen::Index>(tools_[pair->tool])) +
                           value_(static_cast<Eigen::Index>(materials_[pair->material]));
      squares += std::pow(std::log(pair->set.value.*coefficient_) - model, 2) -
                 freedom_ / count * std::pow(shareOf(pair->set, coefficient_), 2);
    }
    // With few degrees of freedom the belief counts as much as what was seen.
    const double belief = 2.0 * PAIR_SCATTER;
    return std::max(PAIR_SCATTER,
                    std::sqrt((std::max(0.0, squares) + BELIEF * belief * belief) / (freedom_ + BELIEF)));
  }

  static constexpr double BELIEF = 4.0;  // degrees of freedom
  double CuttingCoefficients::*coefficient_;
  std::vector<const Pair*> used_;
  std::map<std::string, std::size_t> tools_, materials_;
  Eigen::MatrixXd inverse_;
  Eigen::VectorXd value_;
  double freedom_ = 0.0;
};

std::optional<WayAnswer> byStandardCuts(const std::vector<Pair>& pairs, const CoefficientQuery& query) {
  std::vector<Pair> others;
  for (const Pair& pair : pairs)
    if (pair.tool != query.tool || pair.material != query.material) others.push_back(pair);
  WayAnswer answer;
  answer.way = AnswerWay::standard_cuts;
  answer.set.value = answer.set.std_dev = NOT_IDENTIFIED;
  for (const auto coefficient : {&CuttingCoefficients::ktc, &CuttingCoefficients::kte}) {
    const auto found = AdditiveModel(others, coefficient).at(query.tool, query.material);
    if (!found) continue;
    answer.set.value.*coefficient = std::exp(found->first);
    answer.set.std_dev.*coefficient = std::exp(found->first) * found->second;
  }
  if (!(answer.set.value.ktc > 0.0)) return std::nullopt;
  for (const Pair& pair : others)
    if (pair.tool == query.tool || pair.material == query.material) answer.records += pair.records;
  return answer;
}

std::optional<WayAnswer> byEstimate(const CoefficientDatabase& database, const CoefficientQuery& query) {
  const auto estimate = database.estimate(query);
  if (!estimate || !(estimate->set.value.ktc > 0.0)) return std::nullopt;
  WayAnswer answer;
  answer.way = estimate->other_tool ? AnswerWay::other_tool : AnswerWay::pair;
  answer.set = estimate->set;
  answer.records = estimate->records;
  return answer;
}

/// Ktc by all ways. What the pair's own records say and what the other pairs say of it are two observations;
/// shear zone and standard cuts rest on the same records and count as one, no surer than they are on the
/// mean. None is left out because it states more: who takes the surest takes the one that errs low in its
/// deviation.
struct Together {
  const WayAnswer* surest = nullptr;
  double ktc = 0.0, share = 0.0;  // [N/m2], [1] its standard deviation
  double surprise = CoefficientRecord::UNKNOWN;
};

Together together(const std::vector<WayAnswer>& ways) {
  constexpr auto KTC = &CuttingCoefficients::ktc;
  Together all;
  const auto take = [&](const WayAnswer& way) {
    const double share = shareOf(way.set, KTC);
    if (!all.surest || share < shareOf(all.surest->set, KTC)) all.surest = &way;
  };
  double weight = 0.0, sum = 0.0, shares = 0.0;
  const WayAnswer* own = nullptr;
  for (const WayAnswer& way : ways) {
    // Other tools are a last resort: nothing contradicts them, they are other tools.
    if (way.way == AnswerWay::other_tool) continue;
    take(way);
    if (way.way == AnswerWay::pair) {
      own = &way;
      continue;
    }
    const double share = shareOf(way.set, KTC), one = 1.0 / (share * share);
    weight += one, sum += one * std::log(way.set.value.ktc), shares += one * share;
  }
  if (!all.surest) take(ways.front());
  if (!(weight > 0.0)) {
    all.ktc = all.surest->set.value.ktc, all.share = shareOf(all.surest->set, KTC);
    return all;
  }
  double log = sum / weight;
  all.share = shares / weight;
  for (const WayAnswer& way : ways) {
    if (&way == all.surest || way.way == AnswerWay::other_tool) continue;
    const double off = std::abs(std::log(way.set.value.ktc / all.surest->set.value.ktc)) /
                       std::hypot(shareOf(way.set, KTC), shareOf(all.surest->set, KTC));
    if (!(off <= all.surprise)) all.surprise = off;
  }
  if (own) {
    const double share = shareOf(own->set, KTC), one = 1.0 / (share * share),
                 others = 1.0 / (all.share * all.share);
    log = (one * std::log(own->set.value.ktc) + others * log) / (one + others);
    all.share = 1.0 / std::sqrt(one + others);
  }
  all.ktc = std::exp(log);
  // Beyond what chance allows they contradict, and it is as unsure as they are apart.
  if (all.surprise > NORMAL_95) all.share *= std::min(all.surprise, 1.0 + 2.0 * (all.surprise - NORMAL_95));
  return all;
}

}  // namespace

const char* nameOf(AnswerWay way) {
  switch (way) {
    case AnswerWay::pair:
      return "these two have cut";
    case AnswerWay::shear_zone:
      return "by the material's shear zone from other tools";
    case AnswerWay::standard_cuts:
      return "by standard cuts of tool and material with others";
    case AnswerWay::other_tool:
      break;
  }
  return "other tools in this material";
}

std::optional<CutAnswer> recommendCut(const CoefficientDatabase& database, const CoefficientQuery& query) {
  if (query.tool.empty() || query.material.empty()) throw Error("recommended cut: tool and material are due");
  CutAnswer answer;
  const std::vector<Pair> pairs = pairsOf(database);
  for (const auto& way :
       {byEstimate(database, query), byShearZone(pairs, query), byStandardCuts(pairs, query)})
    if (way) answer.ways.push_back(*way);
  if (answer.ways.empty()) return std::nullopt;
  const Together all = together(answer.ways);
  answer.way = all.surest->way;
  answer.set = all.surest->set;
  answer.set.tool = query.tool;
  answer.set.material = query.material;
  answer.set.value.ktc = all.ktc;
  answer.set.std_dev.ktc = answer.set.value.ktc * all.share;
  answer.surprise = all.surprise;
  answer.ktc_lower = answer.set.value.ktc * std::exp(-NORMAL_95 * all.share);
  answer.ktc_upper = answer.set.value.ktc * std::exp(NORMAL_95 * all.share);
  answer.message = formatted("Ktc %.0f N/mm2, with 95 %% between %.0f and %.0f: %s, %d records",
                             answer.set.value.ktc / units::N_PER_MM2, answer.ktc_lower / units::N_PER_MM2,
                             answer.ktc_upper / units::N_PER_MM2, nameOf(answer.way), all.surest->records);
  if (std::isfinite(answer.surprise))
    answer.message += formatted("; other ways differ by up to %.1f standard deviations", answer.surprise);
  return answer;
}

}  // namespace smartmill::loadmeter
