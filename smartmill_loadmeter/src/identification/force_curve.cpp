#include "smartmill_loadmeter/identification/force_curve.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

constexpr int SLICES = 12;         // of the edge's height
constexpr int MOST_SWEEPS = 4000;  // of the descent
constexpr double STILL = 1e-10;    // [1] change of a sweep that ends it

/// Unknowns: rises of the coefficients, the first from 0, tangential then radial.
struct System {
  Eigen::MatrixXd normal;
  Eigen::VectorXd right;
  double squares = 0.0, neighbours = 0.0;
  std::size_t rows = 0;
};

/// Row of fx and fy at a spindle angle, over the spline's coefficients. @return whether anything is cut
bool rowsAt(double angle, const ToolGeometry& tool, const Engagement& e, double top, int pieces,
            Eigen::RowVectorXd& x, Eigen::RowVectorXd& y) {
  const int n = pieces + 3;
  x.setZero(2 * n);
  y.setZero(2 * n);
  bool cuts = false;
  const double dz = e.axial_depth / SLICES;
  for (int tooth = 0; tooth < tool.teeth; ++tooth) {
    for (int slice = 0; slice < SLICES; ++slice) {
      double phi = std::fmod(angle + tool.toothAngle(tooth) - tool.lag() * dz * (slice + 0.5), units::TWO_PI);
      if (phi < 0.0) phi += units::TWO_PI;
      if (phi <= e.entry || phi >= e.exit) continue;
      const double chip = e.feed_per_tooth * std::sin(phi);
      if (!(chip > 0.0)) continue;
      cuts = true;
      int first = 0;
      const auto b = cubicSplines(std::min(chip, top), top, pieces, first);
      const double c = std::cos(phi), s = std::sin(phi);
      for (int k = 0; k < 4; ++k) {
        const double share = dz * b[static_cast<std::size_t>(k)];
        x(first + k) -= share * c;
        x(n + first + k) -= share * s;
        y(first + k) += share * s;
        y(n + first + k) -= share * c;
      }
    }
  }
  return cuts;
}

/// Sums over a row's coefficients from each on: of its rise.
void toRises(Eigen::RowVectorXd& row, int n) {
  for (int part = 0; part < 2; ++part) {
    for (int k = n - 2; k >= 0; --k) row(part * n + k) += row(part * n + k + 1);
  }
}

/// Least squares with no unknown below 0, by descent along one after the other (convex, so it ends at the
/// least).
Eigen::VectorXd notNegative(const Eigen::MatrixXd& normal, const Eigen::VectorXd& right) {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(right.size());
  for (int sweep = 0; sweep < MOST_SWEEPS; ++sweep) {
    double moved = 0.0, largest = 0.0;
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      if (!(normal(i, i) > 0.0)) continue;
      const double next = std::max(0.0, x(i) + (right(i) - normal.row(i).dot(x)) / normal(i, i));
      moved = std::max(moved, std::abs(next - x(i)));
      x(i) = next;
      largest = std::max(largest, next);
    }
    if (moved <= STILL * largest) break;
  }
  return x;
}

template <class Visit>
void eachSample(const std::vector<AngleRecord>& records, const ToolGeometry& tool, double top, int pieces,
                Visit visit) {
  Eigen::RowVectorXd x, y;
  for (const AngleRecord& record : records) {
    for (std::size_t i = 0; i < record.angle.size(); ++i) {
      if (!rowsAt(record.angle[i], tool, record.engagement, top, pieces, x, y)) continue;
      toRises(x, pieces + 3);
      toRises(y, pieces + 3);
      visit(x, record.fx[i], y, record.fy[i], static_cast<std::size_t>(&record - records.data()));
    }
  }
}

/// [m] thickest chip of all. @throws Error when a record's lists differ in length.
double thickest(const std::vector<AngleRecord>& records) {
  double top = 0.0;
  for (const AngleRecord& record : records) {
    if (record.fx.size() != record.angle.size() || record.fy.size() != record.angle.size())
      throw Error("force curve: angle, fx and fy differ in length");
    const Engagement& e = record.engagement;
    const bool across = e.entry < 0.5 * units::PI && e.exit > 0.5 * units::PI;
    top = std::max(top, e.feed_per_tooth * (across ? 1.0 : std::max(std::sin(e.entry), std::sin(e.exit))));
  }
  return top;
}

