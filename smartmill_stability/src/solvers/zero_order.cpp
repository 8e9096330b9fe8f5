#include "smartmill_stability/solvers/zero_order.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

using Complex = std::complex<double>;
using units::PI;
using units::TWO_PI;

// Eigenvalues of the oriented FRF A0 Phi without its factor teeth / (2 pi), ordered such that each branch is
// continuous over the lines.
std::array<std::vector<Complex>, 2> eigenvalues(const RegenerativeProcess& process,
                                                const ToolTipResponse& tool) {
  const std::array<double, 4> a = directionalCoefficients(process);
  std::array<std::vector<Complex>, 2> branches;
  for (std::size_t i = 0; i < tool.frequency.size(); ++i) {
    const Complex xy = tool.xy.empty() ? 0.0 : tool.xy[i], yx = tool.yx.empty() ? 0.0 : tool.yx[i];
    const Complex trace = a[0] * tool.xx[i] + a[1] * yx + a[2] * xy + a[3] * tool.yy[i];
    const Complex determinant = (a[0] * a[3] - a[1] * a[2]) * (tool.xx[i] * tool.yy[i] - xy * yx);
    const Complex root = std::sqrt(trace * trace - 4.0 * determinant);
    std::array<Complex, 2> value{{0.5 * (trace + root), 0.5 * (trace - root)}};
    if (i > 0) {
      const double same = std::abs(value[0] - branches[0].back()) + std::abs(value[1] - branches[1].back());
      const double swapped =
          std::abs(value[1] - branches[0].back()) + std::abs(value[0] - branches[1].back());
      if (swapped < same) std::swap(value[0], value[1]);
    }
    branches[0].push_back(value[0]);
    branches[1].push_back(value[1]);
  }
  return branches;
}

// Solution of 1 = b g (1 - exp(-i w T)) with g = kt teeth / (4 pi) lambda at one line.
struct LobePoint {
  double depth;  // [m] > 0, +inf where no positive depth exists
  double phase;  // [rad] w T modulo 2 pi, in (0, 2 pi)
};

LobePoint lobePoint(Complex g) {
  // 1 / (b g) = 1 - exp(-i theta) lies on the circle of radius 1 around 1, so b = |1 / g|^2 / (2 Re(1 / g))
  // with Re(1 / g) > 0.
  if (g == Complex(0.0)) return {std::numeric_limits<double>::infinity(), 0.0};
  const Complex inverse = 1.0 / g;
  const double depth = std::norm(inverse) / (2.0 * inverse.real());
  if (!(depth > 0.0) || !std::isfinite(depth)) return {std::numeric_limits<double>::infinity(), 0.0};
  double phase = -std::arg(1.0 - inverse / depth);
  if (phase <= 0.0) phase += TWO_PI;
  return {depth, phase};
}

}  // namespace

std::array<Complex, 4> ToolTipResponse::at(double f) const {
  const double positive = std::abs(f);
  const auto value = [&](const std::vector<Complex>& line) -> Complex {
    if (line.empty()) return 0.0;
    Complex v;
    if (positive <= frequency.front()) {
      v = line.front().real();
    } else if (positive >= frequency.back()) {
      const double ratio = frequency.back() / positive;
      v = line.back().real() * ratio * ratio;
    } else {
      const auto above = std::upper_bound(frequency.begin(), frequency.end(), positive);
      const auto i = static_cast<std::size_t>(above - frequency.begin());
      const double share = (positive - frequency[i - 1]) / (frequency[i] - frequency[i - 1]);
      v = line[i - 1] + share * (line[i] - line[i - 1]);
    }
    return f < 0.0 ? std::conj(v) : v;
  };
  return {value(xx), value(xy), value(yx), value(yy)};
}

void RegenerativeProcess::validate() const {
  require("number of teeth", teeth, Range::closed(1, 20));
  require("entry angle [rad]", entry, Range::notNegative());
  require("exit angle [rad]", exit, Range::openLow(entry, TWO_PI + 1e-9));
  require("tangential coefficient [N/m2]", kt, Range::positive());
  require("radial ratio", radial_ratio, Range{});  // below 0 at the tip of a ball end
}

std::vector<double> linesAround(double frequency, double damping_ratio, int lines) {
  std::vector<double> result;
  for (double k = 0.5; k < lines; k += 1.0) {
    const double f = frequency * (1.0 + 1.5 * damping_ratio * std::tan(PI * (k / lines - 0.5)));
    if (f > 0.3 * frequency && f < 3.0 * frequency) result.push_back(f);
  }
  return result;
}

std::array<double, 4> directionalCoefficients(const RegenerativeProcess& process) {
  process.validate();
  // Integrals over the immersion of -cos - r sin and sin - r cos (force on the tool per Kt h) times sin and
  // cos (chip thickness per x and y).
  const double f = process.entry, t = process.exit;
  const double ss = 0.5 * (t - f) - 0.25 * (std::sin(2 * t) - std::sin(2 * f));
  const double cc = 0.5 * (t - f) + 0.25 * (std::sin(2 * t) - std::sin(2 * f));
  const double sc = 0.5 * (std::sin(t) * std::sin(t) - std::sin(f) * std::sin(f));
  const double r = process.radial_ratio;
  // Twice the integrals, since the factor 1/2 of eq. 6.2 is not included.
  return {2.0 * (-sc - r * ss), 2.0 * (-cc - r * sc), 2.0 * (ss - r * sc), 2.0 * (sc - r * cc)};
}

