#include "cut_fit.h"

#include <algorithm>
#include <cmath>

namespace smartmill::kalman {
namespace {

constexpr int MAX_ITERATIONS = 20;
constexpr double RADIUS_UNIT = 1e-6;  // [m] of a radius among the unknowns

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

}  // namespace

CutResiduals::CutResiduals(const WeightedHarmonics& measured, const Sensor& now, const ToolGeometry& tool,
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
      const double wider = k < tapped[axis] ? 1.0 : parameters.wider;
      prior_(at++) = 1.0 / (wider * parameters.frequency_std);
      prior_(at++) = 1.0 / (wider * parameters.damping_std);
    }
  }
  prior_.segment(at, modal_ - at).setConstant(1.0 / parameters.gain_std);
  prior_.tail(tool.teeth - 1).setConstant(1.0 / parameters.radius_std);
}

Sensor CutResiduals::sensor(const Eigen::VectorXd& at) const {
  return shiftedSensor(now_, at, gains_);
}

std::vector<double> CutResiduals::radii(const Eigen::VectorXd& at) const {
  std::vector<double> radius = radius_;
  for (Eigen::Index i = modal_; i < at.size(); ++i)
    radius[static_cast<std::size_t>(i - modal_ + 1)] += RADIUS_UNIT * at(i);
  return radius;
}

bool CutResiduals::evaluate(const Eigen::VectorXd& at, Eigen::VectorXd* residual,
                            Eigen::MatrixXd* jacobian) const {
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

CutFit::CutFit(const CutResiduals& residuals) : residuals_(residuals) {
  p_ = Eigen::VectorXd::Zero(residuals.freedom());
  force_ = residuals_.force(p_);
}

void CutFit::descend(Eigen::Index first) {
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

double scaleOf(const WeightedHarmonics& harmonics, const CutResiduals& residuals, double squares) {
  const Eigen::Index left = harmonics.rows() - static_cast<Eigen::Index>(TERMS) - residuals.freedom();
  return std::max(1.0, squares / static_cast<double>(std::max<Eigen::Index>(left, 1)));
}

}  // namespace smartmill::kalman