/// @param pulls of each record: gradient that it leaves at the solution @param effective [N2] variance a
/// sample
Eigen::MatrixXd covarianceOf(const System& system, const Eigen::VectorXd& rises,
                             std::vector<Eigen::VectorXd>& pulls, double effective) {
  // Rises at their bound are known to be 0; the others vary together.
  const double floor = 1e-9 * system.normal.diagonal().maxCoeff();
  Eigen::MatrixXd held = system.normal + floor * Eigen::MatrixXd::Identity(rises.size(), rises.size());
  for (Eigen::Index i = 0; i < rises.size(); ++i) {
    if (rises(i) > 0.0) continue;
    held.row(i).setZero();
    held.col(i).setZero();
    held(i, i) = 1e6 * system.normal.diagonal().maxCoeff();
  }
  const Eigen::MatrixXd inverse = linear::inverseSymmetric(held);
  Eigen::MatrixXd covariance = effective * inverse;
  const double witnesses = static_cast<double>(pulls.size());
  for (Eigen::VectorXd& pull : pulls) {
    for (Eigen::Index i = 0; i < rises.size(); ++i) {
      if (!(rises(i) > 0.0)) pull(i) = 0.0;
    }
    const Eigen::VectorXd moved = inverse * pull;
    if (pulls.size() > 1) covariance += witnesses / (witnesses - 1.0) * moved * moved.transpose();
  }
  return covariance;
}

}  // namespace

ForceCurves fitForceCurves(const std::vector<AngleRecord>& records, const ToolGeometry& tool, int pieces) {
  if (pieces < 2 || pieces > 30) throw Error("force curve: 2..30 pieces are due");
  const double top = thickest(records);
  if (!(top > 0.0)) throw Error("force curve: no chip is cut");
  const int n = pieces + 3;
  System system{Eigen::MatrixXd::Zero(2 * n, 2 * n), Eigen::VectorXd::Zero(2 * n)};
  eachSample(records, tool, top, pieces,
             [&](const auto& x, double fx, const auto& y, double fy, std::size_t) {
               system.normal.noalias() += x.transpose() * x + y.transpose() * y;
               system.right += fx * x.transpose() + fy * y.transpose();
               system.rows += 2;
             });
  if (system.rows < 20 * static_cast<std::size_t>(n)) throw Error("force curve: too few samples in cut");
  const Eigen::VectorXd rises = notNegative(system.normal, system.right);
  // What is left, and how long it stays alike.
  double last_x = 0.0, last_y = 0.0;
  // What a record leaves as a whole repeats from turn to turn: records are as many witnesses, not samples.
  std::vector<Eigen::VectorXd> pulls(records.size(), Eigen::VectorXd::Zero(2 * n));
  eachSample(records, tool, top, pieces,
             [&](const auto& x, double fx, const auto& y, double fy, std::size_t r) {
               const double left_x = fx - x.dot(rises), left_y = fy - y.dot(rises);
               system.squares += left_x * left_x + left_y * left_y;
               system.neighbours += left_x * last_x + left_y * last_y;
               pulls[r] += left_x * x.transpose() + left_y * y.transpose();
               last_x = left_x;
               last_y = left_y;
             });
  const double variance = system.squares / static_cast<double>(system.rows);
  const double alike = std::clamp(system.neighbours / system.squares, 0.0, 0.99);
  const double effective = variance * (1.0 + alike) / (1.0 - alike);
  const Eigen::MatrixXd covariance = covarianceOf(system, rises, pulls, effective);
  ForceCurves curves;
  curves.rms = std::sqrt(variance);
  for (int part = 0; part < 2; ++part) {
    ForceCurve& curve = part == 0 ? curves.tangential : curves.radial;
    double sum = 0.0;
    for (int k = 0; k < n; ++k) curve.value.push_back(sum += rises(part * n + k));
    for (int k = 0; k <= pieces; ++k) {
      curve.knots.push_back(top * k / pieces);
      int first = 0;
      const auto b = cubicSplines(curve.knots.back(), top, pieces, first);
      Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(2 * n);
      for (int i = 0; i < 4; ++i) row(part * n + first + i) = b[static_cast<std::size_t>(i)];
      toRises(row, n);
      curve.std_dev.push_back(std::sqrt(std::max(0.0, (row * covariance * row.transpose())(0))));
    }
  }
  return curves;
}

}  // namespace smartmill::loadmeter
