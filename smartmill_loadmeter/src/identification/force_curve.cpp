#include "smartmill_loadmeter/identification/force_curve.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Core>

#include "smartmill_core/error.h"
#include "smartmill_core/math/angle.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

constexpr int MAX_SWEEPS = 4000;     // of the coordinate descent
constexpr double ANGLE_STEP = 2e-3;  // [rad] step of the numerical derivative
constexpr double CONVERGED = 1e-10;  // [1] relative change of a sweep at convergence

/// Normal equations. Unknowns: increments of the spline coefficients (the first from 0), tangential then
/// radial; chip-thickness offset of each tooth (runout, uneven radii) times the mean slope; angle offset
/// times the mean force.
struct NormalEquations {
  Eigen::MatrixXd normal;
  Eigen::VectorXd right;
  double squares = 0.0, neighbours = 0.0;
  std::size_t rows = 0;
};

/// Records, tool and point of linearisation.
struct CurveModel {
  const std::vector<AngleRecord>& records;
  const ToolGeometry& tool;
  const CurveFitOptions& options;
  double top = 0.0;  // [m]
  int pieces = 0;
  std::vector<double> chip_offset{};  // [m] chip-thickness offset of each tooth
  ForceCurves curves{};               // curves of the previous iteration; empty at first
  double slope = 1.0;                 // [N/m2]
  double angle_offset = 0.0;          // [rad] angle offset: the force precedes the angle

  int curveSize() const { return pieces + 3; }
  Eigen::Index offsetsBegin() const { return 2 * curveSize(); }
  Eigen::Index angleIndex() const { return offsetsBegin() + tool.teeth; }
  Eigen::Index unknowns() const { return angleIndex() + 1; }
  double force() const { return slope * top; }  // [N/m]
};

/// Visits each edge element in cut. @param visit gets the tooth, sine and cosine of its angle, chip [m],
/// height [m]
template <class Visit>
void eachEdge(double angle, const CurveModel& model, const Engagement& e, Visit visit) {
  const int slices = model.tool.lag() == 0.0 ? 1 : model.options.edge_slices;
  const double dz = e.axial_depth / slices, lag = model.tool.lag() * dz;
  const double lag_sine = std::sin(lag), lag_cosine = std::cos(lag);
  for (int tooth = 0; tooth < model.tool.teeth; ++tooth) {
    double phi = wrapped(angle + model.angle_offset + model.tool.toothAngle(tooth) - 0.5 * lag);
    double sine = std::sin(phi), cosine = std::cos(phi);
    for (int slice = 0; slice < slices; ++slice) {
      const double chip = e.feed_per_tooth * sine + model.chip_offset[static_cast<std::size_t>(tooth)];
      if (phi > e.entry && phi < e.exit && chip > 0.0) visit(tooth, sine, cosine, chip, dz);
      phi = wrapped(phi - lag);
      const double next = sine * lag_cosine - cosine * lag_sine;
      cosine = cosine * lag_cosine + sine * lag_sine;
      sine = next;
    }
  }
}

/// Force by the curves of the previous iteration [N].
std::array<double, 2> modelForce(double angle, const CurveModel& model, const Engagement& e) {
  std::array<double, 2> force{};
  eachEdge(angle, model, e, [&](int, double s, double c, double chip, double dz) {
    const CubicSplines splines(chip, model.top, model.pieces);
    const double t = dz * splines.valueOf(model.curves.tangential.value);
    const double r = dz * splines.valueOf(model.curves.radial.value);
    force[0] -= t * c + r * s;
    force[1] += t * s - r * c;
  });
  return force;
}

/// Rows of fx and fy at a spindle angle. @return whether a tooth is in cut
bool rowsAt(double angle, const CurveModel& model, const Engagement& e, Eigen::RowVectorXd& x,
            Eigen::RowVectorXd& y) {
  const int n = model.curveSize();
  x.setZero(model.unknowns());
  y.setZero(model.unknowns());
  bool cuts = false;
  const bool slopes = !model.curves.tangential.value.empty();
  eachEdge(angle, model, e, [&](int tooth, double s, double c, double chip, double dz) {
    cuts = true;
    const CubicSplines splines(chip, model.top, model.pieces);
    const int first = splines.first;
    for (int k = 0; k < 4; ++k) {
      const double share = dz * splines.value[static_cast<std::size_t>(k)];
      x(first + k) -= share * c;
      x(n + first + k) -= share * s;
      y(first + k) += share * s;
      y(n + first + k) -= share * c;
    }
    if (!slopes) return;
    const double t = dz * splines.slopeOf(model.curves.tangential.value) / model.slope;
    const double r = dz * splines.slopeOf(model.curves.radial.value) / model.slope;
    x(model.offsetsBegin() + tooth) -= t * c + r * s;
    y(model.offsetsBegin() + tooth) += t * s - r * c;
  });
  if (cuts && slopes) {
    const auto after = modelForce(angle + ANGLE_STEP, model, e),
               before = modelForce(angle - ANGLE_STEP, model, e);
    x(model.angleIndex()) = (after[0] - before[0]) / (2.0 * ANGLE_STEP * model.force());
    y(model.angleIndex()) = (after[1] - before[1]) / (2.0 * ANGLE_STEP * model.force());
  }
  return cuts;
}

