#pragma once

#include <functional>
#include <vector>

#include "smartmill_loadmeter/database/recommend.h"

namespace smartmill::loadmeter {

struct ShopOptions {
  int tools = 8, materials = 6;
  int days = 250, jobs = 4, cuts = 4;  ///< working days; jobs per day, cuts per job
  double pair_scatter = 0.04;          ///< [1] deviation of a pair from its shear zone
  double reading_error = 0.03;         ///< [1] of the torque of a cut: depth, variation of the material
  unsigned seed = 1;
  /// @throws Error naming the value.
  void validate() const;
};

/// One job with the database query before it.
struct ShopJob {
  int day = 0;
  bool answered = false, met = false;  ///< there was an estimate; tool and material were combined before
  EstimationMethod way{};
  double error = 0.0;   ///< [1] of Ktc
  bool inside = false;  ///< the truth lay within the 95 % interval
  double width = 0.0;   ///< [1] upper over lower
};

/// A year of a shop that starts with an empty database: each day has jobs with tools and materials of
/// different frequency. Before each job the database is queried, then every cut is stored as by the node
/// (running estimate of the job, RecursiveCoefficients). The true coefficients follow the shear zone (random
/// stress and angles per material, rake and helix per tool) times a scatter of each pair, and edge wear.
std::vector<ShopJob> shopYear(const ShopOptions& options, const std::function<void(double)>& progress = {});

}  // namespace smartmill::loadmeter
