#include "smartmill_kalman/following/mode_follower.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/Core>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/cutting/rigid_cut.h"
#include "smartmill_core/error.h"
#include "smartmill_core/fit/least_squares.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;
constexpr std::size_t POINTS = 1024;  // a revolution
constexpr int MAX_ITERATIONS = 20;
constexpr double RADIUS_UNIT = 1e-6;       // [m]
constexpr double RADIUS_STD = 20.0;        // [RADIUS_UNIT]
constexpr std::size_t TERMS = 4;           // tangential and radial, chip and edge
using Sensor = std::array<ModalModel, 2>;  // x, y
using Basis = std::array<ModeFollower::Harmonics, TERMS>;

/// Search of a mode that is missing in the taps: frequencies, initial damping, prior of the gain.
constexpr double HIDDEN_LOW = 300.0, HIDDEN_STEP = 1.02;  // [Hz], [1]
constexpr double HIDDEN_DAMPING = 0.03, GAIN_STD = 0.05;  // [1]
/// Evidence for a missing mode, in units of the evidence for a shift; least number of redundant rows.
constexpr double HIDDEN_EVIDENCE = 2.0;
/// Mean square of the normalised innovations above which a mode may be missing; largest cost with that mode
/// over the cost without. A wrong force model (helix, depth, exit) leaves a third of the cost or more.
constexpr double UNEXPLAINED = 2.0, MAX_COST_RATIO = 0.25;
constexpr Eigen::Index MIN_REDUNDANCY = 12;

/// Modes shifted by p: log frequency and log damping of each mode, x then y; then optionally the increase of
/// each gain, at constant static gain.
std::array<ModalModel, 2> shiftedSensor(const std::array<ModalModel, 2>& from, const Eigen::VectorXd& p,
                                        bool gains) {
  std::array<ModalModel, 2> sensor = from;
  Eigen::Index at = 0;
  for (ModalModel& axis : sensor) {
    for (Mode& mode : axis.modes) {
      mode.frequency *= std::exp(p(at++));
      mode.damping_ratio = std::min(0.9, mode.damping_ratio * std::exp(p(at++)));
    }
  }
  for (ModalModel& axis : sensor) {
    for (std::size_t k = 0; gains && k < axis.modes.size(); ++k) {
      axis.direct -= p(at);
      axis.modes[k].gain += p(at++);
    }
  }
  return sensor;
}

/// Harmonics of the force for each coefficient alone: tangential and radial, chip and edge.
Basis harmonicsOf(const ToolGeometry& tool, const Engagement& engagement, const std::vector<double>& radius) {
  const double chip = 1.0 / engagement.feed_per_tooth;
  Basis result;
  for (std::size_t direction = 0; direction < 2; ++direction) {
    CuttingLaw law;
    if (direction == 0) {
      law.coefficients.ktc = chip, law.coefficients.kte = 1.0;
    } else {
      law.coefficients.krc = chip, law.coefficients.kre = 1.0;
    }
    const RigidCut cut(tool, law, engagement, radius);
    std::array<std::array<std::vector<double>, 2>, 2> force;  // of chip and edge, x and y
    for (std::size_t i = 0; i < POINTS; ++i) {
      const auto parts = cut.termsAt(units::TWO_PI * static_cast<double>(i) / POINTS);
      for (std::size_t part = 0; part < 2; ++part) {
        force[part][0].push_back(parts[part].fx);
        force[part][1].push_back(parts[part].fy);
      }
    }
    for (std::size_t part = 0; part < 2; ++part) {
      for (std::size_t axis = 0; axis < 2; ++axis) {
        auto& harmonics = result[2 * part + direction][axis];
        harmonics = fourier(force[part][axis]);
        for (Complex& value : harmonics) value *= 2.0 / POINTS;
        harmonics[0] *= 0.5;
      }
    }
  }
  return result;
}

/// Solution of a linear least-squares problem, its normal matrix stiffened by a share of its diagonal.
Eigen::VectorXd leastSquares(const Eigen::MatrixXd& columns, const Eigen::VectorXd& target, double stiffer) {
  Eigen::MatrixXd normal = columns.transpose() * columns;
  normal.diagonal().array() *= 1.0 + stiffer;
  return linear::solveSymmetric(normal, Eigen::VectorXd(columns.transpose() * target));
}

