#pragma once

#include <functional>
#include <vector>

#include "smartmill_loadmeter/database/recommend.h"

namespace smartmill::loadmeter {

struct ShopOptions {
  int tools = 8, materials = 6;
  int days = 250, jobs = 4, cuts = 4;  ///< working days; jobs a day, cuts a job
  double pair_scatter = 0.04;          ///< [1] a pair departs from its shear zone
  double reading_error = 0.03;         ///< [1] of a cut's torque: depth, material from bar to bar
  unsigned seed = 1;
  /// @throws Error naming the value.
  void validate() const;
};

/// One job before which the database was asked.
struct ShopJob {
  int day = 0;
  bool answered = false, met = false;  ///< something was said; tool and material had met before
  EstimationMethod way{};
  double error = 0.0;   ///< [1] of Ktc
  bool inside = false;  ///< the truth lay within the 95 % interval
  double width = 0.0;   ///< [1] upper over lower
};

/// A year of a shop that starts with an empty database: each day jobs with tools and materials, some often
/// and some seldom; before each the database is asked what to reckon with, then every cut enters it as the
/// node enters it (running estimate of the job, RecursiveCoefficients). What tools and materials are follows
/// the shear zone (random stress and angles a material, rake and helix a tool) times a scatter of each pair,
/// and edges that wear.
std::vector<ShopJob> shopYear(const ShopOptions& options, const std::function<void(double)>& progress = {});

}  // namespace smartmill::loadmeter
