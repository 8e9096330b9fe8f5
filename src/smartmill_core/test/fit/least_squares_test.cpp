#include "smartmill_core/fit/least_squares.h"

#include <cmath>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/derivative_check.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace smartmill::fit {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Rosenbrock's valley: minimum at (1, 1), where both residuals vanish.
class Valley : public Residuals {
 public:
  explicit Valley(double wrong = 0.0) : wrong_(wrong) {}
  Eigen::Index count() const override { return 2; }
  bool evaluate(const VectorXd& at, VectorXd* residual, MatrixXd* jacobian) const override {
    *residual << 10.0 * (at[1] - at[0] * at[0]), 1.0 - at[0];
    if (jacobian) *jacobian << -20.0 * at[0] + wrong_, 10.0, -1.0, 0.0;
    return true;
  }

 private:
  double wrong_;
};

std::vector<Parameter> from(std::initializer_list<double> start) {
  std::vector<Parameter> parameters;
  for (const double s : start) parameters.emplace_back().start = s;
  return parameters;
}

TEST(LeastSquares, FindsTheEndOfAValleyWithAndWithoutDerivatives) {
  const Valley valley;
  for (const bool orthogonal : {false, true}) {
    Options options;
    options.orthogonal = orthogonal;
    const Result found = minimise(valley, from({-1.2, 1.0}), options);
    EXPECT_EQ(found.ending, Ending::converged) << found.message;
    EXPECT_LT((found.value - VectorXd::Ones(2)).norm(), 1e-8);
    EXPECT_LT(found.squares, 1e-16);
    EXPECT_GT(found.iterations, 3);
  }
  const FunctionResiduals plain(2,
                                [&](const VectorXd& at, VectorXd& r) { valley.evaluate(at, &r, nullptr); });
  EXPECT_LT((minimise(plain, from({-1.2, 1.0})).value - VectorXd::Ones(2)).norm(), 1e-6);
}

TEST(LeastSquares, ChecksDerivatives) {
  VectorXd at(2);
  at << -1.2, 1.0;
  EXPECT_LT(checkDerivatives(Valley(), at).relative, 1e-10);
  const DerivativeGap gap = checkDerivatives(Valley(0.01), at);
  EXPECT_NEAR(gap.relative, 0.01 / 24.0, 1e-6);
  EXPECT_EQ(gap.row, 0);
  EXPECT_EQ(gap.column, 0);
}

// A line y = a + b t: (X'X)^-1 by hand for t = 0, 1, 2, 3 is [14 -6; -6 4] / 20, also with units of 1e9 and
// 1e-9.
TEST(LeastSquares, StatesTheCovarianceOfALine) {
  for (const double unit : {1.0, 1e9, 1e-9}) {
    const FunctionResiduals line(4, [&](const VectorXd& at, VectorXd& r) {
      for (Eigen::Index t = 0; t < 4; ++t) r[t] = at[0] + at[1] / unit * static_cast<double>(t) - 2.0;
    });
    std::vector<Parameter> parameters = from({0.0, 0.0});
    parameters[1].scale = unit;
    const Result found = minimise(line, parameters);
    EXPECT_NEAR(found.value[0], 2.0, 1e-9);
    const Covariance covariance = found.covariance();
    EXPECT_TRUE(covariance.complete());
    EXPECT_NEAR(covariance.matrix(0, 0), 0.7, 1e-6);
    EXPECT_NEAR(covariance.matrix(0, 1) / unit, -0.3, 1e-6);
    EXPECT_NEAR(covariance.matrix(1, 1) / unit / unit, 0.2, 1e-6);
    EXPECT_NEAR(covariance.deviation(1) / unit, std::sqrt(0.2), 1e-6);
  }
}

// Only a + b and c are determined: a and b have no standard deviation, c has one.
TEST(LeastSquares, ReportsUndeterminedUnknowns) {
  const FunctionResiduals sum(3, [](const VectorXd& at, VectorXd& r) {
    r << at[0] + at[1] - 1.0, 2.0 * at[2] - 1.0, 2.0 * (at[0] + at[1]) - 2.2;
  });
  const Covariance covariance = minimise(sum, from({0.0, 0.0, 0.0})).covariance();
  EXPECT_EQ(covariance.rank, 2);
  EXPECT_FALSE(covariance.complete());
  EXPECT_EQ(covariance.undetermined, (std::vector<bool>{true, true, false}));
  EXPECT_TRUE(std::isinf(covariance.deviation(0)));
  EXPECT_EQ(covariance.matrix(0, 1), 0.0);
  EXPECT_NEAR(covariance.matrix(2, 2), 0.25, 1e-9);
  // A quantity that does not depend on a or b keeps its standard deviation.
  MatrixXd map(2, 3);
  map << 0.0, 0.0, 3.0, 1.0, 0.0, 1.0;
  const MatrixXd of_map = propagated(map, covariance.matrix);
  EXPECT_NEAR(of_map(0, 0), 2.25, 1e-8);
  EXPECT_TRUE(std::isinf(of_map(1, 1)));
  // A column of zeros, fewer residuals than unknowns, an empty matrix.
  EXPECT_EQ(covarianceOf(MatrixXd::Zero(3, 2)).rank, 0);
  EXPECT_EQ(covarianceOf(MatrixXd::Ones(1, 2)).undetermined, (std::vector<bool>{true, true}));
  EXPECT_TRUE(covarianceOf(MatrixXd(3, 0)).complete());
}

