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

constexpr double PAIR_SCATTER = 0.03;  // [1] smallest scatter of a pair about the sum of tool and material
constexpr double NORMAL_95 = 1.959964;

/// All records of one pair, combined.
struct PairRecords {
  std::string tool, material;
  CoefficientSet set;
  int records = 0;
  double rake = CoefficientRecord::UNKNOWN, helix = CoefficientRecord::UNKNOWN;  // [rad]
};

std::vector<PairRecords> pairsOf(const CoefficientDatabase& database) {
  std::map<std::pair<std::string, std::string>, PairRecords> pairs;
  std::map<std::string, std::pair<double, double>> edges;  // rake and helix of the tools, from any record
  const auto updateIfKnown = [](double& known, double value) {
    if (std::isfinite(value)) known = value;
  };
  for (const CoefficientRecord& record : database.records("", "")) {
    PairRecords& pair = pairs[{record.set.tool, record.set.material}];
    pair.tool = record.set.tool;
    pair.material = record.set.material;
    ++pair.records;
    auto& [rake, helix] =
        edges.emplace(pair.tool, std::pair{CoefficientRecord::UNKNOWN, CoefficientRecord::UNKNOWN})
            .first->second;
    updateIfKnown(rake, record.rake);
    updateIfKnown(helix, record.helix);
  }
  std::vector<PairRecords> known;
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

double relativeStd(const CoefficientSet& set, double CuttingCoefficients::*coefficient) {
  const double share = set.std_dev.*coefficient / std::abs(set.value.*coefficient);
  return std::isfinite(share) ? share : 0.1;
}

std::optional<MethodEstimate> estimateByShearZone(const std::vector<PairRecords>& pairs,
                                                  const CoefficientQuery& query) {
  double rake = query.rake, helix = query.helix;
  std::vector<ObliqueSet> sets;
  MethodEstimate answer;
  answer.method = EstimationMethod::shear_zone;
  for (const PairRecords& pair : pairs) {
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

/// log K = tool + material by weighted least squares over all pairs, and the scatter of a pair about it.
class AdditiveModel {
 public:
  AdditiveModel(const std::vector<PairRecords>& pairs, double CuttingCoefficients::*coefficient)
      : coefficient_(coefficient) {
    for (const PairRecords& pair : pairs) {
      if (!(pair.set.value.*coefficient > 0.0)) continue;
      used_.push_back(&pair);
      tools_.emplace(pair.tool, tools_.size());
    }
    for (const PairRecords* pair : used_)
      materials_.emplace(pair->material, tools_.size() + materials_.size());
  }

  /// Logarithm and its standard deviation. Empty: tool and material are not connected by common cuts.
  std::optional<std::pair<double, double>> at(const std::string& tool, const std::string& material) {
    const auto t = tools_.find(tool), m = materials_.find(material);
    if (t == tools_.end() || m == materials_.end() || !isConnected(tool, material)) return std::nullopt;
    // Two iterations, because the scatter of pairs about the model affects the weights.
    double scatter = PAIR_SCATTER;
    for (int i = 0; i < 2; ++i) scatter = solve(scatter);
    const auto a = static_cast<Eigen::Index>(t->second), b = static_cast<Eigen::Index>(m->second);
    const double variance = inverse_(a, a) + inverse_(b, b) + 2.0 * inverse_(a, b);
    // Student's distribution: the scatter is estimated from few pairs.
    const double wider = (freedom_ + PRIOR_FREEDOM) / (freedom_ + PRIOR_FREEDOM - 2.0);
    return std::pair{value_(a) + value_(b), std::sqrt(wider * (variance + scatter * scatter))};
  }

 private:
  bool isConnected(const std::string& tool, const std::string& material) const {
    std::set<std::string> tools{tool}, materials;
    for (std::size_t before = 0; before != tools.size() + materials.size();) {
      before = tools.size() + materials.size();
      for (const PairRecords* pair : used_) {
        if (tools.count(pair->tool)) materials.insert(pair->material);
        if (materials.count(pair->material)) tools.insert(pair->tool);
      }
    }
    return materials.count(material) > 0;
  }

  double solve(double scatter) {
    const auto n = static_cast<Eigen::Index>(tools_.size() + materials_.size());
    // Weak regularisation, because only sums of a tool and a material are determined.
    constexpr double LOOSE = 1e-6;
    Eigen::MatrixXd normal = LOOSE * Eigen::MatrixXd::Identity(n, n);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
    for (const PairRecords* pair : used_) {
      const double share = relativeStd(pair->set, coefficient_),
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
    // Scatter without the contribution of the records' standard deviations.
    const double count = static_cast<double>(used_.size());
    freedom_ = std::max(0.0, count - static_cast<double>(n) + 1.0);
    double squares = 0.0;
    for (const PairRecords* pair : used_) {
      const double model = value_(static_cast<Eigen::Index>(tools_[pair->tool])) +
                           value_(static_cast<Eigen::Index>(materials_[pair->material]));
      squares += std::pow(std::log(pair->set.value.*coefficient_) - model, 2) -
                 freedom_ / count * std::pow(relativeStd(pair->set, coefficient_), 2);
    }
    // The prior counts as PRIOR_FREEDOM degrees of freedom.
    const double prior_scatter = 2.0 * PAIR_SCATTER;
    return std::max(PAIR_SCATTER,
                    std::sqrt((std::max(0.0, squares) + PRIOR_FREEDOM * prior_scatter * prior_scatter) /
                              (freedom_ + PRIOR_FREEDOM)));
  }

  static constexpr double PRIOR_FREEDOM = 4.0;  // degrees of freedom
  double CuttingCoefficients::*coefficient_;
  std::vector<const PairRecords*> used_;
  std::map<std::string, std::size_t> tools_, materials_;
  Eigen::MatrixXd inverse_;
  Eigen::VectorXd value_;
  double freedom_ = 0.0;
};

std::optional<MethodEstimate> estimateByStandardCuts(const std::vector<PairRecords>& pairs,
                                                     const CoefficientQuery& query) {
  std::vector<PairRecords> others;
  for (const PairRecords& pair : pairs)
    if (pair.tool != query.tool || pair.material != query.material) others.push_back(pair);
  MethodEstimate answer;
  answer.method = EstimationMethod::standard_cuts;
  answer.set.value = answer.set.std_dev = NOT_IDENTIFIED;
  for (const auto coefficient : {&CuttingCoefficients::ktc, &CuttingCoefficients::kte}) {
    const auto found = AdditiveModel(others, coefficient).at(query.tool, query.material);
    if (!found) continue;
    answer.set.value.*coefficient = std::exp(found->first);
    answer.set.std_dev.*coefficient = std::exp(found->first) * found->second;
  }
  if (!(answer.set.value.ktc > 0.0)) return std::nullopt;
  for (const PairRecords& pair : others)
    if (pair.tool == query.tool || pair.material == query.material) answer.records += pair.records;
  return answer;
}

std::optional<MethodEstimate> estimateByRecords(const CoefficientDatabase& database,
                                                const CoefficientQuery& query) {
  const auto estimate = database.estimate(query);
  if (!estimate || !(estimate->set.value.ktc > 0.0)) return std::nullopt;
  MethodEstimate answer;
  answer.method = estimate->other_tool ? EstimationMethod::other_tool : EstimationMethod::pair;
  answer.set = estimate->set;
  answer.records = estimate->records;
  return answer;
}

/// Ktc by all methods. The pair's own records and those of other pairs are two independent observations.
/// Shear zone and standard cuts use the same records and count as one, with their mean standard deviation. No
/// method is discarded for its larger standard deviation, because selecting the smallest one favours an
/// underestimated one.
struct CombinedKtc {
  const MethodEstimate* surest = nullptr;
  double ktc = 0.0, share = 0.0;  // [N/m2], [1] its standard deviation
  double disagreement = CoefficientRecord::UNKNOWN;
};

CombinedKtc combineKtc(const std::vector<MethodEstimate>& estimates) {
  constexpr auto KTC = &CuttingCoefficients::ktc;
  CombinedKtc all;
  const auto updateSurest = [&](const MethodEstimate& estimate) {
    const double share = relativeStd(estimate.set, KTC);
    if (!all.surest || share < relativeStd(all.surest->set, KTC)) all.surest = &estimate;
  };
  double weight = 0.0, sum = 0.0, shares = 0.0;
  const MethodEstimate* own = nullptr;
  for (const MethodEstimate& estimate : estimates) {
    // Other tools are the last resort and are not compared with the others.
    if (estimate.method == EstimationMethod::other_tool) continue;
    updateSurest(estimate);
    if (estimate.method == EstimationMethod::pair) {
      own = &estimate;
      continue;
    }
    const double share = relativeStd(estimate.set, KTC), one = 1.0 / (share * share);
    weight += one, sum += one * std::log(estimate.set.value.ktc), shares += one * share;
  }
  if (!all.surest) updateSurest(estimates.front());
  if (!(weight > 0.0)) {
    all.ktc = all.surest->set.value.ktc, all.share = relativeStd(all.surest->set, KTC);
    return all;
  }
  double log = sum / weight;
  all.share = shares / weight;
  for (const MethodEstimate& estimate : estimates) {
    if (&estimate == all.surest || estimate.method == EstimationMethod::other_tool) continue;
    const double off = std::abs(std::log(estimate.set.value.ktc / all.surest->set.value.ktc)) /
                       std::hypot(relativeStd(estimate.set, KTC), relativeStd(all.surest->set, KTC));
    if (!(off <= all.disagreement)) all.disagreement = off;
  }
  if (own) {
    const double share = relativeStd(own->set, KTC), one = 1.0 / (share * share),
                 others = 1.0 / (all.share * all.share);
    log = (one * std::log(own->set.value.ktc) + others * log) / (one + others);
    all.share = 1.0 / std::sqrt(one + others);
  }
  all.ktc = std::exp(log);
  // A significant disagreement widens the interval to the difference.
  if (all.disagreement > NORMAL_95)
    all.share *= std::min(all.disagreement, 1.0 + 2.0 * (all.disagreement - NORMAL_95));
  return all;
}

}  // namespace

const char* nameOf(EstimationMethod method) {
  switch (method) {
    case EstimationMethod::pair:
      return "records of this tool in this material";
    case EstimationMethod::shear_zone:
      return "shear zone of the material from other tools";
    case EstimationMethod::standard_cuts:
      return "standard cuts of tool and material with others";
    case EstimationMethod::other_tool:
      break;
  }
  return "other tools in this material";
}

std::optional<CutRecommendation> recommendCut(const CoefficientDatabase& database,
                                              const CoefficientQuery& query) {
  if (query.tool.empty() || query.material.empty())
    throw Error("recommended cut: expected tool and material");
  CutRecommendation answer;
  const std::vector<PairRecords> pairs = pairsOf(database);
  for (const auto& method : {estimateByRecords(database, query), estimateByShearZone(pairs, query),
                             estimateByStandardCuts(pairs, query)})
    if (method) answer.estimates.push_back(*method);
  if (answer.estimates.empty()) return std::nullopt;
  const CombinedKtc all = combineKtc(answer.estimates);
  answer.method = all.surest->method;
  answer.set = all.surest->set;
  answer.set.tool = query.tool;
  answer.set.material = query.material;
  answer.set.value.ktc = all.ktc;
  answer.set.std_dev.ktc = answer.set.value.ktc * all.share;
  answer.disagreement = all.disagreement;
  answer.ktc_lower = answer.set.value.ktc * std::exp(-NORMAL_95 * all.share);
  answer.ktc_upper = answer.set.value.ktc * std::exp(NORMAL_95 * all.share);
  answer.message = formatted("Ktc %.0f N/mm2, with 95 %% between %.0f and %.0f: %s, %d records",
                             answer.set.value.ktc / units::N_PER_MM2, answer.ktc_lower / units::N_PER_MM2,
                             answer.ktc_upper / units::N_PER_MM2, nameOf(answer.method), all.surest->records);
  if (std::isfinite(answer.disagreement))
    answer.message +=
        formatted("; other methods differ by up to %.1f standard deviations", answer.disagreement);
  return answer;
}

}  // namespace smartmill::loadmeter
