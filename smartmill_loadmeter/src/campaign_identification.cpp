#include "smartmill_loadmeter/campaign_identification.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <Eigen/Cholesky>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/load_meter.h"

namespace smartmill::loadmeter {

namespace {

constexpr int UNKNOWNS = 4;  // viscous, coulomb, Ktc, Kte
using Row = Eigen::Matrix<double, UNKNOWNS, 1>;
using Normal = Eigen::Matrix<double, UNKNOWNS, UNKNOWNS>;

std::size_t firstInCut(const CampaignTest& test, const Record& record) {
  if (!test.engage_time) return 0;
  const double from = record.time.front() + *test.engage_time;
  const auto at = std::lower_bound(record.time.begin(), record.time.end(), from);
  return static_cast<std::size_t>(at - record.time.begin());
}

/// Torque of a unit of Ktc and of Kte on the time grid, both through the load meter's lag.
struct LaggedTorque {
  std::vector<double> ktc, kte;
};

// One first-order lag, exact for an input that runs linearly within a step.
class Lag {
 public:
  explicit Lag(double time_constant) : time_constant_(time_constant) {}
  void start(double value) { output_ = value; }
  double step(double from, double to, double dt) {
    const double a = std::exp(-dt / time_constant_), slope = dt > 0.0 ? (to - from) / dt : 0.0;
    output_ = a * output_ + (1.0 - a) * (from - slope * time_constant_) + slope * dt;
    return output_;
  }

 private:
  double time_constant_;
  double output_ = 0.0;
};

LaggedTorque laggedTorque(const CampaignTest& test, const Record& record, const ToolGeometry& tool,
                          double time_constant) {
  const Engagement& engagement = *test.engagement;
  const std::array<CuttingCoefficients, 2> unit{CuttingCoefficients{1, 0, 0, 0, 0, 0},
                                                CuttingCoefficients{0, 0, 0, 1, 0, 0}};
  const bool has_angle = record.has("spindle_angle");
  const double begin = record.time.front();
  const double engage = begin + test.engage_time.value_or(0.0);
  LaggedTorque lagged;
  for (int u = 0; u < 2; ++u) {
    const MechanisticForce force(tool, unit[static_cast<std::size_t>(u)], engagement);
    const double mean = force.mean().torque;
    Lag lag(time_constant);
    // In cut throughout: the meter has settled before the record.
    if (!test.engage_time) lag.start(mean);
    std::vector<double>& out = u == 0 ? lagged.ktc : lagged.kte;
    out.reserve(record.size());
    const std::vector<double>* angle = has_angle ? &record.column("spindle_angle") : nullptr;
    const auto torqueAt = [&](std::size_t i, double time) {
      if (!angle) return mean;
      return force.at((*angle)[i] + test.spindle_speed * (time - record.time[i])).torque;
    };
    double before = 0.0, t_before = begin;
    if (!test.engage_time) before = torqueAt(0, begin);
    for (std::size_t i = 0; i < record.size(); ++i) {
      const double t = begin + static_cast<double>(i) / test.sample_rate;
      double value = 0.0;
      // Engagement is a step that need not fall on a sample.
      if (t >= engage) {
        double now = torqueAt(i, record.time[i]);
        if (t_before < engage) {
          lag.step(0.0, 0.0, engage - t_before);
          before = torqueAt(i, record.time[i] - (t - engage));
          t_before = engage;
        }
        value = lag.step(before, now, t - t_before);
        before = now;
      }
      t_before = t;
      out.push_back(value);
    }
  }
  return lagged;
}

/// Sums of one record: its normal equations.
struct Cluster {
  Normal normal = Normal::Zero();
  Row right = Row::Zero();
  double squares = 0.0;
  double count = 0.0;
};

}  // namespace

IdentifiedCoefficients identifyFromForceRecords(const Campaign& campaign, const MachineModel& model,
                                                Means means) {
  const ToolGeometry& tool = model.needTool("identify cutting coefficients");
  std::vector<MeanForceTest> tests;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::cut) continue;
    const Record record = readRecord(campaign, test, model);
    std::size_t first = firstInCut(test, record);
    std::size_t count = record.size() - std::min(first, record.size());
    if (means == Means::revolutions) {
      const double turn = units::TWO_PI / test.spindle_speed * test.sample_rate;  // samples, not whole
      const double turns = std::floor(static_cast<double>(count) / turn + 1e-9);
      if (turns < 1.0) throw Error(record.file + ": less than one revolution in cut");
      const std::size_t whole = static_cast<std::size_t>(std::lround(turns * turn));
      // The last ones: farthest from what engagement set ringing. Without engagement the first ones.
      if (test.engage_time) first += count - whole;
      count = whole;
    }
    if (count == 0) throw Error(record.file + ": no samples after engage_time_s");
    MeanForceTest t;
    t.tool = tool;
    t.engagement = *test.engagement;
    const std::array<const char*, 3> names{"fx", "fy", "fz"};
    for (std::size_t a = 0; a < 3; ++a) {
      const std::vector<double>& force = record.column(names[a]);
      double sum = 0.0;
      for (std::size_t i = first; i < first + count; ++i) sum += force[i];
      t.force[a] = sum / static_cast<double>(count);
    }
    tests.push_back(t);
  }
  if (tests.empty()) throw Error(campaign.folder + ": no cut among the tests");
  return identifyFromForces(tests);
}

