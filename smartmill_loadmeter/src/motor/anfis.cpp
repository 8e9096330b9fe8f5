#include "smartmill_loadmeter/motor/anfis.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::loadmeter {

namespace {

void check(const std::vector<std::vector<double>>& inputs, const std::vector<double>& outputs,
           const Anfis::Parameters& parameters) {
  if (parameters.memberships < 2 || parameters.memberships > 5 || parameters.epochs < 1 ||
      !(parameters.step > 0.0) || !(parameters.ridge >= 0.0)) {
    throw Error("anfis: expected memberships 2..5, epochs >= 1, step > 0 and ridge >= 0");
  }
  const std::size_t width = inputs.empty() ? 0 : inputs.front().size();
  if (inputs.size() != outputs.size() || inputs.size() < width + 2) {
    throw Error("anfis: " + std::to_string(inputs.size()) + " samples are too few");
  }
  for (const auto& input : inputs) {
    if (input.size() != width) throw Error("anfis: samples of different length");
  }
}

}  // namespace

Anfis::Anfis(const std::vector<std::vector<double>>& inputs, const std::vector<double>& outputs,
             const Parameters& parameters)
    : inputs_(inputs.empty() ? 0 : inputs.front().size()),
      memberships_(static_cast<std::size_t>(parameters.memberships)) {
  check(inputs, outputs, parameters);
  spread(inputs);
  const auto [least, most] = std::minmax_element(outputs.begin(), outputs.end());
  out_middle_ = 0.5 * (*least + *most);
  out_span_ = *most > *least ? *most - *least : 1.0;
  std::vector<std::vector<double>> x;
  std::vector<double> y;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    x.push_back(scaled(inputs[i]));
    y.push_back((outputs[i] - out_middle_) / out_span_);
  }
  learn(x, y, parameters);
  computeUncertainty(x, y, parameters.ridge);
}

void Anfis::spread(const std::vector<std::vector<double>>& inputs) {
  for (std::size_t i = 0; i < inputs_; ++i) {
    double low = inputs[0][i], high = inputs[0][i];
    for (const auto& input : inputs) {
      low = std::min(low, input[i]);
      high = std::max(high, input[i]);
    }
    low_.push_back(low);
    high_.push_back(high);
    span_.push_back(high > low ? high - low : 1.0);
    for (std::size_t m = 0; m < memberships_; ++m) {
      const double gap = 1.0 / static_cast<double>(memberships_ - 1);
      bells_.push_back({0.5 * gap, 2.0, gap * static_cast<double>(m)});
    }
  }
}

void Anfis::learn(const std::vector<std::vector<double>>& x, const std::vector<double>& y,
                  const Parameters& parameters) {
  double step = parameters.step;
  solveLines(x, y, parameters.ridge);
  double before = squares(x, y);
  int falls = 0;
  for (int epoch = 0; epoch < parameters.epochs; ++epoch) {
    const std::vector<double> slopes = gradient(x, y);
    double norm = 0.0;
    for (const double g : slopes) norm += g * g;
    if (!(norm > 0.0)) break;
    norm = std::sqrt(norm);
    const std::vector<Bell> kept = bells_;
    const std::vector<double> kept_lines = lines_;
    for (std::size_t k = 0; k < bells_.size(); ++k) {
      bells_[k].a = std::clamp(bells_[k].a - step * slopes[3 * k] / norm, 0.1, 2.0);
      bells_[k].b = std::clamp(bells_[k].b - step * slopes[3 * k + 1] / norm, 0.5, 5.0);
      bells_[k].c = std::clamp(bells_[k].c - step * slopes[3 * k + 2] / norm, -0.5, 1.5);
    }
    solveLines(x, y, parameters.ridge);
    const double now = squares(x, y);
    if (now < before) {
      before = now;
      if (++falls == 4) step *= 1.1, falls = 0;  // Jang's rule
    } else {
      bells_ = kept;
      lines_ = kept_lines;
      step *= 0.5;
      falls = 0;
      if (step < 1e-5) break;
    }
  }
  rms_ = out_span_ * std::sqrt(before / static_cast<double>(x.size()));
}

std::vector<double> Anfis::gradient(const std::vector<std::vector<double>>& x,
                                    const std::vector<double>& y) const {
  std::vector<double> sum(3 * bells_.size(), 0.0);
  for (std::size_t s = 0; s < x.size(); ++s) {
    const Answer answer = answerTo(x[s]);
    const double error = answer.out - y[s];
    for (std::size_t r = 0; r < answer.line.size(); ++r) {
      // d out / d ln(mu) of a membership of this rule is normalised (line - out).
      const double share = 2.0 * error * answer.normalised[r] * (answer.line[r] - answer.out);
      std::size_t rest = r;
      for (std::size_t i = 0; i < inputs_; ++i) {
        const std::size_t at = i * memberships_ + rest % memberships_;
        rest /= memberships_;
        const Bell& bell = bells_[at];
        const double d = x[s][i] - bell.c, ratio = std::abs(d / bell.a);
        if (ratio < 1e-9) continue;
        const double power = std::pow(ratio, 2.0 * bell.b), mu = 1.0 / (1.0 + power);
        const double slope = mu * power;  // - d ln(mu) / d ln(power)
        sum[3 * at] += share * slope * 2.0 * bell.b / bell.a;
        sum[3 * at + 1] -= share * slope * 2.0 * std::log(ratio);
        sum[3 * at + 2] += share * slope * 2.0 * bell.b / d;
      }
    }
  }
  return sum;
}

