#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "cut_harmonics.h"
#include "smartmill_core/fit/least_squares.h"

namespace smartmill::kalman {

/// Innovations of the cut and prior of the unknowns: modes (log frequency, log damping of each, x then y) and
/// the teeth's radii [um], the first tooth's being the datum.
class CutResiduals : public fit::Residuals {
 public:
  CutResiduals(const WeightedHarmonics& measured, const Sensor& now, const ToolGeometry& tool,
               const Engagement& engagement, const std::vector<double>& radius,
               const ModeFollowerParameters& parameters, const std::array<std::size_t, 2>& tapped);

  Eigen::Index modal() const { return modal_; }  ///< number of unknowns of the modes
  Eigen::Index freedom() const { return prior_.size(); }
  Eigen::Index count() const override { return measured_.rows() + freedom(); }

  Sensor sensor(const Eigen::VectorXd& at) const;
  Basis force(const Eigen::VectorXd& at) const { return harmonicsOf(tool_, engagement_, radii(at)); }
  std::vector<double> radii(const Eigen::VectorXd& at) const;  ///< [m]

  bool evaluate(const Eigen::VectorXd& at, Eigen::VectorXd* residual,
                Eigen::MatrixXd* jacobian) const override;

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
  explicit CutFit(const CutResiduals& residuals);

  void fitRadii() { descend(residuals_.modal()); }
  void fitAll() { descend(0); }

  double cost() const { return cost_; }        ///< including the prior
  double squares() const { return squares_; }  ///< of the innovations
  Sensor sensor() const { return residuals_.sensor(p_); }
  const Basis& force() const { return force_; }
  std::vector<double> radii() const { return residuals_.radii(p_); }

 private:
  /// The unknowns before `first` stay as they are.
  void descend(Eigen::Index first);

  const CutResiduals& residuals_;
  Eigen::VectorXd p_;
  Basis force_;
  double cost_ = 0.0, squares_ = 0.0;
};

/// Mean square of the residuals of a fit, at least 1: errors of the force model raise the required evidence.
double scaleOf(const WeightedHarmonics& harmonics, const CutResiduals& residuals, double squares);

}  // namespace smartmill::kalman