/// Weighted harmonics of one revolution of the cut: a real and an imaginary row for each axis and harmonic,
/// including the mean.
class WeightedHarmonics {
 public:
  WeightedHarmonics(const ModeFollower::Harmonics& measured, std::size_t count, double noise_std,
                    double misfit, const Sensor& now, double spindle_speed)
      : count_(count), spindle_frequency_(spindle_speed / units::TWO_PI), weight_(rows()), target_(rows()) {
    for (std::size_t axis = 0; axis < 2; ++axis) {
      // The error of the force model passes the sensor too.
      double largest = 0.0;
      for (std::size_t n = 0; n < count_; ++n) {
        const double passed = std::abs(now[axis].response(frequency(n)));
        largest = std::max(largest, std::abs(measured[axis][n]) / std::max(1.0, passed));
      }
      for (std::size_t n = 0; n < count_; ++n) {
        const double passed = std::abs(now[axis].response(frequency(n)));
        const double missed = misfit * std::max(0.1 * passed * largest, std::abs(measured[axis][n]));
        const Eigen::Index row = rowOf(axis, n);
        weight_(row) = weight_(row + 1) = 1.0 / std::hypot(noise_std, missed);
        target_(row) = measured[axis][n].real();
        target_(row + 1) = measured[axis][n].imag();
      }
    }
    target_.array() *= weight_.array();
  }

  Eigen::Index rows() const { return static_cast<Eigen::Index>(4 * count_); }
  const Eigen::VectorXd& target() const { return target_; }

  /// Weighted sensor output of a force. @param harmonic (axis, n) to [N]
  template <class Harmonic>
  Eigen::VectorXd outputOf(const Sensor& sensor, const Harmonic& harmonic) const {
    Eigen::VectorXd column(rows());
    for (std::size_t axis = 0; axis < 2; ++axis) {
      for (std::size_t n = 0; n < count_; ++n) {
        const Complex y = sensor[axis].response(frequency(n)) * harmonic(axis, n);
        const Eigen::Index row = rowOf(axis, n);
        column(row) = weight_(row) * y.real();
        column(row + 1) = weight_(row) * y.imag();
      }
    }
    return column;
  }
  Eigen::MatrixXd outputOf(const Sensor& sensor, const Basis& basis) const {
    Eigen::MatrixXd columns(rows(), static_cast<Eigen::Index>(TERMS));
    for (std::size_t term = 0; term < TERMS; ++term)
      columns.col(static_cast<Eigen::Index>(term)) =
          outputOf(sensor, [&](std::size_t axis, std::size_t n) { return basis[term][axis][n]; });
    return columns;
  }

  /// Weighted sensor output by an additional mode at f [Hz] with gain 1 in an axis, at constant static gain.
  Eigen::VectorXd hidden(std::size_t axis, double f, const Sensor& sensor, const Basis& basis) const {
    const Eigen::VectorXd x = leastSquares(outputOf(sensor, basis), target_, 1e-10);
    Sensor only;
    only[axis].modes = {{f, HIDDEN_DAMPING, 1.0}};
    only[axis].direct = -1.0;
    return outputOf(only, basis) * x;
  }
  double highest() const { return static_cast<double>(count_ - 1) * spindle_frequency_; }  ///< [Hz]

  /// Residual with the force model's numbers at their best for this sensor.
  Eigen::VectorXd innovations(const Sensor& sensor, const Basis& basis) const {
    const Eigen::MatrixXd columns = outputOf(sensor, basis);
    return target_ - columns * leastSquares(columns, target_, 1e-10);
  }

 private:
  double frequency(std::size_t n) const { return static_cast<double>(n) * spindle_frequency_; }
  Eigen::Index rowOf(std::size_t axis, std::size_t n) const {
    return static_cast<Eigen::Index>(2 * (axis * count_ + n));
  }

  std::size_t count_;
  double spindle_frequency_;  // [Hz]
  Eigen::VectorXd weight_, target_;
};

