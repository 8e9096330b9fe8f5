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
  double high = std::numeric_limits<double>::infinity();  ///< equal to low: held at start
  double scale = 1.0;  ///< > 0, typical size: the solver sees the unknown in units of it
};

/// What shall become small: residuals over unknowns.
class Residuals {
 public:
  virtual ~Residuals() = default;

  /// How many residuals there are.
  virtual Eigen::Index count() const = 0;

  /// @param residual has count() rows. @param jacobian nullptr, or count() x unknowns of zeros to fill with
  /// the derivatives (rows: residuals). @return false: nothing can be said of this point, a step to it is not
  /// taken
  virtual bool evaluate(const Eigen::VectorXd& at, Eigen::VectorXd* residual,
                        Eigen::MatrixXd* jacobian) const = 0;

  /// false: evaluate() is never asked for derivatives; central differences take their place.
  virtual bool hasJacobian() const { return true; }
};

/// Residuals without derivatives: the function fills the vector it is given.
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
  double squares = 0.0;  ///< sum of squared residuals now
};

struct Options {
  std::string name = "fit";  ///< begins the messages
  int iterations = 200;
  double function_tolerance = 1e-11;   ///< relative change of the squares that ends it
  double parameter_tolerance = 1e-12;  ///< relative
  double gradient_tolerance = 1e-10;   ///< in units of the scales
  double trust_radius = 1e4;           ///< of the first step: the larger, the less it is damped
  /// QR of the Jacobian in place of normal equations: slower, sees twice the digits.
  bool orthogonal = false;
  /// Derivatives cost much beside residuals: between bounds a step that does not hold what it promised is
  /// shortened from residuals alone.
  bool dear_derivatives = false;
  /// A second run without the unknowns that press against a bound, beside which Ceres ends early.
  bool finish_at_bounds = true;
  /// Called after every iteration. @return false to end with the best point so far
  std::function<bool(const Progress&)> progress;
};

enum class Ending { converged, iterations_used, cancelled, failed };

/// (J'J)^-1: the covariance when residuals are weighted to variance 1.
struct Covariance {
  Eigen::MatrixXd matrix;
  Eigen::Index rank = 0;  ///< of J
  /// Unknowns that the residuals do not tell, alone or apart from others: infinite on the diagonal, 0 beside
  /// it.
  std::vector<bool> undetermined;

  bool complete() const { return rank == matrix.cols(); }
  double deviation(Eigen::Index i) const;
};

/// Columns of any size; directions with less than `tolerance` of the largest singular value of the unit
/// columns count as not told. A column of zeros is not told either.
Covariance covarianceOf(const Eigen::MatrixXd& jacobian, double tolerance = 1e-10);

/// Covariance of map x where x has the covariance given; an infinite variance passes only where the map asks
/// for it.
Eigen::MatrixXd propagated(const Eigen::MatrixXd& map, const Eigen::MatrixXd& covariance);

struct Result {
  Eigen::VectorXd value;
  Eigen::VectorXd residual;  ///< at value
  Eigen::MatrixXd jacobian;  ///< at value; zero columns where an unknown is held or stands at a bound
  std::vector<bool> moves;   ///< per unknown: neither held nor at a bound
  double squares = 0.0;      ///< sum of squared residuals
  Ending ending = Ending::failed;
  int iterations = 0;
  std::string message;  ///< one line: how it ended

  /// The value is the best point found: not after Ending::failed.
  bool usable() const { return ending != Ending::failed; }

  /// Held unknowns and those at a bound count as known: variance 0, `undetermined` false; the others as
  /// covarianceOf().
  Covariance covariance() const;
};

/// Least squares within bounds by Ceres' Levenberg-Marquardt method, silent and in this thread. The start is
/// moved into the bounds. Points where a residual is not finite are refused like those where evaluate() says
/// false.
/// @throws Error in one line when the start is such a point; what evaluate() throws.
Result minimise(const Residuals& residuals, const std::vector<Parameter>& parameters,
                const Options& options = {});

}  // namespace smartmill::fit
