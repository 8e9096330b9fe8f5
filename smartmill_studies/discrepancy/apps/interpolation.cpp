// rosrun smartmill_studies discrepancy_interpolation CAMPAIGN: share of the held-out cuts of a campaign that
// a model can explain whose forces are linear in the feed. Each spindle order is interpolated separately in
// amplitude and phase. These models include every rigid geometry, every linear sensor with or without
// crosstalk, and all coefficients.

#include <array>
#include <cmath>
#include <complex>
#include <cstdio>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "smartmill_core/error.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/data/dataset.h"

namespace {

using namespace smartmill;
using namespace smartmill::discrepancy;
using Complex = std::complex<double>;

constexpr double HIGHEST = 0.49;  // of the sample rate
constexpr int PASSES = 100;       // alternating between phases and lines

// One cut: complex amplitudes at orders 1.. of each force, with a free phase of the record.
struct Cut {
  const TestData* test = nullptr;
  double feed = 0.0, phase = 0.0;                    // [m], [rad]
  std::array<std::vector<Complex>, 3> line;          // [N] of order k + 1
  std::array<double, 3> variance{}, asynchronous{};  // [N^2] of the samples, of the asynchronous part

  Complex at(std::size_t axis, std::size_t k) const {
    return line[axis][k] * std::polar(1.0, -phase * static_cast<double>(k + 1));
  }
};

Cut linesOf(const TestData& test) {
  Cut cut;
  cut.test = &test;
  cut.feed = test.test.engagement->feed_per_tooth;
  const auto n = static_cast<Eigen::Index>(test.record.size() - test.first_cut);
  const auto orders =
      static_cast<Eigen::Index>(HIGHEST * test.test.sample_rate * units::TWO_PI / test.test.spindle_speed);
  const std::vector<double>& angle = test.record.column("spindle_angle");
  Eigen::MatrixXd columns(n, 2 * orders + 1);
  for (Eigen::Index i = 0; i < n; ++i) {
    columns(i, 0) = 1.0;
    for (Eigen::Index k = 1; k <= orders; ++k) {
      const double a = static_cast<double>(k) * angle[test.first_cut + static_cast<std::size_t>(i)];
      columns(i, 2 * k - 1) = std::cos(a);
      columns(i, 2 * k) = std::sin(a);
    }
  }
  const Eigen::LDLT<Eigen::MatrixXd> normal(columns.transpose() * columns);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::vector<double>& f = test.record.column(FORCES[axis]);
    const Eigen::VectorXd values = Eigen::Map<const Eigen::VectorXd>(f.data() + test.first_cut, n);
    const Eigen::VectorXd found = normal.solve(columns.transpose() * values);
    cut.variance[axis] = (values.array() - values.mean()).square().mean();
    cut.asynchronous[axis] =
        (values - columns * found).squaredNorm() / static_cast<double>(n - 2 * orders - 1);
    for (Eigen::Index k = 1; k <= orders; ++k) cut.line[axis].emplace_back(found[2 * k - 1], -found[2 * k]);
  }
  return cut;
}

// Straight line over the feed: value = first + feed * second, by least squares over all cuts or the fitted
// ones.
std::array<Complex, 2> courseOf(const std::vector<Cut>& cuts, bool all, std::size_t axis, std::size_t k) {
  double n = 0.0, x = 0.0, xx = 0.0;
  Complex y, xy;
  for (const Cut& c : cuts) {
    if (c.test->heldout && !all) continue;
    n += 1.0;
    x += c.feed;
    xx += c.feed * c.feed;
    y += c.at(axis, k);
    xy += c.feed * c.at(axis, k);
  }
  const Complex slope = (n * xy - x * y) / (n * xx - x * x);
  return {(y - slope * x) / n, slope};
}

// Estimates the phase of each record in turn with the lines; the recorded angle is accurate to about a
// degree.
void settlePhases(std::vector<Cut>& cuts) {
  for (int pass = 0; pass < PASSES; ++pass) {
    for (Cut& c : cuts) {
      double along = 0.0, squares = 0.0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        for (std::size_t k = 0; k < c.line[axis].size(); ++k) {
          const auto [first, slope] = courseOf(cuts, true, axis, k);
          const Complex turned = Complex(0.0, -static_cast<double>(k + 1)) * c.at(axis, k);
          along += std::real(std::conj(turned) * (c.at(axis, k) - first - c.feed * slope));
          squares += std::norm(turned);
        }
      }
      c.phase -= along / squares;
    }
  }
}

void report(const std::vector<Cut>& cuts) {
  for (const Cut& c : cuts) {
    std::printf("%-16s %s", c.test->test.name.c_str(), c.test->heldout ? "held out" : "fitted  ");
    for (std::size_t axis = 0; axis < 3; ++axis) {
      double left = c.asynchronous[axis];
      for (std::size_t k = 0; k < c.line[axis].size(); ++k) {
        const auto [first, slope] = courseOf(cuts, false, axis, k);
        left += 0.5 * std::norm(c.at(axis, k) - first - c.feed * slope);
      }
      std::printf("  %s %.2f %% (repeats %.2f %%)", FORCES[axis].c_str(),
                  100.0 * (1.0 - left / c.variance[axis]),
                  100.0 * (1.0 - c.asynchronous[axis] / c.variance[axis]));
    }
    std::printf("\n");
  }
}

void run(const std::string& folder) {
  const Campaign campaign = readCampaign(folder);
  const Dataset data = loadDataset(campaign, readMachineModel(campaign.modelPath()));
  std::vector<Cut> cuts;
  std::size_t fitted = 0;
  for (const TestData& t : data.tests) {
    if (t.test.kind != TestKind::cut) continue;
    cuts.push_back(linesOf(t));
    fitted += t.heldout ? 0 : 1;
  }
  if (fitted < 3) throw Error(folder + ": expected at least three fitted cuts");
  settlePhases(cuts);
  report(cuts);
}

}  // namespace

int main(int argc, char** argv) {
  std::string folder;
  CommandLine line{
      "Share of the held-out cuts of a campaign, which differ in feed only, that a model can explain whose "
      "spindle orders are linear in the feed."};
  line.option("CAMPAIGN", folder, "folder of the campaign").required();
  return runProgram(line, argc, argv, [&] { run(folder); });
}