/// Initial radii [m] of the teeth: to first order, runout changes the chip thickness of each tooth.
std::vector<double> firstRadii(const WeightedHarmonics& measured, const Sensor& now, const ToolGeometry& tool,
                               const Engagement& engagement) {
  std::vector<double> radius(static_cast<std::size_t>(tool.teeth), 0.0);
  ToolGeometry one = tool;
  one.teeth = 1;
  one.pitch.clear();
  const Basis tooth = harmonicsOf(one, engagement, {0.0});
  const Eigen::MatrixXd even = measured.outputOf(now, harmonicsOf(tool, engagement, radius));
  const Eigen::VectorXd x = leastSquares(even, measured.target(), 0.0);
  Eigen::MatrixXd teeth(measured.rows(), tool.teeth);
  for (int k = 0; k < tool.teeth; ++k) {
    teeth.col(k) = measured.outputOf(now, [&](std::size_t axis, std::size_t n) {
      const Complex turned = std::polar(1.0, static_cast<double>(n) * tool.toothAngle(k));
      return turned * (x(0) * tooth[2][axis][n] + x(1) * tooth[3][axis][n]) / engagement.feed_per_tooth;
    });
  }
  const Eigen::VectorXd thicker = leastSquares(teeth, measured.target() - even * x, 1e-6);  // [m]
  for (Eigen::Index k = 0; k + 1 < tool.teeth; ++k) {
    // Tooth k cuts the surface of tooth k + 1.
    const double limit = 0.5 * engagement.feed_per_tooth;
    radius[static_cast<std::size_t>(k + 1)] =
        radius[static_cast<std::size_t>(k)] - std::clamp(thicker(k) - thicker.mean(), -limit, limit);
  }
  return radius;
}

/// Innovations of the cut and prior of the unknowns: modes (log frequency, log damping of each, x then y) and
/// the teeth's radii [RADIUS_UNIT], the first tooth's being the datum.
class CutResiduals : public fit::Residuals {
 public:
  CutResiduals(const WeightedHarmonics& measured, const Sensor& now, const ToolGeometry& tool,
               const Engagement& engagement, const std::vector<double>& radius,
               const ModeFollowerParameters& parameters, const std::array<std::size_t, 2>& tapped)
      : measured_(measured), now_(now), tool_(tool), engagement_(engagement), radius_(radius) {
    const std::size_t modes = now[0].modes.size() + now[1].modes.size();
    gains_ = modes > tapped[0] + tapped[1];
    modal_ = static_cast<Eigen::Index>((gains_ ? 3 : 2) * modes);
    prior_.resize(modal_ + tool.teeth - 1);
    Eigen::Index at = 0;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      for (std::size_t k = 0; k < now[axis].modes.size(); ++k) {
        // The prior of a mode that is missing in the taps is wide.
        const double wider = k < tapped[axis] ? 1.0 : 5.0;
        prior_(at++) = 1.0 / (wider * parameters.frequency_std);
        prior_(at++) = 1.0 / (wider * parameters.damping_std);
      }
    }
    prior_.segment(at, modal_ - at).setConstant(1.0 / GAIN_STD);
    prior_.tail(tool.teeth - 1).setConstant(1.0 / RADIUS_STD);
  }

  Eigen::Index modal() const { return modal_; }  ///< number of unknowns of the modes
  Eigen::Index freedom() const { return prior_.size(); }
  Eigen::Index count() const override { return measured_.rows() + freedom(); }

  Sensor sensor(const Eigen::VectorXd& at) const { return shiftedSensor(now_, at, gains_); }
  Basis force(const Eigen::VectorXd& at) const { return harmonicsOf(tool_, engagement_, radii(at)); }
  std::vector<double> radii(const Eigen::VectorXd& at) const {
    std::vector<double> radius = radius_;
    for (Eigen::Index i = modal_; i < at.size(); ++i)
      radius[static_cast<std::size_t>(i - modal_ + 1)] += RADIUS_UNIT * at(i);
    return radius;
  }

  bool evaluate(const Eigen::VectorXd& at, Eigen::VectorXd* residual,
                Eigen::MatrixXd* jacobian) const override {
    const Basis here = force(at);
    const Eigen::VectorXd innovations = measured_.innovations(sensor(at), here);
    *residual << innovations, prior_.cwiseProduct(at);
    if (!jacobian) return true;
    // Differences: the force depends on the radii only, and its sampling requires wide steps.
    for (Eigen::Index i = 0; i < freedom(); ++i) {
      const bool of_mode = i < modal_;
      const double step = of_mode ? 1e-5 : 0.05;
      Eigen::VectorXd other = at;
      other(i) += step;
      jacobian->col(i).head(measured_.rows()) =
          (measured_.innovations(sensor(other), of_mode ? here : force(other)) - innovations) / step;
      (*jacobian)(measured_.rows() + i, i) = prior_(i);
    }
    return true;
  }

 private:
  const WeightedHarmonics& measured_;
  const Sensor& now_;
  const ToolGeometry& tool_;
  const Engagement& engagement_;
  std::vector<double> radius_;  // [m] to begin with
  bool gains_ = false;          // are unknown too
  Eigen::Index modal_ = 0;
  Eigen::VectorXd prior_;
};