Anfis::Answer Anfis::answerTo(const std::vector<double>& x) const {
  Answer answer;
  fire(x, &answer.normalised);
  const std::size_t width = inputs_ + 1;
  answer.line.resize(answer.normalised.size());
  for (std::size_t r = 0; r < answer.line.size(); ++r) {
    answer.line[r] = lines_[r * width + inputs_];
    for (std::size_t i = 0; i < inputs_; ++i) answer.line[r] += lines_[r * width + i] * x[i];
    answer.out += answer.normalised[r] * answer.line[r];
  }
  return answer;
}

std::size_t Anfis::rules() const {
  std::size_t count = 1;
  for (std::size_t i = 0; i < inputs_; ++i) count *= memberships_;
  return count;
}

std::vector<double> Anfis::scaled(const std::vector<double>& input) const {
  std::vector<double> x(inputs_);
  for (std::size_t i = 0; i < inputs_; ++i) x[i] = (input[i] - low_[i]) / span_[i];
  return x;
}

void Anfis::fire(const std::vector<double>& x, std::vector<double>* normalised) const {
  std::vector<double> mu(bells_.size());
  for (std::size_t k = 0; k < bells_.size(); ++k) {
    const Bell& bell = bells_[k];
    mu[k] = 1.0 / (1.0 + std::pow(std::abs((x[k / memberships_] - bell.c) / bell.a), 2.0 * bell.b));
  }
  normalised->assign(rules(), 1.0);
  double sum = 0.0;
  for (std::size_t r = 0; r < normalised->size(); ++r) {
    std::size_t rest = r;
    for (std::size_t i = 0; i < inputs_; ++i) {
      (*normalised)[r] *= mu[i * memberships_ + rest % memberships_];
      rest /= memberships_;
    }
    sum += (*normalised)[r];
  }
  for (double& w : *normalised) w /= sum;
}

void Anfis::solveLines(const std::vector<std::vector<double>>& x, const std::vector<double>& y,
                       double ridge) {
  const Eigen::Index n = static_cast<Eigen::Index>(lines());
  Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
  for (std::size_t s = 0; s < x.size(); ++s) right += rowOf(x[s]) * y[s];
  const Eigen::VectorXd found = linear::solveSymmetric(normalOf(x, ridge), right);
  lines_.assign(found.data(), found.data() + n);
}

Eigen::VectorXd Anfis::rowOf(const std::vector<double>& x) const {
  const std::size_t width = inputs_ + 1;
  std::vector<double> normalised;
  fire(x, &normalised);
  Eigen::VectorXd row(static_cast<Eigen::Index>(lines()));
  for (std::size_t r = 0; r < normalised.size(); ++r) {
    for (std::size_t i = 0; i <= inputs_; ++i)
      row[static_cast<Eigen::Index>(r * width + i)] = normalised[r] * (i < inputs_ ? x[i] : 1.0);
  }
  return row;
}

Eigen::MatrixXd Anfis::normalOf(const std::vector<std::vector<double>>& x, double ridge) const {
  const Eigen::Index n = static_cast<Eigen::Index>(lines());
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
  for (const std::vector<double>& input : x) {
    const Eigen::VectorXd row = rowOf(input);
    normal += row * row.transpose();
  }
  normal.diagonal().array() += ridge * static_cast<double>(x.size()) / static_cast<double>(rules()) + 1e-12;
  return normal;
}

void Anfis::computeUncertainty(const std::vector<std::vector<double>>& x, const std::vector<double>& y,
                               double ridge) {
  inverse_ = linear::inverseSymmetric(normalOf(x, ridge));
  double used = 0.0;  // degrees of freedom of the lines: trace of the hat matrix
  for (const std::vector<double>& input : x) {
    const Eigen::VectorXd row = rowOf(input);
    used += row.dot(inverse_ * row);
  }
  const double left = std::max(1.0, static_cast<double>(x.size()) - used);
  scatter_ = std::sqrt(squares(x, y) / left);
}

double Anfis::stdAt(const std::vector<double>& input) const {
  requireWidth(input);
  const Eigen::VectorXd row = rowOf(scaled(input));
  return out_span_ * scatter_ * std::sqrt(1.0 + row.dot(inverse_ * row));
}

void Anfis::requireWidth(const std::vector<double>& input) const {
  if (input.size() != inputs_) throw Error("anfis: expected " + std::to_string(inputs_) + " inputs");
}

double Anfis::squares(const std::vector<std::vector<double>>& x, const std::vector<double>& y) const {
  double sum = 0.0;
  for (std::size_t s = 0; s < x.size(); ++s) {
    const double error = answerTo(x[s]).out - y[s];
    sum += error * error;
  }
  return sum;
}

double Anfis::operator()(const std::vector<double>& input) const {
  requireWidth(input);
  return out_middle_ + out_span_ * answerTo(scaled(input)).out;
}

}  // namespace smartmill::loadmeter
