#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <Eigen/LU>

#include "smartmill_core/cutting/corner.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/zero_order.h"
#include "solvers/harmonic_balance.h"

namespace smartmill::stability {
namespace {

using Complex = std::complex<double>;
using units::TWO_PI;

/// Mean feedback only. Milling with even pitch: zeroOrderLimit() for all speeds; otherwise (several delays,
/// overlap, damping) sign changes of the imaginary part over the lines at each speed.
class ZeroOrder : public StabilitySolver {
 public:
  explicit ZeroOrder(const RegenerativeSystem& system) : system_(system) {
    if (system_.response) {
      response_ = *system_.response;
    } else {
      double highest = 0.0;
      for (const SystemMode& mode : system_.modes) highest = std::max(highest, mode.frequency);
      response_ = responseOf(system_.modes, 1.0, 3.0 * highest, 40000);
    }
  }

  Limit limit(double speed, double max_depth) const override { return limits({speed}, max_depth).front(); }

  std::vector<Limit> limits(const std::vector<double>& speeds, double max_depth) const override {
    if (!(max_depth > 0.0)) throw Error("stability: largest depth: expected a value above 0");
    if (system_.cut == Cut::milling && system_.evenPitch() && system_.overlap == 1.0 &&
        !system_.hasProcessDamping() && !system_.chip && system_.kt > 0.0) {
      const RegenerativeProcess process{system_.teeth, system_.entry, system_.exit, system_.kt,
                                        system_.kr / system_.kt};
      std::vector<double> sorted = speeds;
      std::sort(sorted.begin(), sorted.end());
      sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
      const StabilityLimit found =
          system_.edge.inclined() ? inclined(sorted) : zeroOrderLimit(process, response_, sorted);
      std::vector<Limit> limits(speeds.size());
      for (std::size_t i = 0; i < speeds.size(); ++i) {
        const auto k = static_cast<std::size_t>(std::lower_bound(sorted.begin(), sorted.end(), speeds[i]) -
                                                sorted.begin());
        if (found.depth[k] > max_depth) continue;
        limits[i].depth = found.depth[k];
        limits[i].frequency = found.chatter_frequency[k];
        limits[i].kind = Kind::hopf;
      }
      return limits;
    }
    if (system_.edge.inclined())
      throw Error(
          "method zero_order: inclined edge with uneven pitch, process damping or a chip geometry: expected "
          "collocation");
    std::vector<Limit> limits;
    for (const double speed : speeds) limits.push_back(general(speed, max_depth));
    return limits;
  }

 private:
  /// The mean radial coefficient of an inclined edge changes with the depth b: limits L of its values give
  /// the first solution of L(kr(b)) = b.
  StabilityLimit inclined(const std::vector<double>& speeds) const {
    constexpr int VALUES = 33;
    constexpr double GROWTH = 1.02;  // of the depth, from one sample to the next
    const double corner = cornerHeight(system_.tool()), deep = system_.meanRadial(1e6);
    const double shallow = corner > 0.0 ? system_.meanRadial(1e-3 * corner) : deep;
    const double low = std::min(shallow, deep), high = std::max(shallow, deep);
    std::vector<StabilityLimit> of;  // radial coefficients from low to high
    for (int i = 0; i < (high > low ? VALUES : 1); ++i)
      of.push_back(zeroOrderLimit({system_.teeth, system_.entry, system_.exit, system_.kt,
                                   (low + (high - low) * i / (VALUES - 1)) / system_.kt},
                                  response_, speeds));
    StabilityLimit limit = of.front();
    for (std::size_t k = 0; k < speeds.size() && of.size() > 1; ++k) {
      double least = std::numeric_limits<double>::infinity(), most = 0.0;
      for (const StabilityLimit& l : of) {
        least = std::min(least, l.depth[k]);
        most = std::max(most, l.depth[k]);
      }
      limit.depth[k] = std::numeric_limits<double>::infinity();
      // [m] of the limit above the depth
      const auto above = [&](double depth, std::size_t* at) {
        const double place =
            std::clamp((system_.meanRadial(depth) - low) / (high - low), 0.0, 1.0) * (VALUES - 1);
        const auto i = std::min(static_cast<std::size_t>(place), of.size() - 2);
        const double share = place - static_cast<double>(i);
        *at = i;
        return (1.0 - share) * of[i].depth[k] + share * of[i + 1].depth[k] - depth;
      };
      if (!std::isfinite(least)) continue;
      std::size_t at = 0;
      double depth = 0.999 * least, over = above(depth, &at);
      for (double next = GROWTH * depth; std::isfinite(over) && depth <= most; next *= GROWTH) {
        const double over_next = above(next, &at);
        if (over_next <= 0.0) {
          limit.depth[k] = depth + (next - depth) * over / (over - over_next);
          limit.chatter_frequency[k] = of[at].chatter_frequency[k];
          break;
        }
        depth = next;
        over = over_next;
      }
    }
    return limit;
  }

