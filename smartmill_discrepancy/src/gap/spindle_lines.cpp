#include "gap/spindle_lines.h"

namespace smartmill::discrepancy {
namespace {

std::vector<double> halved(std::vector<double> angle) {
  for (double& a : angle) a *= 0.5;
  return angle;
}

// @param along sums with the values @param spacing of the orders
std::vector<Line> solved(std::vector<LineSums> sums, const std::vector<double>& along, std::size_t spacing) {
  std::vector<Line> lines;
  for (std::size_t k = 0; k < sums.size(); ++k) {
    const std::size_t order = 1 + spacing * k;
    sums[k].c = along[2 * order - 1];
    sums[k].s = along[2 * order];
    lines.push_back(sums[k].solve());
  }
  return lines;
}

}  // namespace

void LineSums::add(double sine, double cosine, double value) {
  ss += sine * sine;
  cc += cosine * cosine;
  sc += sine * cosine;
  s += sine * value;
  c += cosine * value;
}

Line LineSums::solve() const {
  const double det = ss * cc - sc * sc;
  Line line;
  if (det <= 1e-9 * ss * cc) return line;
  line.sine = (cc * s - sc * c) / det;
  line.cosine = (ss * c - sc * s) / det;
  line.squares = line.sine * s + line.cosine * c;
  return line;
}

SpindleLines::SpindleLines(const std::vector<double>& angle, std::size_t orders, std::size_t half_orders)
    : whole_(angle), half_(halved(angle)) {
  const std::vector<double> twice = whole_.along(std::vector<double>(angle.size(), 1.0), 2 * orders);
  const auto of = [&](std::size_t doubled) {  // twice the order
    LineSums sums;
    sums.ss = 0.5 * (twice[0] - twice[2 * doubled - 1]);
    sums.cc = 0.5 * (twice[0] + twice[2 * doubled - 1]);
    sums.sc = 0.5 * twice[2 * doubled];
    return sums;
  };
  for (std::size_t k = 1; k <= orders; ++k) wholes_.push_back(of(2 * k));
  for (std::size_t k = 0; k < half_orders; ++k) halves_.push_back(of(2 * k + 1));
}

std::vector<Line> SpindleLines::wholes(const std::vector<double>& values) const {
  return solved(wholes_, whole_.along(values, wholes_.size()), 1);
}

std::vector<Line> SpindleLines::halves(const std::vector<double>& values) const {
  return solved(halves_, half_.along(values, 2 * halves_.size() - 1), 2);
}

}  // namespace smartmill::discrepancy