/// Fit of modes and radii to a cut.
class CutFit {
 public:
  explicit CutFit(const CutResiduals& residuals) : residuals_(residuals) {
    p_ = Eigen::VectorXd::Zero(residuals.freedom());
    force_ = residuals_.force(p_);
  }

  void fitRadii() { descend(residuals_.modal()); }
  void fitAll() { descend(0); }

  double cost() const { return cost_; }        ///< including the prior
  double squares() const { return squares_; }  ///< of the innovations
  Sensor sensor() const { return residuals_.sensor(p_); }
  const Basis& force() const { return force_; }
  std::vector<double> radii() const { return residuals_.radii(p_); }

 private:
  /// The unknowns before `first` stay as they are.
  void descend(Eigen::Index first) {
    std::vector<fit::Parameter> parameters(static_cast<std::size_t>(p_.size()));
    for (Eigen::Index i = 0; i < p_.size(); ++i) {
      fit::Parameter& parameter = parameters[static_cast<std::size_t>(i)];
      parameter.start = p_(i);
      if (i < first) parameter.low = parameter.high = p_(i);
    }
    fit::Options options;
    options.name = "mode follower";
    options.iterations = MAX_ITERATIONS;
    options.function_tolerance = 1e-4;
    options.trust_radius = 1e3;
    const fit::Result found = fit::minimise(residuals_, parameters, options);
    p_ = found.value;
    force_ = residuals_.force(p_);
    cost_ = found.squares;
    squares_ = found.residual.head(found.residual.size() - p_.size()).squaredNorm();
  }

  const CutResiduals& residuals_;
  Eigen::VectorXd p_;
  Basis force_;
  double cost_ = 0.0, squares_ = 0.0;
};

/// Mean square of the residuals of a fit, at least 1: errors of the force model raise the required evidence.
double scaleOf(const WeightedHarmonics& harmonics, const CutResiduals& residuals, double squares) {
  const Eigen::Index left = harmonics.rows() - static_cast<Eigen::Index>(TERMS) - residuals.freedom();
  return std::max(1.0, squares / static_cast<double>(std::max<Eigen::Index>(left, 1)));
}

/// Sensor with one more mode per axis, at the frequency that reduces the innovations most.
/// @return nothing when there are too few harmonics, or the sensor has such a mode already
std::optional<Sensor> withHidden(const WeightedHarmonics& measured, const Sensor& sensor, const Basis& force,
                                 const std::array<std::size_t, 2>& tapped) {
  const std::size_t modes = tapped[0] + tapped[1];
  const auto unknowns = static_cast<Eigen::Index>(TERMS + 3 * (modes + 2));
  if (sensor[0].modes.size() + sensor[1].modes.size() > modes || measured.rows() < unknowns + MIN_REDUNDANCY)
    return std::nullopt;
  const Eigen::MatrixXd even = measured.outputOf(sensor, force);
  const Eigen::VectorXd left = measured.innovations(sensor, force);
  Sensor best = sensor;
  double most = 0.0;
  for (double f = HIDDEN_LOW; f < measured.highest(); f *= HIDDEN_STEP) {
    Eigen::MatrixXd columns(measured.rows(), even.cols() + 2);
    columns.leftCols(even.cols()) = even;
    for (std::size_t axis = 0; axis < 2; ++axis)
      columns.col(even.cols() + static_cast<Eigen::Index>(axis)) = measured.hidden(axis, f, sensor, force);
    const Eigen::VectorXd x = leastSquares(columns, left, 1e-9);
    const double fall = left.squaredNorm() - (left - columns * x).squaredNorm();
    if (fall <= most) continue;
    most = fall;
    best = sensor;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const double gain = std::clamp(x(even.cols() + static_cast<Eigen::Index>(axis)), -0.2, 0.2);
      best[axis].modes.push_back({f, HIDDEN_DAMPING, gain});
      best[axis].direct -= gain;
    }
  }
  return best;
}

}  // namespace