ToolTipResponse responseOf(const ModalModel& x, const ModalModel& y, double low, double high,
                           std::size_t lines) {
  if (!(low >= 0.0) || !(high > low) || lines < 2)
    throw Error("stability: frequency band: expected 0 <= low < high");
  ToolTipResponse response;
  for (std::size_t i = 0; i < lines; ++i) {
    response.frequency.push_back(low +
                                 (high - low) * static_cast<double>(i) / static_cast<double>(lines - 1));
  }
  // Around a mode the response changes within its half-power bandwidth.
  constexpr int DENSE = 400;
  for (const ModalModel* model : {&x, &y}) {
    for (const Mode& mode : model->modes) {
      const double width = mode.damping_ratio * mode.frequency;
      for (int i = -DENSE; i <= DENSE; ++i) {
        const double f = mode.frequency + width * 20.0 * std::pow(static_cast<double>(i) / DENSE, 3);
        if (f > low && f < high) response.frequency.push_back(f);
      }
    }
  }
  std::sort(response.frequency.begin(), response.frequency.end());
  response.frequency.erase(std::unique(response.frequency.begin(), response.frequency.end()),
                           response.frequency.end());
  for (const double f : response.frequency) {
    response.xx.push_back(x.response(f));
    response.yy.push_back(y.response(f));
  }
  return response;
}

ToolTipResponse responseOf(const FrequencyResponse& x, const FrequencyResponse& y) {
  if (x.unit != "m/N" || y.unit != "m/N")
    throw Error("stability: FRFs with units " + x.unit + " and " + y.unit + ": expected receptances [m/N]");
  if (x.size() < 2 || y.size() < 2) throw Error("stability: FRF of the tool tip: expected at least 2 lines");
  ToolTipResponse response;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (x.frequency[i] < y.frequency.front() || x.frequency[i] > y.frequency.back() || x.frequency[i] <= 0.0)
      continue;
    response.frequency.push_back(x.frequency[i]);
    response.xx.push_back(x.value[i]);
    response.yy.push_back(y.at(x.frequency[i]));
  }
  if (response.frequency.size() < 2) throw Error("stability: FRFs of x and y: expected overlapping bands");
  return response;
}

ZeroOrderLobes::ZeroOrderLobes(const RegenerativeProcess& process, const ToolTipResponse& tool)
    : teeth_(process.teeth) {
  const double factor = process.kt * process.teeth / (4.0 * PI);
  for (const std::vector<Complex>& branch : eigenvalues(process, tool)) {
    LobePoint before{std::numeric_limits<double>::infinity(), 0.0};
    for (std::size_t i = 0; i < branch.size(); ++i) {
      LobePoint now = lobePoint(factor * branch[i]);
      absolute_ = std::min(absolute_, now.depth);
      if (std::isfinite(before.depth) && std::isfinite(now.depth)) {
        const double phase = before.phase + std::remainder(now.phase - before.phase, TWO_PI);
        segments_.push_back({TWO_PI * tool.frequency[i - 1], TWO_PI * tool.frequency[i], before.phase, phase,
                             before.depth, now.depth});
      }
      before = now;
    }
  }
}

StabilityLimit ZeroOrderLobes::limit(const std::vector<double>& speeds) const {
  StabilityLimit limit;
  limit.spindle_speed = speeds;
  limit.depth.assign(speeds.size(), std::numeric_limits<double>::infinity());
  limit.chatter_frequency.assign(speeds.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t k = 0; k < speeds.size(); ++k) {
    if (!(speeds[k] > 0.0) || (k > 0 && speeds[k] <= speeds[k - 1])) {
      throw Error("stability: spindle speeds: expected positive, ascending values");
    }
  }
  if (speeds.empty()) return limit;
  for (const Segment& s : segments_) {
    // Lobe j: w T = phase + 2 pi j, spindle speed 2 pi / (teeth T).
    const auto speedOf = [&](double w, double phase, int j) {
      return TWO_PI * w / (teeth_ * (phase + TWO_PI * j));
    };
    const int last = static_cast<int>(std::max(s.w1, s.w2) / (teeth_ * speeds.front())) + 2;
    for (int j = 0; j <= last; ++j) {
      if (s.phase1 + TWO_PI * j <= 0.0 || s.phase2 + TWO_PI * j <= 0.0) continue;
      const double n1 = speedOf(s.w1, s.phase1, j), n2 = speedOf(s.w2, s.phase2, j);
      auto speed = std::lower_bound(speeds.begin(), speeds.end(), std::min(n1, n2));
      for (; speed != speeds.end() && *speed <= std::max(n1, n2); ++speed) {
        const double share = n1 == n2 ? 0.0 : (*speed - n1) / (n2 - n1);
        const double depth = s.depth1 + share * (s.depth2 - s.depth1);
        const auto k = static_cast<std::size_t>(speed - speeds.begin());
        if (depth < limit.depth[k]) {
          limit.depth[k] = depth;
          limit.chatter_frequency[k] = (s.w1 + share * (s.w2 - s.w1)) / TWO_PI;
        }
      }
    }
  }
  return limit;
}

StabilityLimit zeroOrderLimit(const RegenerativeProcess& process, const ToolTipResponse& tool,
                              const std::vector<double>& speeds) {
  return ZeroOrderLobes(process, tool).limit(speeds);
}

double absoluteDepthLimit(const RegenerativeProcess& process, const ToolTipResponse& tool) {
  return ZeroOrderLobes(process, tool).absolute();
}

}  // namespace smartmill::stability