/// Converts a row of coefficients into one of increments, by sums over the following coefficients.
void toIncrements(Eigen::RowVectorXd& row, int n) {
  for (int component = 0; component < 2; ++component) {
    for (int k = n - 2; k >= 0; --k) row(component * n + k) += row(component * n + k + 1);
  }
}

/// Least squares with the first unknowns not negative, by coordinate descent (convex, so that it converges to
/// the minimum).
Eigen::VectorXd solveNonNegative(const Eigen::MatrixXd& normal, const Eigen::VectorXd& right,
                                 Eigen::Index first) {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(right.size());
  for (int sweep = 0; sweep < MAX_SWEEPS; ++sweep) {
    double shift = 0.0, largest = 0.0;
    for (Eigen::Index i = 0; i < x.size(); ++i) {
      if (!(normal(i, i) > 0.0)) continue;
      double next = x(i) + (right(i) - normal.row(i).dot(x)) / normal(i, i);
      if (i < first) next = std::max(0.0, next);
      shift = std::max(shift, std::abs(next - x(i)));
      x(i) = next;
      largest = std::max(largest, std::abs(next));
    }
    if (shift <= CONVERGED * largest) break;
  }
  return x;
}

template <class Visit>
void eachSample(const CurveModel& model, Visit visit) {
  Eigen::RowVectorXd x, y;
  for (const AngleRecord& record : model.records) {
    for (std::size_t i = 0; i < record.angle.size(); ++i) {
      if (!rowsAt(record.angle[i], model, record.engagement, x, y)) continue;
      toIncrements(x, model.curveSize());
      toIncrements(y, model.curveSize());
      visit(x, record.fx[i], y, record.fy[i], record.angle[i],
            static_cast<std::size_t>(&record - model.records.data()));
    }
  }
}

/// Thickest chip [m]. @throws Error when the columns of a record differ in length.
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

/// Influence of one record: gradient by its fitted force, and the square of that force.
struct RecordInfluence {
  Eigen::VectorXd gradient;
  double square = 0.0;    // [N2] of the fitted force
  double residual = 0.0;  // [N2] of the fitted force with the residual
};

/// Scale factors by which the records' forces differ (depth, wear, gain), by the method of moments: residual
/// of a record along its fitted force, beyond the contribution of noise.
struct Scatter {
  double share = 0.0;            // [1]
  std::vector<double> share_of;  // [1] best prediction for each record
};

Scatter scatterOf(const std::vector<RecordInfluence>& influences, const Eigen::MatrixXd& inverse,
                  double effective) {
  const auto n = static_cast<Eigen::Index>(influences.size());
  // Residual along record c by a unit scale error of record d: fitted forces minus the response of the
  // curves.
  Eigen::MatrixXd leaves(n, n);
  Eigen::VectorXd residual(n);
  for (Eigen::Index c = 0; c < n; ++c) {
    const RecordInfluence& one = influences[static_cast<std::size_t>(c)];
    const Eigen::VectorXd shift = inverse * one.gradient;
    for (Eigen::Index d = 0; d < n; ++d)
      leaves(d, c) =
          (c == d ? one.square : 0.0) - influences[static_cast<std::size_t>(d)].gradient.dot(shift);
    residual(c) = one.residual;
  }
  Scatter scatter;
  scatter.share_of.assign(influences.size(), 0.0);
  const double norm = leaves.squaredNorm();
  if (n < 2 || !(norm > 0.0)) return scatter;
  const double square = std::max(0.0, (residual.squaredNorm() - effective * leaves.trace()) / norm);
  scatter.share = std::sqrt(square);
  const Eigen::MatrixXd twice = leaves * leaves.transpose();
  if (!(square > 0.0)) return scatter;
  // Best linear prediction of each scale error.
  Eigen::MatrixXd residual_covariance = square * twice + effective * leaves;
  residual_covariance += 1e-9 * residual_covariance.trace() * Eigen::MatrixXd::Identity(n, n);
  const Eigen::VectorXd prediction =
      square * leaves.transpose() * (linear::inverseSymmetric(residual_covariance) * residual);
  for (Eigen::Index c = 0; c < n; ++c) scatter.share_of[static_cast<std::size_t>(c)] = prediction(c);
  return scatter;
}