void ModeFollowerParameters::validate() const {
  checkBounds(*this);
}

ModeFollower::ModeFollower(const ToolGeometry& tool, const Engagement& engagement, int harmonics,
                           const ModeFollowerParameters& parameters)
    : tool_(tool), engagement_(engagement), harmonics_(harmonics), parameters_(parameters) {
  parameters.validate();
  validate(tool);
  validate(engagement);
  if (harmonics < 1 || harmonics > static_cast<int>(POINTS / 4)) throw Error("mode follower: no harmonics");
  radius_.assign(static_cast<std::size_t>(tool.teeth), 0.0);
}

std::optional<ModeFollower::Update> ModeFollower::update(const Harmonics& measured, double noise_std,
                                                         const std::array<ModalModel, 2>& now,
                                                         double spindle_speed) {
  const auto count = static_cast<std::size_t>(harmonics_) + 1;
  if (measured[0].size() < count || measured[1].size() < count)
    throw Error("mode follower: too few harmonics");
  if (!first_) first_ = now;
  const WeightedHarmonics harmonics(measured, count, noise_std, parameters_.misfit, now, spindle_speed);
  if (std::all_of(radius_.begin(), radius_.end(), [](double r) { return r == 0.0; }))
    radius_ = firstRadii(harmonics, now, tool_, engagement_);

  const std::array<std::size_t, 2> tapped{{(*first_)[0].modes.size(), (*first_)[1].modes.size()}};
  const auto residualsOf = [&](const Sensor& sensor) {
    return CutResiduals(harmonics, sensor, tool_, engagement_, radius_, parameters_, tapped);
  };
  // First the runout of the tool with the sensor in use: the cut without a shift of the modes.
  const CutResiduals residuals = residualsOf(now);
  CutFit cut(residuals);
  cut.fitRadii();
  const double unmoved = cut.cost();
  const std::vector<double> radius = cut.radii();
  Update update;
  update.before = cut.squares();
  const double first = harmonics.innovations(*first_, cut.force()).squaredNorm();
  const std::optional<Sensor> suspected = withHidden(harmonics, now, cut.force(), tapped);
  cut.fitAll();
  update.after = cut.squares();
  update.sensor = cut.sensor();
  const double scale = scaleOf(harmonics, residuals, update.after);
  // A mode that is missing in the taps is accepted only when it explains the cut completely.
  if (suspected && scale > UNEXPLAINED) {
    const CutResiduals more = residualsOf(*suspected);
    CutFit hidden(more);
    hidden.fitAll();
    const double fall = std::min(cut.cost(), unmoved) - hidden.cost();
    const bool fully_explained =
        scaleOf(harmonics, more, hidden.squares()) <= 1.0 && hidden.cost() < MAX_COST_RATIO * cut.cost();
    if (fully_explained && fall > HIDDEN_EVIDENCE * parameters_.evidence) {
      radius_ = hidden.radii();
      update.after = hidden.squares();
      update.sensor = hidden.sensor();
      return update;
    }
  }
  if ((unmoved - cut.cost()) / scale > parameters_.evidence) {
    radius_ = cut.radii();
    return update;
  }
  radius_ = radius;
  // Back to the tapped sensor when it explains the cut as well.
  if (first < update.before) {
    update.sensor = *first_;
    update.after = first;
    return update;
  }
  return std::nullopt;
}

}  // namespace smartmill::kalman
