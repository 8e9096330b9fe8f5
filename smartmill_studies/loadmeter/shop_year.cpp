#include "loadmeter/shop_year.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>
#include <string>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/database/oblique.h"
#include "smartmill_loadmeter/identification/production.h"

namespace smartmill::loadmeter {
namespace {

struct ShopTool {
  std::string name;
  double rake = 0.0;  // [rad]
  ToolGeometry geometry;
  double edge_age = 0.0;  // [s]
};
struct ShopMaterial {
  std::string name;
  ShearZone zone;  // at zero rake
  double friction_slope = 0.0, shear_slope = 0.0;
  double edge_force = 0.0;  // [N/m]
};

class Shop {
 public:
  explicit Shop(const ShopOptions& options) : options_(options), random_(options.seed), database_("") {
    for (int t = 0; t < options.tools; ++t) {
      ShopTool tool;
      tool.name = "tool_" + std::to_string(t + 1);
      tool.rake = units::radFromDeg(uniform(2.0, 15.0));
      tool.geometry = {2 + t % 3, uniform(0.008, 0.025), units::radFromDeg(uniform(25.0, 45.0)), {}};
      tools_.push_back(tool);
    }
    for (int m = 0; m < options.materials; ++m) {
      ShopMaterial material;
      material.name = "material_" + std::to_string(m + 1);
      material.zone = {uniform(200e6, 700e6), units::radFromDeg(uniform(24.0, 36.0)),
                       units::radFromDeg(uniform(18.0, 35.0))};
      material.friction_slope = uniform(0.1, 0.5);
      material.shear_slope = uniform(0.5, 0.9);
      material.edge_force = uniform(1e4, 3e4);
      materials_.push_back(material);
    }
  }

  ShopJob job(int day) {
    ShopTool& tool = tools_[often(tools_.size())];
    const ShopMaterial& material = materials_[often(materials_.size())];
    const CuttingCoefficients truth = truthOf(tool, material);
    ShopJob job;
    job.day = day;
    job.met = met_.count({tool.name, material.name}) > 0;
    CoefficientQuery query;
    query.tool = tool.name;
    query.material = material.name;
    query.rake = tool.rake;
    query.helix = tool.geometry.helix;
    if (const auto answer = recommendCut(database_, query)) {
      job.answered = true;
      job.way = answer->method;
      job.error = std::abs(answer->set.value.ktc / truth.ktc - 1.0);
      job.inside = truth.ktc >= answer->ktc_lower && truth.ktc <= answer->ktc_upper;
      job.width = answer->ktc_upper / answer->ktc_lower;
    }
    cut(day, tool, material, truth);
    met_.insert({tool.name, material.name});
    return job;
  }

 private:
  double uniform(double low, double high) { return low + (high - low) * unit_(random_); }
  /// Frequencies differ between tools and materials.
  std::size_t often(std::size_t count) {
    const double u = unit_(random_);
    return std::min(count - 1, static_cast<std::size_t>(static_cast<double>(count) * u * u));
  }

  CuttingCoefficients truthOf(const ShopTool& tool, const ShopMaterial& material) {
    ShearZone zone = material.zone;
    zone.friction_angle += material.friction_slope * tool.rake;
    zone.shear_angle +=
        material.shear_slope * (tool.rake - (zone.friction_angle - material.zone.friction_angle));
    CuttingCoefficients k = obliqueCoefficients(zone, tool.rake, tool.geometry.helix);
    const auto found = scatter_.find({tool.name, material.name});
    const double scatter = found != scatter_.end()
                               ? found->second
                               : scatter_
                                     .emplace(std::pair{tool.name, material.name},
                                              std::exp(options_.pair_scatter * normal_(random_)))
                                     .first->second;
    k.ktc *= scatter;
    constexpr double LIFE = 3600.0;  // [s] in which the edge force grows by half
    k.kte = material.edge_force * (1.0 + 0.5 * tool.edge_age / LIFE);
    return k;
  }

  void cut(int day, ShopTool& tool, const ShopMaterial& material, const CuttingCoefficients& truth) {
    constexpr double MEMORY = 1800.0, TIME = 20.0, LIFE = 3600.0;  // [s]
    RecursiveCoefficients running(RecursiveCoefficients::Start(), MEMORY);
    for (int i = 0; i < options_.cuts; ++i) {
      TorqueMeasurement reading;
      reading.tool = tool.geometry;
      reading.engagement = {0.0, units::PI, uniform(0.5e-3, 3e-3), uniform(0.04e-3, 0.16e-3)};
      const auto row = meanForceMatrix(reading.tool, reading.engagement)[3];
      const double torque = row[0] * truth.ktc + row[3] * truth.kte;
      reading.torque = torque * (1.0 + options_.reading_error * normal_(random_));
      reading.torque_std = options_.reading_error * torque;
      reading.cutting_time = TIME;
      running.update(reading);
      tool.edge_age = std::fmod(tool.edge_age + TIME, LIFE);  // then it is reground
      CoefficientRecord record;
      record.set.stamp = 86400.0 * day + 600.0 * ++count_;
      record.set.tool = tool.name;
      record.set.material = material.name;
      record.set.source = SOURCE_PRODUCTION;
      record.set.tests = 1;
      record.set.value = record.set.std_dev = NOT_IDENTIFIED;
      const double alone = std::sqrt(static_cast<double>(running.readings()));
      record.set.value.ktc = running.ktc(), record.set.std_dev.ktc = alone * running.ktcStd();
      record.set.value.kte = running.kte(), record.set.std_dev.kte = alone * running.kteStd();
      record.rake = tool.rake;
      record.helix = tool.geometry.helix;
      record.edge_age = tool.edge_age;
      database_.add(record);
    }
  }

  ShopOptions options_;
  std::mt19937_64 random_;
  std::uniform_real_distribution<double> unit_;
  std::normal_distribution<double> normal_;
  CoefficientDatabase database_;
  std::vector<ShopTool> tools_;
  std::vector<ShopMaterial> materials_;
  std::map<std::pair<std::string, std::string>, double> scatter_;
  std::set<std::pair<std::string, std::string>> met_;
  int count_ = 0;
};

}  // namespace

void ShopOptions::validate() const {
  for (const int value : {tools, materials, days, jobs, cuts})
    if (value < 1) throw Error("shop: expected at least 1 tool, material, day, job and cut");
  if (!(pair_scatter >= 0.0) || !(reading_error > 0.0))
    throw Error("shop: expected a scatter of at least 0 and an error above 0");
}

std::vector<ShopJob> shopYear(const ShopOptions& options, const std::function<void(double)>& progress) {
  options.validate();
  Shop shop(options);
  std::vector<ShopJob> jobs;
  for (int day = 0; day < options.days; ++day) {
    for (int i = 0; i < options.jobs; ++i) jobs.push_back(shop.job(day));
    if (progress) progress((day + 1.0) / options.days);
  }
  return jobs;
}

}  // namespace smartmill::loadmeter