  Limit general(double speed, double max_depth) const {
    RegenerativeSystem straight = system_;
    straight.helix = 0.0;  // no effect on the mean
    // Serration: mean over a whole wave.
    double height = 1.0;  // [m]
    if (straight.chip) {
      straight.chip->forced_vibration = false;
      if (straight.edge.serrated()) height = straight.edge.serration_wavelength;
    }
    const Harmonics mean = harmonicsOf(straight, speed, 0, height);
    Limit limit;
    std::array<Complex, 2> before{};
    for (std::size_t i = 0; i < response_.frequency.size(); ++i) {
      const double w = TWO_PI * response_.frequency[i];
      const auto g = response_.at(response_.frequency[i]);
      Eigen::Matrix2cd m;
      m << g[0], g[1], g[2], g[3];
      m = (m * mean.at(0, w)).eval();
      const Complex root = std::sqrt(m.trace() * m.trace() - 4.0 * m.determinant());
      std::array<Complex, 2> now{{0.5 * (m.trace() + root), 0.5 * (m.trace() - root)}};
      if (i > 0) {
        if (std::abs(now[0] - before[0]) + std::abs(now[1] - before[1]) >
            std::abs(now[1] - before[0]) + std::abs(now[0] - before[1]))
          std::swap(now[0], now[1]);
        for (std::size_t b = 0; b < 2; ++b) {
          if (before[b].imag() * now[b].imag() >= 0.0) continue;
          const double share = before[b].imag() / (before[b].imag() - now[b].imag());
          const double depth = 1.0 / (before[b] + share * (now[b] - before[b])).real();
          if (!(depth > 0.0) || depth >= std::min(limit.depth, max_depth)) continue;
          limit.depth = depth;
          limit.frequency =
              response_.frequency[i - 1] + share * (response_.frequency[i] - response_.frequency[i - 1]);
          limit.kind = Kind::hopf;
        }
      }
      before = now;
    }
    return limit;
  }

  RegenerativeSystem system_;
  ToolTipResponse response_;
};

}  // namespace

void needDynamics(const RegenerativeSystem& system) {
  system.validate();
  if (system.modes.empty() && !system.response)
    throw Error("stability: expected modes or receptances of the tool tip");
  if (system.response && system.response->frequency.size() < 2)
    throw Error("stability: FRF of the tool tip: expected at least 2 lines");
}

ToolTipResponse responseOf(const std::vector<SystemMode>& modes, double low, double high, std::size_t lines) {
  ModalModel grid;
  for (const SystemMode& mode : modes) grid.modes.push_back({mode.frequency, mode.damping_ratio, 0.0});
  return responseOf(modes, responseOf(grid, ModalModel{}, low, high, lines).frequency);
}

ToolTipResponse responseOf(const std::vector<SystemMode>& modes, std::vector<double> frequencies) {
  ToolTipResponse response;
  response.frequency = std::move(frequencies);
  for (const double f : response.frequency) {
    const auto g = receptance(modes, f);
    response.xx.push_back(g[0]);
    response.xy.push_back(g[1]);
    response.yx.push_back(g[2]);
    response.yy.push_back(g[3]);
  }
  return response;
}

std::unique_ptr<StabilitySolver> makeZeroOrder(const RegenerativeSystem& system) {
  needDynamics(system);
  return std::make_unique<ZeroOrder>(system);
}

}  // namespace smartmill::stability