TEST(LeastSquares, RespectsBoundsAndFixedUnknowns) {
  const FunctionResiduals pull(2, [](const VectorXd& at, VectorXd& r) { r << at[0] - 2.0, at[1] - at[2]; });
  std::vector<Parameter> parameters = from({9.0, 0.0, 5.0});
  parameters[0].low = -1.0;
  parameters[0].high = 1.0;
  parameters[2].low = parameters[2].high = 5.0;
  const Result found = minimise(pull, parameters);
  EXPECT_EQ(found.value[0], 1.0);
  EXPECT_NEAR(found.value[1], 5.0, 3e-6);  // the fit ends at a relative change of 1e-11 of squares near 1
  EXPECT_EQ(found.value[2], 5.0);
  const Covariance covariance = found.covariance();
  EXPECT_EQ(covariance.deviation(0), 0.0);
  EXPECT_NEAR(covariance.deviation(1), 1.0, 1e-6);
  EXPECT_EQ(covariance.deviation(2), 0.0);
  for (Parameter& p : parameters) p.high = p.low = p.start;
  EXPECT_EQ(minimise(pull, parameters).ending, Ending::converged);
}

TEST(LeastSquares, RejectsAStartThatIsNotFinite) {
  const FunctionResiduals bad(2, [](const VectorXd& at, VectorXd& r) { r << at[0], std::sqrt(at[0]); });
  Options options;
  options.name = "pull";
  EXPECT_EQ(errorOf([&] { minimise(bad, from({-1.0}), options); }),
            "pull: residual 1 of 2 is not a finite number at the start");
}

// Steps to negative arguments of the root are rejected, without output on the terminal.
TEST(LeastSquares, RejectsStepsToResidualsThatAreNotFiniteSilently) {
  const FunctionResiduals root(1, [](const VectorXd& at, VectorXd& r) { r << std::sqrt(at[0]) - 0.01; });
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  const Result found = minimise(root, from({4.0}));
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
  ASSERT_TRUE(found.usable()) << found.message;
  EXPECT_NEAR(found.value[0], 1e-4, 1e-8);
}

TEST(LeastSquares, EndsOnRequest) {
  Options options;
  int called = 0;
  double last = 1e300;
  options.progress = [&](const Progress& now) {
    EXPECT_LE(now.squares, last);
    last = now.squares;
    return ++called < 4;
  };
  const Result found = minimise(Valley(), from({-1.2, 1.0}), options);
  EXPECT_EQ(found.ending, Ending::cancelled);
  EXPECT_TRUE(found.usable());
  EXPECT_EQ(called, 4);
  EXPECT_EQ(found.squares, last);
  Options few;
  few.iterations = 3;
  EXPECT_EQ(minimise(Valley(), from({-1.2, 1.0}), few).ending, Ending::iterations_used);
}

TEST(LeastSquares, PassesOnExceptionsOfTheResiduals) {
  int calls = 0;
  const FunctionResiduals fails(1, [&](const VectorXd& at, VectorXd& r) {
    if (++calls > 5) throw std::runtime_error("the twin has failed");
    r << at[0] * at[0] + 1.0;
  });
  EXPECT_THROW(minimise(fails, from({3.0})), std::runtime_error);
}

// Stated deviations against the scatter of 400 fits of a decay through noise: z-scores have variance 1 within
// four standard deviations sqrt(2 / 400) on either side.
TEST(LeastSquares, StatesCalibratedDeviations) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  constexpr int RUNS = 400;
  VectorXd squares = VectorXd::Zero(2);
  for (int run = 0; run < RUNS; ++run) {
    VectorXd noise(30);
    for (double& n : noise) n = normal(random);
    const FunctionResiduals decay(30, [&](const VectorXd& at, VectorXd& r) {
      for (Eigen::Index i = 0; i < 30; ++i) {
        const double t = 0.1 * static_cast<double>(i);
        r[i] = at[0] * std::exp(-at[1] * t) - 50.0 * std::exp(-0.7 * t) - noise[i];
      }
    });
    const Result found = minimise(decay, from({30.0, 1.0}));
    const Covariance covariance = found.covariance();
    squares[0] += std::pow((found.value[0] - 50.0) / covariance.deviation(0), 2) / RUNS;
    squares[1] += std::pow((found.value[1] - 0.7) / covariance.deviation(1), 2) / RUNS;
  }
  for (const double s : squares) EXPECT_NEAR(s, 1.0, 4.0 * std::sqrt(2.0 / RUNS));
}

}  // namespace
}  // namespace smartmill::fit
