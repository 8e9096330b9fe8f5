#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace smartmill::loadmeter {

/// Adaptive neuro-fuzzy inference (Jang 1993): first-order Sugeno rules over a grid of bell-shaped membership
/// functions mu = 1 / (1 + |(x - c) / a|^(2 b)), learnt by the hybrid rule: least squares for the rules'
/// lines, gradient descent with adaptive step for the memberships. Inputs are scaled to 0..1 of the training
/// data.
class Anfis {
 public:
  struct Parameters {
    int memberships = 2;  ///< 2..5 per input
    int epochs = 40;      ///< >= 1
    double step = 0.02;   ///< > 0, initial step of the memberships, as share of the range
    double ridge = 1e-4;  ///< >= 0, keeps rules with little firing near zero
  };

  /// @param inputs one vector per sample. @throws Error with fewer samples than a rule has unknowns, unequal
  /// lengths, or a parameter out of range.
  Anfis(const std::vector<std::vector<double>>& inputs, const std::vector<double>& outputs,
        const Parameters& parameters);

  double operator()(const std::vector<double>& input) const;
  double trainingRms() const { return rms_; }
  /// Standard deviation of one new output: scatter about the trained outputs and uncertainty of the rules'
  /// lines, with the trained memberships (linearised).
  double stdAt(const std::vector<double>& input) const;
  /// Range of an input of the training data, outside which no rule is supported.
  double low(std::size_t i) const { return low_[i]; }
  double high(std::size_t i) const { return high_[i]; }

 private:
  struct Bell {
    double a, b, c;
  };
  /// Output of the rules for one scaled input.
  struct Answer {
    std::vector<double> normalised;  // firing of each rule, sum 1
    std::vector<double> line;        // value of each rule's line
    double out = 0.0;
  };
  std::size_t rules() const;
  /// Bells at even distances over the range of each input.
  void spread(const std::vector<std::vector<double>>& inputs);
  void learn(const std::vector<std::vector<double>>& x, const std::vector<double>& y,
             const Parameters& parameters);
  /// Backward pass: gradient of the squared error over a, b, c of every bell with fixed lines.
  std::vector<double> gradient(const std::vector<std::vector<double>>& x, const std::vector<double>& y) const;
  Answer answerTo(const std::vector<double>& x) const;
  std::vector<double> scaled(const std::vector<double>& input) const;
  void fire(const std::vector<double>& x, std::vector<double>* normalised) const;
  void solveLines(const std::vector<std::vector<double>>& x, const std::vector<double>& y, double ridge);
  double squares(const std::vector<std::vector<double>>& x, const std::vector<double>& y) const;
  std::size_t lines() const { return rules() * (inputs_ + 1); }
  void requireWidth(const std::vector<double>& input) const;
  /// Firing of the rules times inputs, the row of the linear problem.
  Eigen::VectorXd rowOf(const std::vector<double>& x) const;
  Eigen::MatrixXd normalOf(const std::vector<std::vector<double>>& x, double ridge) const;
  /// Covariance of the lines and scatter from the residual.
  void computeUncertainty(const std::vector<std::vector<double>>& x, const std::vector<double>& y,
                          double ridge);

  std::size_t inputs_;
  std::size_t memberships_;
  std::vector<double> low_, high_, span_;
  double out_middle_ = 0.0, out_span_ = 1.0;
  std::vector<Bell> bells_;  // input by input
  std::vector<double> lines_;
  double rms_ = 0.0;
  Eigen::MatrixXd inverse_;  // of the normal equations
  double scatter_ = 0.0;     // of a scaled output
};

}  // namespace smartmill::loadmeter