/// (X'X)^-1 with increments at their bound fixed to 0.
Eigen::MatrixXd inverseOf(const NormalEquations& equations, const Eigen::VectorXd& increments,
                          Eigen::Index curves) {
  const double largest = equations.normal.diagonal().maxCoeff();
  Eigen::MatrixXd offsets =
      equations.normal + 1e-9 * largest * Eigen::MatrixXd::Identity(increments.size(), increments.size());
  for (Eigen::Index i = 0; i < increments.size(); ++i) {
    if (increments(i) > 0.0 || i >= curves) continue;
    offsets.row(i).setZero();
    offsets.col(i).setZero();
    offsets(i, i) = 1e6 * largest;
  }
  return linear::inverseSymmetric(offsets);
}

/// Covariance by a cluster sandwich: noise and the error of the splines, which repeats from revolution to
/// revolution. Each half pitch of each record is a cluster, without the record's scale error; the scatter of
/// scale errors is added.
Eigen::MatrixXd covarianceOf(const CurveModel& model, const Eigen::VectorXd& increments,
                             const Eigen::MatrixXd& inverse, const std::vector<RecordInfluence>& influences,
                             const Scatter& scatter) {
  const int sectors = 2 * model.tool.teeth;
  std::vector<Eigen::VectorXd> gradients(model.records.size() * static_cast<std::size_t>(sectors),
                                         Eigen::VectorXd::Zero(increments.size()));
  eachSample(model, [&](const auto& x, double fx, const auto& y, double fy, double angle, std::size_t r) {
    const double share = 1.0 + scatter.share_of[r];
    double revolution_share = std::fmod(angle / units::TWO_PI, 1.0);
    if (revolution_share < 0.0) revolution_share += 1.0;
    const auto sector = std::min(static_cast<int>(revolution_share * sectors), sectors - 1);
    gradients[r * static_cast<std::size_t>(sectors) + static_cast<std::size_t>(sector)] +=
        (fx - share * x.dot(increments)) * x.transpose() + (fy - share * y.dot(increments)) * y.transpose();
  });
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(increments.size(), increments.size());
  double clusters = 0.0;
  for (const Eigen::VectorXd& gradient : gradients) clusters += gradient.squaredNorm() > 0.0;
  const double free_unknowns = static_cast<double>((increments.array() != 0.0).count() - 1);
  const double few = clusters > free_unknowns + 1.0 ? clusters / (clusters - free_unknowns) : clusters;
  for (const Eigen::VectorXd& gradient : gradients) {
    const Eigen::VectorXd shift = inverse * gradient;
    covariance += few * shift * shift.transpose();
  }
  for (const RecordInfluence& influence : influences) {
    const Eigen::VectorXd shift = inverse * influence.gradient;
    covariance += std::pow(scatter.share, 2) * shift * shift.transpose();
  }
  return covariance;
}

}  // namespace

