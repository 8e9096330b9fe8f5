// Estimates from records: database.h.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_loadmeter/database/database.h"

namespace smartmill::loadmeter {

double distance(const CoefficientRecord& record, const CoefficientQuery& query, const DistanceScale& scale) {
  double sum = 0.0;
  const auto add = [&](double share) {
    if (std::isfinite(share)) sum += share * share;
  };
  add(std::log2(record.cutting_speed / query.cutting_speed) / scale.octaves);
  add(std::log2(record.feed_per_tooth / query.feed_per_tooth) / scale.octaves);
  add(std::log2(record.diameter / query.diameter) / scale.octaves);
  add((record.helix - query.helix) / scale.angle);
  add((record.rake - query.rake) / scale.angle);
  add((record.edge_age - query.edge_age) / scale.age);
  if (!query.tool.empty() && record.set.tool != query.tool) add(scale.other_tool);
  return std::sqrt(sum);
}

namespace {

// One coefficient from all records, each widened by its distance. @return {value, standard deviation}; NaN:
// in no record.
std::array<double, 2> combine(const std::vector<CoefficientRecord>& near,
                              const std::vector<double>& distances, double CuttingCoefficients::*coefficient,
                              double growth) {
  struct Term {
    double value, variance, widened;
  };
  std::vector<Term> terms;
  double weight = 0.0, sum = 0.0, fade = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < near.size(); ++i) {
    const double v = near[i].set.value.*coefficient, s = near[i].set.std_dev.*coefficient;
    if (!std::isfinite(v)) continue;
    // A set without a standard deviation has the uncertainty of distance 1.
    const double own = std::isfinite(s) ? s : growth * std::abs(v), widened = growth * distances[i] * v;
    terms.push_back({v, own * own + widened * widened, widened});
    const double variance = std::max(terms.back().variance, 1e-12 * v * v + 1e-300);
    weight += 1.0 / variance;
    sum += v / variance;
    fade = std::min(fade, std::abs(widened));
  }
  if (!(weight > 0.0)) return {CoefficientRecord::UNKNOWN, CoefficientRecord::UNKNOWN};
  const double value = sum / weight;
  // Scatter beyond the standard deviations: the process changed between the sets.
  double scatter = 0.0;
  for (const Term& t : terms) scatter += (t.value - value) * (t.value - value) / (t.variance + 1e-300);
  const double freedom = static_cast<double>(terms.size()) - 1.0;
  const double factor = freedom > 0.0 ? std::max(1.0, scatter / freedom) : 1.0;
  // The smallest widening is common to all and is not reduced by averaging.
  return {value, std::sqrt(factor / weight + fade * fade)};
}

}  // namespace

std::optional<CoefficientEstimate> CoefficientDatabase::estimate(const CoefficientQuery& query,
                                                                 const DistanceScale& scale) const {
  CoefficientEstimate result;
  std::vector<CoefficientRecord> records = near(query.tool, query);
  if (records.empty() && !query.tool.empty()) {
    records = near("", query);
    result.other_tool = true;
  }
  if (records.empty()) return std::nullopt;
  result.nearest = std::numeric_limits<double>::infinity();
  result.records = static_cast<int>(records.size());
  std::vector<double> distances;
  for (const CoefficientRecord& r : records) {
    distances.push_back(distance(r, query, scale));
    if (distances.back() < result.nearest) {
      result.nearest = distances.back();
      result.set.tool = r.set.tool;
      result.set.material = r.set.material;
      result.set.source = r.set.source;
    }
    result.set.stamp = std::max(result.set.stamp, r.set.stamp);
    result.set.tests += r.set.tests;
  }
  result.set.value = result.set.std_dev = NOT_IDENTIFIED;
  for (const CuttingKey& k : cuttingKeys()) {
    const auto [value, std_dev] = combine(records, distances, k.coefficient, scale.growth);
    result.set.value.*k.coefficient = value;
    result.set.std_dev.*k.coefficient = std_dev;
  }
  return result;
}

}  // namespace smartmill::loadmeter
