#include "smartmill_loadmeter/database/knowledge.h"

#include <Eigen/Dense>
#include <boost/math/distributions/chi_squared.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

#include "smartmill_core/model/machine_model.h"

namespace smartmill::loadmeter {

namespace {

constexpr double AGREEMENT = 0.99;  // [1] probability of the region of the difference

using Indices = std::vector<std::size_t>;

double valueOf(const CuttingCoefficients& of, std::size_t i) {
  return of.*cuttingKeys()[i].coefficient;
}

// Coefficients with a value and a standard deviation.
Indices knownOf(const CoefficientRecord& r) {
  Indices known;
  for (std::size_t i = 0; i < cuttingKeys().size(); ++i) {
    if (std::isfinite(valueOf(r.set.value, i)) && valueOf(r.set.std_dev, i) > 0.0) known.push_back(i);
  }
  return known;
}

Eigen::MatrixXd covarianceOf(const CoefficientRecord& r, const Indices& of) {
  const auto n = static_cast<Eigen::Index>(of.size());
  Eigen::MatrixXd c = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const std::size_t row = of[static_cast<std::size_t>(i)];
    c(i, i) = std::pow(valueOf(r.set.std_dev, row), 2);
    for (Eigen::Index j = i + 1; j < n; ++j) {
      const double stored =
          r.covariance[CoefficientRecord::covarianceIndex(row, of[static_cast<std::size_t>(j)])];
      if (std::isfinite(stored)) c(i, j) = c(j, i) = stored;
    }
  }
  return c;
}

Eigen::VectorXd valuesOf(const CoefficientRecord& r, const Indices& of) {
  Eigen::VectorXd v(static_cast<Eigen::Index>(of.size()));
  for (std::size_t i = 0; i < of.size(); ++i) v[static_cast<Eigen::Index>(i)] = valueOf(r.set.value, of[i]);
  return v;
}

// Inverse of a covariance whose elements differ by many decades.
Eigen::MatrixXd inverseOf(const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd scale = covariance.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd correlation = scale.asDiagonal() * covariance * scale.asDiagonal();
  return scale.asDiagonal() * correlation.inverse() * scale.asDiagonal();
}

// Adds the information of a record about the coefficients `of`.
void addInformation(const CoefficientRecord& r, const Indices& of, Eigen::MatrixXd* information,
                    Eigen::VectorXd* weighted) {
  const Indices known = knownOf(r);
  if (known.empty()) return;
  const Eigen::MatrixXd own = inverseOf(covarianceOf(r, known));
  const Eigen::VectorXd product = own * valuesOf(r, known);
  const auto at = [&](std::size_t i) {
    return std::distance(of.begin(), std::find(of.begin(), of.end(), known[i]));
  };
  for (std::size_t i = 0; i < known.size(); ++i) {
    (*weighted)[at(i)] += product[static_cast<Eigen::Index>(i)];
    for (std::size_t j = 0; j < known.size(); ++j)
      (*information)(at(i), at(j)) += own(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
  }
}

void addConditions(const CoefficientRecord& r, CoefficientKnowledge* known) {
  known->cutting_speed.add(r.cutting_speed);
  known->feed_per_tooth.add(r.feed_per_tooth);
  known->axial_depth.add(r.axial_depth);
  known->edge_age.add(r.edge_age);
}

// From the cuts alone: their combined values, correlated as the newest.
CoefficientRecord fromCuts(const CoefficientDatabase& database, const CoefficientRecord& newest) {
  CoefficientQuery query;
  query.tool = newest.set.tool;
  query.material = newest.set.material;
  CoefficientRecord combined = newest;
  const auto index = CoefficientRecord::covarianceIndex;
  const double correlation =
      newest.covariance[index(0, 3)] / (newest.set.std_dev.ktc * newest.set.std_dev.kte);
  if (const auto estimate = database.estimate(query)) combined.set = estimate->set;
  combined.covariance = CoefficientRecord::unknownCovariance();
  combined.covariance[index(0, 3)] = correlation * combined.set.std_dev.ktc * combined.set.std_dev.kte;
  return combined;
}

}  // namespace

void CoveredRange::add(double value) {
  if (!std::isfinite(value)) return;
  low = std::fmin(low, value);
  high = std::fmax(high, value);
}

CombinedRecord combine(const CoefficientRecord& newer, const CoefficientRecord& older) {
  CombinedRecord result{newer, true, 0.0};
  const Indices of_newer = knownOf(newer), of_older = knownOf(older);
  Indices all, common;
  std::set_union(of_newer.begin(), of_newer.end(), of_older.begin(), of_older.end(), std::back_inserter(all));
  std::set_intersection(of_newer.begin(), of_newer.end(), of_older.begin(), of_older.end(),
                        std::back_inserter(common));
  if (!common.empty()) {
    const Eigen::VectorXd difference = valuesOf(newer, common) - valuesOf(older, common);
    const double chi2 =
        difference.dot(inverseOf(covarianceOf(newer, common) + covarianceOf(older, common)) * difference);
    const auto freedom = static_cast<double>(common.size());
    result.deviation = std::sqrt(chi2 / freedom);
    result.agree = chi2 <= boost::math::quantile(boost::math::chi_squared(freedom), AGREEMENT);
  }
  if (all.empty()) return result;
  const auto n = static_cast<Eigen::Index>(all.size());
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd weighted = Eigen::VectorXd::Zero(n);
  addInformation(newer, all, &information, &weighted);
  addInformation(older, all, &information, &weighted);
  const Eigen::MatrixXd covariance = inverseOf(information);
  const Eigen::VectorXd value = covariance * weighted;
  CoefficientRecord& record = result.record;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const auto coefficient = cuttingKeys()[all[i]].coefficient;
    record.set.value.*coefficient = value[row];
    record.set.std_dev.*coefficient = std::sqrt(covariance(row, row));
    for (std::size_t j = i; j < all.size(); ++j)
      record.covariance[CoefficientRecord::covarianceIndex(all[i], all[j])] =
          covariance(row, static_cast<Eigen::Index>(j));
  }
  record.set.tests = newer.set.tests + older.set.tests;
  return result;
}

std::optional<CoefficientKnowledge> knowledgeOf(const CoefficientDatabase& database, const std::string& tool,
                                                const std::string& material) {
  if (tool.empty() || material.empty()) return std::nullopt;
  std::vector<CoefficientRecord> records = database.records(tool, material);
  if (records.empty()) return std::nullopt;
  CoefficientKnowledge known;
  for (const CoefficientRecord& r : records) addConditions(r, &known);
  std::reverse(records.begin(), records.end());  // newest first
  double begin = CoefficientRecord::UNKNOWN;     // [s] of the tests used so far
  for (const CoefficientRecord& r : records) {
    if (r.set.source == SOURCE_PRODUCTION) {
      ++known.production_cuts;
    } else if (known.identifications == 0) {
      known.combined = r;
      known.identifications = 1;
      begin = r.first_stamp;
    } else if (!(r.set.stamp < begin)) {
      continue;  // includes tests of a newer record, or their time is unknown
    } else if (known.superseded > 0) {
      ++known.superseded;
    } else if (const CombinedRecord both = combine(known.combined, r); both.agree) {
      known.combined = both.record;
      ++known.identifications;
      begin = r.first_stamp;
    } else {
      known.superseded = 1;
    }
  }
  if (known.identifications == 0) known.combined = fromCuts(database, records.front());
  return known;
}

}  // namespace smartmill::loadmeter
