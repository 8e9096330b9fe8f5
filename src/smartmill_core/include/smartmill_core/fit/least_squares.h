#pragma once

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace smartmill::fit {

/// One unknown of a nonlinear fit.
struct Parameter {
  double start = 0.0;
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();  ///< equal to low: fixed at start
  double scale = 1.0;  ///< > 0, typical size; the solver works in units of it
};

/// Residuals to be minimised, as a function of the unknowns.
class Residuals {
 public:
  virtual ~Residuals() = default;

  /// Number of residuals.
  virtual Eigen::Index count() const = 0;

  /// @param residual has count() rows. @param jacobian nullptr, or count() x unknowns of zeros to fill with
  /// the derivatives (rows: residuals). @return false: the residuals are undefined here, and a step to this
  /// point is rejected
  virtual bool evaluate(const Eigen::VectorXd& at, Eigen::VectorXd* residual,
                        Eigen::MatrixXd* jacobian) const = 0;

  /// false: evaluate() is called without a Jacobian, and central differences are used.
  virtual bool hasJacobian() const { return true; }
};

/// Residuals without derivatives: the function fills the given vector.
class FunctionResiduals : public Residuals {
 public:
  using Function = std::function<void(const Eigen::VectorXd& at, Eigen::VectorXd& residual)>;
  FunctionResiduals(Eigen::Index count, Function function);

  Eigen::Index count() const override { return count_; }
  bool evaluate(const Eigen::VectorXd& at, Eigen::VectorXd* residual,
                Eigen::MatrixXd* jacobian) const override;
  bool hasJacobian() const override { return false; }

 private:
  Eigen::Index count_;
  Function function_;
};

struct Progress {
  int iteration = 0;
  double squares = 0.0;  ///< present sum of squared residuals
};

struct Options {
  std::string name = "fit";  ///< prefix of messages
  int iterations = 200;
  double function_tolerance = 1e-11;   ///< relative change of the sum of squares that ends the fit
  double parameter_tolerance = 1e-12;  ///< relative
  double gradient_tolerance = 1e-10;   ///< in units of the scales
  double trust_radius = 1e4;           ///< of the first step: a larger radius damps less
  /// QR of the Jacobian instead of normal equations: slower, with twice the digits.
  bool orthogonal = false;
  /// Derivatives cost much more than residuals: with bounds, a step that does not reach its predicted
  /// decrease is shortened by evaluating residuals only.
  bool costly_derivatives = false;
  /// A second run without the unknowns that are pushed against a bound, where Ceres ends early.
  bool finish_at_bounds = true;
  /// Called after every iteration. @return false to stop at the best point so far
  std::function<bool(const Progress&)> progress;
};

enum class Ending { converged, iterations_used, cancelled, failed };

/// (J'J)^-1: the covariance when residuals are weighted to variance 1.
struct Covariance {
  Eigen::MatrixXd matrix;
  Eigen::Index rank = 0;  ///< of J
  /// Unknowns that the residuals do not determine, alone or separately from others: infinite on the diagonal,
  /// 0 off it.
  std::vector<bool> undetermined;

  bool complete() const { return rank == matrix.cols(); }
  double deviation(Eigen::Index i) const;
};

/// Columns of any size; directions with less than `tolerance` of the largest singular value of the unit
/// columns count as undetermined, as does a column of zeros.
Covariance covarianceOf(const Eigen::MatrixXd& jacobian, double tolerance = 1e-10);

/// Covariance of map x, given the covariance of x; an infinite variance propagates only where its coefficient
/// is nonzero.
Eigen::MatrixXd propagated(const Eigen::MatrixXd& map, const Eigen::MatrixXd& covariance);

struct Result {
  Eigen::VectorXd value;
  Eigen::VectorXd residual;  ///< at value
  Eigen::MatrixXd jacobian;  ///< at value; zero columns where an unknown is fixed or at a bound
  std::vector<bool> moves;   ///< per unknown: neither fixed nor at a bound
  double squares = 0.0;      ///< sum of squared residuals
  Ending ending = Ending::failed;
  int iterations = 0;
  std::string message;  ///< one line: how it ended

  /// Whether value is the best point found; false after Ending::failed.
  bool usable() const { return ending != Ending::failed; }

  /// Fixed unknowns and those at a bound count as known: variance 0, `undetermined` false. The others as in
  /// covarianceOf().
  Covariance covariance() const;
};

/// Least squares within bounds by Ceres' Levenberg-Marquardt method, without output and in the calling
/// thread. The start is clamped to the bounds. Points with a residual that is not finite are rejected, like
/// those where evaluate() returns false.
/// @throws Error of one line when the start is such a point; passes on exceptions of evaluate().
Result minimise(const Residuals& residuals, const std::vector<Parameter>& parameters,
                const Options& options = {});

}  // namespace smartmill::fit