CoefficientSet identifyFromLoadRecords(const Campaign& campaign, const MachineModel& model,
                                       std::vector<std::string>* notes) {
  const Spindle& spindle = model.needSpindle("read the load meter");
  const ToolGeometry& tool = model.needTool("identify cutting coefficients");
  const double time_constant = timeConstant(spindle.load_meter_bandwidth);
  const bool any_air = std::any_of(campaign.tests.begin(), campaign.tests.end(),
                                   [](const CampaignTest& t) { return t.kind == TestKind::air; });
  const Friction known = modelFriction(spindle, model.uncertainty.spindle);

  // Columns in units of a typical value keep the 4x4 normal matrix well conditioned.
  const Row unit(1e-4, 1e-2, 1e9, 1e4);
  std::vector<Cluster> clusters;
  Row by_viscous = Row::Zero(), by_coulomb = Row::Zero();
  std::set<double> air_speeds;
  std::set<long> chips;
  int cuts = 0;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind == TestKind::tap) continue;
    const Record record = readRecord(campaign, test);
    if (!record.has("load_meter")) {
      notes->push_back(record.file + ": no load_meter column, left out");
      continue;
    }
    const std::vector<double>& voltage = record.column("load_meter");
    const double watt = spindle.load_meter_gain * test.spindle_speed;  // [V/Nm]
    const bool turning = test.spindle_speed >= spindle.friction_zero_below;
    LaggedTorque lagged;
    if (test.kind == TestKind::cut) {
      lagged = laggedTorque(test, record, tool, time_constant);
      const auto map = meanForceMatrix(tool, *test.engagement);
      chips.insert(std::lround(1e9 * map[3][0] / map[3][3]));
      ++cuts;
    } else if (turning) {
      air_speeds.insert(test.spindle_speed);
    }
    Cluster cluster;
    for (std::size_t i = 0; i < record.size(); ++i) {
      Row row = Row::Zero();
      double y = voltage[i] / watt;
      if (turning && any_air) {
        row[0] = test.spindle_speed;
        row[1] = 1.0;
      } else {
        y -= known.torque(test.spindle_speed);
      }
      if (test.kind == TestKind::cut) {
        row[2] = lagged.ktc[i];
        row[3] = lagged.kte[i];
      }
      row = row.cwiseProduct(unit) * watt;  // weighted by the meter's noise, the same voltage everywhere
      y *= watt;
      if (!any_air) {
        // How a wrong friction torque of the model moves the solution.
        const std::array<double, 2> gradient = known.gradient(test.spindle_speed);
        by_viscous += row * (watt * gradient[0]);
        by_coulomb += row * (watt * gradient[1]);
      }
      cluster.normal += row * row.transpose();
      cluster.right += row * y;
      cluster.squares += y * y;
      cluster.count += 1.0;
    }
    clusters.push_back(cluster);
  }
  if (any_air && air_speeds.size() < 2) {
    throw Error(campaign.folder + ": friction: air cuts at two or more speeds are due, " +
                std::to_string(air_speeds.size()) + " usable");
  }
  if (chips.size() < 3) {
    throw Error(campaign.folder + ": coefficients from torque: " + std::to_string(cuts) + " cuts at " +
                std::to_string(chips.size()) + " different feeds; at least three are due");
  }

  Cluster all;
  for (const Cluster& c : clusters) {
    all.normal += c.normal;
    all.right += c.right;
    all.squares += c.squares;
    all.count += c.count;
  }
  // The friction's columns are empty without air cuts: hold those unknowns at zero.
  if (!any_air) all.normal(0, 0) = all.normal(1, 1) = 1.0;
  const Eigen::LDLT<Normal> solver(all.normal);
  Row found = solver.solve(all.right);
  found += solver.solve(all.right - all.normal * found);
  const Normal inverse = solver.solve(Normal::Identity());
  // Residual squares from every record, by the expanded form relative to the solution's own.
  const double left = std::max(0.0, all.squares - 2.0 * found.dot(all.right) + found.dot(all.normal * found));
  const double freedom = all.count - (any_air ? 4.0 : 2.0);
  Normal covariance = inverse * (left / freedom);
  Normal between = Normal::Zero();
  for (const Cluster& c : clusters) {
    const Row score = c.right - c.normal * found;
    between += score * score.transpose();
  }
  const double n = static_cast<double>(clusters.size());
  const Normal scatter = inverse * between * inverse * (n / std::max(1.0, n - (any_air ? 4.0 : 2.0)));
  Row std_dev;
  for (int i = 0; i < UNKNOWNS; ++i)
    std_dev[i] = std::sqrt(std::max(covariance(i, i), scatter(i, i))) * unit[i];
  if (!any_air) {
    const Row v = inverse * by_viscous, k = inverse * by_coulomb;
    for (int i = 2; i < UNKNOWNS; ++i) {
      std_dev[i] = std::sqrt(std_dev[i] * std_dev[i] +
                             unit[i] * unit[i] *
                                 (v[i] * v[i] * known.covariance[0] + k[i] * k[i] * known.covariance[3]));
    }
  }
  found = found.cwiseProduct(unit);

  CoefficientSet result;
  result.value = result.std_dev = NOT_IDENTIFIED;
  result.value.ktc = found[2];
  result.value.kte = found[3];
  result.std_dev.ktc = std_dev[2];
  result.std_dev.kte = std_dev[3];
  if (any_air) {
    result.friction_viscous = found[0];
    result.friction_coulomb = found[1];
  }
  result.source = "load_meter";
  result.tests = cuts;
  return result;
}

}  // namespace smartmill::loadmeter
