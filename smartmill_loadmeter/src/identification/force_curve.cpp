#include "smartmill_loadmeter/identification/force_curve.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Core>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

constexpr int SLICES = 12;           // of the edge's height
constexpr int MOST_SWEEPS = 4000;    // of the descent
constexpr int STEPS = 4;             // of Gauss and Newton for the teeth's chips and the angle
constexpr double TURN = 2e-3;        // [rad] of differences
constexpr double MOST_EARLY = 0.1;   // [rad]
constexpr double MOST_OF_TOP = 0.5;  // [1] of the thickest chip that a tooth's may differ by
constexpr double STILL = 1e-10;      // [1] change of a sweep that ends it

/// Unknowns: rises of the coefficients, the first from 0, tangential then radial; then how much thicker each
/// tooth's chip is than the feed's (runout, uneven radii), times the mean slope; then by how much the angle
/// is early, times the mean force.
struct System {
  Eigen::MatrixXd normal;
  Eigen::VectorXd right;
  double squares = 0.0, neighbours = 0.0;
  std::size_t rows = 0;
};

/// What is held while the unknowns are found.
struct Form {
  const std::vector<AngleRecord>& records;
  const ToolGeometry& tool;
  double top = 0.0;  // [m]
  int pieces = 0;
  std::vector<double> thicker{};  // [m] of each tooth
  ForceCurves curves{};           // about which the teeth's chips are linear; empty at first
  double slope = 1.0;             // [N/m2]
  double early = 0.0;             // [rad] that the angle lags behind the force

  int ofCurve() const { return pieces + 3; }
  Eigen::Index ofBoth() const { return 2 * ofCurve(); }
  Eigen::Index ofAngle() const { return ofBoth() + tool.teeth; }
  Eigen::Index unknowns() const { return ofAngle() + 1; }
  double force() const { return slope * top; }  // [N/m]
};

/// What each edge in cut adds. @param visit gets the tooth, sine and cosine of its angle, chip [m], height
/// [m]
template <class Visit>
void eachEdge(double angle, const Form& form, const Engagement& e, Visit visit) {
  const int slices = form.tool.lag() == 0.0 ? 1 : SLICES;
  const double dz = e.axial_depth / slices;
  for (int tooth = 0; tooth < form.tool.teeth; ++tooth) {
    for (int slice = 0; slice < slices; ++slice) {
      double phi =
          std::fmod(angle + form.early + form.tool.toothAngle(tooth) - form.tool.lag() * dz * (slice + 0.5),
                    units::TWO_PI);
      if (phi < 0.0) phi += units::TWO_PI;
      if (phi <= e.entry || phi >= e.exit) continue;
      const double chip = e.feed_per_tooth * std::sin(phi) + form.thicker[static_cast<std::size_t>(tooth)];
      if (chip > 0.0) visit(tooth, std::sin(phi), std::cos(phi), chip, dz);
    }
  }
}

/// [N] of the curves that are held.
std::array<double, 2> heldForce(double angle, const Form& form, const Engagement& e) {
  std::array<double, 2> force{};
  eachEdge(angle, form, e, [&](int, double s, double c, double chip, double dz) {
    const double t = dz * form.curves.tangential.at(chip), r = dz * form.curves.radial.at(chip);
    force[0] -= t * c + r * s;
    force[1] += t * s - r * c;
  });
  return force;
}

/// Row of fx and fy at a spindle angle. @return whether anything is cut
bool rowsAt(double angle, const Form& form, const Engagement& e, Eigen::RowVectorXd& x,
            Eigen::RowVectorXd& y) {
  const int n = form.ofCurve();
  x.setZero(form.unknowns());
  y.setZero(form.unknowns());
  bool cuts = false;
  const bool slopes = !form.curves.tangential.value.empty();
  eachEdge(angle, form, e, [&](int tooth, double s, double c, double chip, double dz) {
    cuts = true;
    int first = 0;
    auto b = cubicSplines(std::min(chip, form.top), form.top, form.pieces, first);
    if (chip > form.top) {  // straight on, as the last two coefficients tell
      const double on = 3.0 * form.pieces / form.top * (chip - form.top);
      b[2] -= on;
      b[3] += on;
    }
    for (int k = 0; k < 4; ++k) {
      const double share = dz * b[static_cast<std::size_t>(k)];
      x(first + k) -= share * c;
      x(n + first + k) -= share * s;
      y(first + k) += share * s;
      y(n + first + k) -= share * c;
    }
    if (!slopes) return;
    const double t = dz * form.curves.tangential.slope(chip) / form.slope;
    const double r = dz * form.curves.radial.slope(chip) / form.slope;
    x(form.ofBoth() + tooth) -= t * c + r * s;
    y(form.ofBoth() + tooth) += t * s - r * c;
  });
  if (cuts && slopes) {
    const auto after = heldForce(angle + TURN, form, e), before = heldForce(angle - TURN, form, e);
    x(form.ofAngle()) = (after[0] - before[0]) / (2.0 * TURN * form.force());
    y(form.ofAngle()) = (after[1] - before[1]) / (2.0 * TURN * form.force());
  }
  return cuts;
}