namespace {

/// Chip and angle offsets of the point of linearisation, as unknowns.
Eigen::VectorXd offsetsOf(const CurveModel& model) {
  Eigen::VectorXd offsets = Eigen::VectorXd::Zero(model.unknowns());
  for (int t = 0; t < model.tool.teeth; ++t)
    offsets(model.offsetsBegin() + t) = model.slope * model.chip_offset[static_cast<std::size_t>(t)];
  offsets(model.angleIndex()) = model.force() * model.angle_offset;
  return offsets;
}

/// Linearised normal equations.
NormalEquations systemOf(const CurveModel& model) {
  NormalEquations equations{Eigen::MatrixXd::Zero(model.unknowns(), model.unknowns()),
                            Eigen::VectorXd::Zero(model.unknowns())};
  const Eigen::VectorXd offsets = offsetsOf(model);
  eachSample(model, [&](const auto& x, double fx, const auto& y, double fy, double, std::size_t) {
    equations.normal.noalias() += x.transpose() * x + y.transpose() * y;
    equations.right += (fx + x.dot(offsets)) * x.transpose() + (fy + y.dot(offsets)) * y.transpose();
    equations.rows += 2;
  });
  // A common offset of all teeth is another feed, so that their sum is constrained to 0.
  const double stiff = equations.normal.diagonal().segment(model.offsetsBegin(), model.tool.teeth).maxCoeff();
  equations.normal.block(model.offsetsBegin(), model.offsetsBegin(), model.tool.teeth, model.tool.teeth)
      .array() += 1e3 * stiff;
  return equations;
}

/// Without standard deviations.
ForceCurves curvesOf(const CurveModel& model, const Eigen::VectorXd& found) {
  const int n = model.curveSize();
  ForceCurves curves;
  for (int component = 0; component < 2; ++component) {
    ForceCurve& curve = component == 0 ? curves.tangential : curves.radial;
    double sum = 0.0;
    for (int k = 0; k < n; ++k) curve.value.push_back(sum += found(component * n + k));
    for (int k = 0; k <= model.pieces; ++k) curve.knots.push_back(model.top * k / model.pieces);
  }
  return curves;
}

/// Moves the point of linearisation.
void relinearise(CurveModel& model, const Eigen::VectorXd& found) {
  model.curves = curvesOf(model, found);
  for (int t = 0; t < model.tool.teeth; ++t)
    model.chip_offset[static_cast<std::size_t>(t)] = std::clamp(
        found(model.offsetsBegin() + t) / model.slope, -model.options.largest_chip_offset * model.top,
        model.options.largest_chip_offset * model.top);
  model.angle_offset = std::clamp(found(model.angleIndex()) / model.force(),
                                  -model.options.largest_angle_offset, model.options.largest_angle_offset);
  model.slope = std::max(model.curves.tangential.value.back() / model.top, 1.0);
}

/// Adds up the residuals and their autocorrelation.
std::vector<RecordInfluence> influencesOf(const CurveModel& model, const Eigen::VectorXd& increments,
                                          NormalEquations& equations) {
  double last_x = 0.0, last_y = 0.0;
  std::vector<RecordInfluence> influences(model.records.size(),
                                          RecordInfluence{Eigen::VectorXd::Zero(model.unknowns())});
  eachSample(model, [&](const auto& x, double fx, const auto& y, double fy, double, std::size_t r) {
    const double fitted_x = x.dot(increments), fitted_y = y.dot(increments);
    const double residual_x = fx - fitted_x, residual_y = fy - fitted_y;
    equations.squares += residual_x * residual_x + residual_y * residual_y;
    equations.neighbours += residual_x * last_x + residual_y * last_y;
    RecordInfluence& influence = influences[r];
    influence.gradient += fitted_x * x.transpose() + fitted_y * y.transpose();
    influence.square += fitted_x * fitted_x + fitted_y * fitted_y;
    influence.residual += residual_x * fitted_x + residual_y * fitted_y;
    last_x = residual_x;
    last_y = residual_y;
  });
  return influences;
}

void addDeviations(const CurveModel& model, const Eigen::MatrixXd& covariance, ForceCurves& curves) {
  for (int component = 0; component < 2; ++component) {
    ForceCurve& curve = component == 0 ? curves.tangential : curves.radial;
    for (const double chip : curve.knots) {
      const CubicSplines splines(chip, model.top, model.pieces);
      Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(model.unknowns());
      for (int i = 0; i < 4; ++i)
        row(component * model.curveSize() + splines.first + i) = splines.value[static_cast<std::size_t>(i)];
      toIncrements(row, model.curveSize());
      curve.std_dev.push_back(std::sqrt(std::max(0.0, (row * covariance * row.transpose())(0))));
    }
  }
}

}  // namespace

ForceCurves fitForceCurves(const std::vector<AngleRecord>& records, const ToolGeometry& tool, int pieces,
                           const CurveFitOptions& options) {
  if (pieces < 2 || pieces > 30)
    throw Error("force curve: " + std::to_string(pieces) + " segments of a spline, expected 2..30");
  requireStraightEdge(tool, "to fit a force curve");
  CurveModel model{records, tool, options, thickest(records), pieces};
  model.chip_offset.assign(static_cast<std::size_t>(tool.teeth), 0.0);
  if (!(model.top > 0.0)) throw Error("force curve: no chip thickness > 0 in the records");
  NormalEquations equations;
  Eigen::VectorXd found;
  for (int step = 0; step <= options.iterations; ++step) {
    equations = systemOf(model);
    if (equations.rows < 20 * static_cast<std::size_t>(model.curveSize()))
      throw Error("force curve: too few samples in cut");
    found = solveNonNegative(equations.normal, equations.right, model.offsetsBegin());
    if (step < options.iterations) relinearise(model, found);
  }
  const Eigen::MatrixXd inverse = inverseOf(equations, found, model.offsetsBegin());
  const Eigen::VectorXd increments = found - offsetsOf(model);
  const std::vector<RecordInfluence> influences = influencesOf(model, increments, equations);
  const double variance = equations.squares / static_cast<double>(equations.rows);
  const double correlation = std::clamp(equations.neighbours / equations.squares, 0.0, 0.99);
  const Scatter scatter =
      scatterOf(influences, inverse, variance * (1.0 + correlation) / (1.0 - correlation));
  ForceCurves curves = curvesOf(model, found);
  addDeviations(model, covarianceOf(model, increments, inverse, influences, scatter), curves);
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