/// Sums over a row's coefficients from each on: of its rise.
void toRises(Eigen::RowVectorXd& row, int n) {
  for (int part = 0; part < 2; ++part) {
    for (int k = n - 2; k >= 0; --k) row(part * n + k) += row(part * n + k + 1);
  }
}

/// Least squares with none of the first unknowns below 0, by descent along one after the other (convex, so it
/// ends at the least).
Eigen::VectorXd notNegative(const Eigen::MatrixXd& normal, const Eigen::VectorXd& right, Eigen::Index first) {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(right.size());
  for (int sweep = 0; sweep < MOST_SWEEPS; ++sweep) {
    double moved = 0.0, largest = 0.0;
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      if (!(normal(i, i) > 0.0)) continue;
      double next = x(i) + (right(i) - normal.row(i).dot(x)) / normal(i, i);
      if (i < first) next = std::max(0.0, next);
      moved = std::max(moved, std::abs(next - x(i)));
      x(i) = next;
      largest = std::max(largest, std::abs(next));
    }
    if (moved <= STILL * largest) break;
  }
  return x;
}

template <class Visit>
void eachSample(const Form& form, Visit visit) {
  Eigen::RowVectorXd x, y;
  for (const AngleRecord& record : form.records) {
    for (std::size_t i = 0; i < record.angle.size(); ++i) {
      if (!rowsAt(record.angle[i], form, record.engagement, x, y)) continue;
      toRises(x, form.ofCurve());
      toRises(y, form.ofCurve());
      visit(x, record.fx[i], y, record.fy[i], record.angle[i],
            static_cast<std::size_t>(&record - form.records.data()));
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

/// What a record alone pulls on: gradient by its fitted force, and that force's square.
struct Whole {
  Eigen::VectorXd pull;
  double square = 0.0;    // [N2] of the fitted force
  double residual = 0.0;  // [N2] of it with what is left
};

/// Share by which one record's force differs from another's as a whole (depth, wear, gain), by moments: what
/// is left of a record along its own fitted force, beyond what noise leaves there.
struct Scatter {
  double share = 0.0;            // [1]
  std::vector<double> share_of;  // [1] of each record, as far as it shows
};

Scatter scatterOf(const std::vector<Whole>& wholes, const Eigen::MatrixXd& inverse, double effective) {
  const auto n = static_cast<Eigen::Index>(wholes.size());
  // What a share of record d leaves along record c: fitted forces, less what the curves follow.
  Eigen::MatrixXd leaves(n, n);
  Eigen::VectorXd seen(n);
  for (Eigen::Index c = 0; c < n; ++c) {
    const Whole& one = wholes[static_cast<std::size_t>(c)];
    const Eigen::VectorXd moved = inverse * one.pull;
    for (Eigen::Index d = 0; d < n; ++d)
      leaves(d, c) = (c == d ? one.square : 0.0) - wholes[static_cast<std::size_t>(d)].pull.dot(moved);
    seen(c) = one.residual;
  }
  Scatter scatter;
  scatter.share_of.assign(wholes.size(), 0.0);
  const double told = leaves.squaredNorm();
  if (n < 2 || !(told > 0.0)) return scatter;
  const double square = std::max(0.0, (seen.squaredNorm() - effective * leaves.trace()) / told);
  scatter.share = std::sqrt(square);
  const Eigen::MatrixXd twice = leaves * leaves.transpose();
  if (!(square > 0.0)) return scatter;
  // Best guess of each: shares of that scatter and noise explain what is seen.
  Eigen::MatrixXd of_seen = square * twice + effective * leaves;
  of_seen += 1e-9 * of_seen.trace() * Eigen::MatrixXd::Identity(n, n);
  const Eigen::VectorXd guess = square * leaves.transpose() * (linear::inverseSymmetric(of_seen) * seen);
  for (Eigen::Index c = 0; c < n; ++c) scatter.share_of[static_cast<std::size_t>(c)] = guess(c);
  return scatter;
}

/// (X'X)^-1 where rises at their bound are known to be 0; the others vary together.
Eigen::MatrixXd inverseOf(const System& system, const Eigen::VectorXd& rises, Eigen::Index curves) {
  const double largest = system.normal.diagonal().maxCoeff();
  Eigen::MatrixXd held =
      system.normal + 1e-9 * largest * Eigen::MatrixXd::Identity(rises.size(), rises.size());
  for (Eigen::Index i = 0; i < rises.size(); ++i) {
    if (rises(i) > 0.0 || i >= curves) continue;
    held.row(i).setZero();
    held.col(i).setZero();
    held(i, i) = 1e6 * largest;
  }
  return linear::inverseSymmetric(held);
}

/// What the curves leave, be it noise or their form, which repeats from turn to turn: each half pitch of each
/// record is one witness of it, without what differs in a record as a whole; and that, too.
Eigen::MatrixXd covarianceOf(const Form& form, const Eigen::VectorXd& rises, const Eigen::MatrixXd& inverse,
                             const std::vector<Whole>& wholes, const Scatter& scatter) {
  const int sectors = 2 * form.tool.teeth;
  std::vector<Eigen::VectorXd> pulls(form.records.size() * static_cast<std::size_t>(sectors),
                                     Eigen::VectorXd::Zero(rises.size()));
  eachSample(form, [&](const auto& x, double fx, const auto& y, double fy, double angle, std::size_t r) {
    const double share = 1.0 + scatter.share_of[r];
    double place = std::fmod(angle / units::TWO_PI, 1.0);
    if (place < 0.0) place += 1.0;
    const auto sector = std::min(static_cast<int>(place * sectors), sectors - 1);
    pulls[r * static_cast<std::size_t>(sectors) + static_cast<std::size_t>(sector)] +=
        (fx - share * x.dot(rises)) * x.transpose() + (fy - share * y.dot(rises)) * y.transpose();
  });
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(rises.size(), rises.size());
  double witnesses = 0.0;
  for (const Eigen::VectorXd& pull : pulls) witnesses += pull.squaredNorm() > 0.0;
  const double taken = static_cast<double>((rises.array() != 0.0).count() - 1);
  const double few = witnesses > taken + 1.0 ? witnesses / (witnesses - taken) : witnesses;
  for (const Eigen::VectorXd& pull : pulls) {
    const Eigen::VectorXd moved = inverse * pull;
    covariance += few * moved * moved.transpose();
  }
  for (const Whole& whole : wholes) {
    const Eigen::VectorXd moved = inverse * whole.pull;
    covariance += std::pow(scatter.share, 2) * moved * moved.transpose();
  }
  return covariance;
}

}  // namespace

namespace {

/// Teeth's chips and angle as they are held, as unknowns.
Eigen::VectorXd heldOf(const Form& form) {
  Eigen::VectorXd held = Eigen::VectorXd::Zero(form.unknowns());
  for (int t = 0; t < form.tool.teeth; ++t)
    held(form.ofBoth() + t) = form.slope * form.thicker[static_cast<std::size_t>(t)];
  held(form.ofAngle()) = form.force() * form.early;
  return held;
}

/// Linear about what is held.
System systemOf(const Form& form) {
  System system{Eigen::MatrixXd::Zero(form.unknowns(), form.unknowns()),
                Eigen::VectorXd::Zero(form.unknowns())};
  const Eigen::VectorXd held = heldOf(form);
  eachSample(form, [&](const auto& x, double fx, const auto& y, double fy, double, std::size_t) {
    system.normal.noalias() += x.transpose() * x + y.transpose() * y;
    system.right += (fx + x.dot(held)) * x.transpose() + (fy + y.dot(held)) * y.transpose();
    system.rows += 2;
  });
  // All thicker by the same is another feed: their sum is 0.
  const double stiff = system.normal.diagonal().segment(form.ofBoth(), form.tool.teeth).maxCoeff();
  system.normal.block(form.ofBoth(), form.ofBoth(), form.tool.teeth, form.tool.teeth).array() += 1e3 * stiff;
  return system;
}

/// Without deviations.
ForceCurves curvesOf(const Form& form, const Eigen::VectorXd& found) {
  const int n = form.ofCurve();
  ForceCurves curves;
  for (int part = 0; part < 2; ++part) {
    ForceCurve& curve = part == 0 ? curves.tangential : curves.radial;
    double sum = 0.0;
    for (int k = 0; k < n; ++k) curve.value.push_back(sum += found(part * n + k));
    for (int k = 0; k <= form.pieces; ++k) curve.knots.push_back(form.top * k / form.pieces);
  }
  return curves;
}

/// Takes over what was found, for the next step.
void use(Form& form, const Eigen::VectorXd& found) {
  form.curves = curvesOf(form, found);
  for (int t = 0; t < form.tool.teeth; ++t)
    form.thicker[static_cast<std::size_t>(t)] =
        std::clamp(found(form.ofBoth() + t) / form.slope, -MOST_OF_TOP * form.top, MOST_OF_TOP * form.top);
  form.early = std::clamp(found(form.ofAngle()) / form.force(), -MOST_EARLY, MOST_EARLY);
  form.slope = std::max(form.curves.tangential.value.back() / form.top, 1.0);
}

/// Adds up what is left, and how long it stays alike.
std::vector<Whole> wholesOf(const Form& form, const Eigen::VectorXd& rises, System& system) {
  double last_x = 0.0, last_y = 0.0;
  std::vector<Whole> wholes(form.records.size(), Whole{Eigen::VectorXd::Zero(form.unknowns())});
  eachSample(form, [&](const auto& x, double fx, const auto& y, double fy, double, std::size_t r) {
    const double told_x = x.dot(rises), told_y = y.dot(rises);
    const double left_x = fx - told_x, left_y = fy - told_y;
    system.squares += left_x * left_x + left_y * left_y;
    system.neighbours += left_x * last_x + left_y * last_y;
    Whole& whole = wholes[r];
    whole.pull += told_x * x.transpose() + told_y * y.transpose();
    whole.square += told_x * told_x + told_y * told_y;
    whole.residual += left_x * told_x + left_y * told_y;
    last_x = left_x;
    last_y = left_y;
  });
  return wholes;
}

void addDeviations(const Form& form, const Eigen::MatrixXd& covariance, ForceCurves& curves) {
  for (int part = 0; part < 2; ++part) {
    ForceCurve& curve = part == 0 ? curves.tangential : curves.radial;
    for (const double chip : curve.knots) {
      int first = 0;
      const auto b = cubicSplines(chip, form.top, form.pieces, first);
      Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(form.unknowns());
      for (int i = 0; i < 4; ++i) row(part * form.ofCurve() + first + i) = b[static_cast<std::size_t>(i)];
      toRises(row, form.ofCurve());
      curve.std_dev.push_back(std::sqrt(std::max(0.0, (row * covariance * row.transpose())(0))));
    }
  }
}

}  // namespace

ForceCurves fitForceCurves(const std::vector<AngleRecord>& records, const ToolGeometry& tool, int pieces) {
  if (pieces < 2 || pieces > 30) throw Error("force curve: 2..30 pieces are due");
  Form form{records, tool, thickest(records), pieces};
  form.thicker.assign(static_cast<std::size_t>(tool.teeth), 0.0);
  if (!(form.top > 0.0)) throw Error("force curve: no chip is cut");
  System system;
  Eigen::VectorXd found;
  for (int step = 0; step <= STEPS; ++step) {
    system = systemOf(form);
    if (system.rows < 20 * static_cast<std::size_t>(form.ofCurve()))
      throw Error("force curve: too few samples in cut");
    found = notNegative(system.normal, system.right, form.ofBoth());
    if (step < STEPS) use(form, found);
  }
  const Eigen::MatrixXd inverse = inverseOf(system, found, form.ofBoth());
  const Eigen::VectorXd rises = found - heldOf(form);
  const std::vector<Whole> wholes = wholesOf(form, rises, system);
  const double variance = system.squares / static_cast<double>(system.rows);
  const double alike = std::clamp(system.neighbours / system.squares, 0.0, 0.99);
  const Scatter scatter = scatterOf(wholes, inverse, variance * (1.0 + alike) / (1.0 - alike));
  ForceCurves curves = curvesOf(form, found);
  addDeviations(form, covarianceOf(form, rises, inverse, wholes, scatter), curves);
  curves.rms = std::sqrt(variance);
  curves.scatter = scatter.share;
  return curves;
}

void widen(ForceCurves& curves, double share) {
  for (ForceCurve* curve : {&curves.tangential, &curves.radial}) {
    for (std::size_t k = 0; k < curve->knots.size(); ++k)
      curve->std_dev[k] = std::hypot(curve->std_dev[k], share * curve->at(curve->knots[k]));
  }
}

}  // namespace smartmill::loadmeter
