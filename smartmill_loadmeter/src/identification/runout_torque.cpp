#include "smartmill_loadmeter/identification/runout_torque.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

using units::PI;
using units::TWO_PI;

RunoutTorque::RunoutTorque(const ToolGeometry& tool, const Engagement& e, double x, double y)
    : tool_(tool), depth_(e.axial_depth) {
  const double low = std::max(e.entry, 0.0), high = std::min(e.exit, PI);
  std::vector<double> radius;
  for (int t = 0; t < tool.teeth; ++t) {
    tooth_angle_.push_back(tool.toothAngle(t));
    radius.push_back(x * std::cos(tooth_angle_.back()) + y * std::sin(tooth_angle_.back()));
  }
  struct Surface {
    double slope, level;
  };
  for (int t = 0; t < tool.teeth; ++t) {
    std::vector<Surface> surfaces;
    double feed = 0.0;
    for (int m = 1; m <= tool.teeth; ++m) {
      feed += e.feed_per_tooth * tool.teeth * tool.pitchOf((t + m - 1) % tool.teeth) / TWO_PI;
      surfaces.push_back({feed, radius[static_cast<std::size_t>(t)] -
                                    radius[static_cast<std::size_t>((t + m) % tool.teeth)]});
    }
    std::vector<double> edges{low, high};
    const auto edge = [&](double sine) {
      if (!(sine > 0.0 && sine < 1.0)) return;
      for (const double phi : {std::asin(sine), PI - std::asin(sine)}) {
        if (phi > low && phi < high) edges.push_back(phi);
      }
    };
    for (std::size_t a = 0; a < surfaces.size(); ++a) {
      edge(-surfaces[a].level / surfaces[a].slope);
      for (std::size_t b = a + 1; b < surfaces.size(); ++b) {
        edge((surfaces[a].level - surfaces[b].level) / (surfaces[b].slope - surfaces[a].slope));
      }
    }
    std::sort(edges.begin(), edges.end());
    std::vector<Piece> pieces{{0.0, 0.0, 0.0, false, {0.0, 0.0}}};
    const auto close = [&](double phi) {
      const Piece& p = pieces.back();
      std::array<double, 2> sum = p.before;
      if (p.cuts) {
        sum[0] += p.slope * (std::cos(p.from) - std::cos(phi)) + p.level * (phi - p.from);
        sum[1] += phi - p.from;
      }
      return sum;
    };
    for (std::size_t i = 0; i + 1 < edges.size(); ++i) {
      const double s = std::sin(0.5 * (edges[i] + edges[i + 1]));
      const Surface* nearest = &surfaces.front();
      for (const Surface& other : surfaces) {
        if (other.slope * s + other.level < nearest->slope * s + nearest->level) nearest = &other;
      }
      const bool cuts = nearest->slope * s + nearest->level > 0.0;
      pieces.push_back({edges[i], nearest->slope, nearest->level, cuts, close(edges[i])});
    }
    pieces.push_back({high, 0.0, 0.0, false, close(high)});
    teeth_.push_back(std::move(pieces));
  }
}

std::array<double, 2> RunoutTorque::integral(const std::vector<Piece>& pieces, double phi) const {
  const double turns = std::floor(phi / TWO_PI);
  phi -= TWO_PI * turns;
  const auto after = std::upper_bound(pieces.begin(), pieces.end(), phi,
                                      [](double value, const Piece& p) { return value < p.from; });
  const Piece& p = after == pieces.begin() ? pieces.front() : *(after - 1);
  std::array<double, 2> sum = p.before;
  if (p.cuts) {
    sum[0] += p.slope * (std::cos(p.from) - std::cos(phi)) + p.level * (phi - p.from);
    sum[1] += phi - p.from;
  }
  for (std::size_t u = 0; u < 2; ++u) sum[u] += turns * pieces.back().before[u];
  return sum;
}

std::array<double, 2> RunoutTorque::density(const std::vector<Piece>& pieces, double phi) const {
  phi -= TWO_PI * std::floor(phi / TWO_PI);
  const auto after = std::upper_bound(pieces.begin(), pieces.end(), phi,
                                      [](double value, const Piece& p) { return value < p.from; });
  const Piece& p = after == pieces.begin() ? pieces.front() : *(after - 1);
  if (!p.cuts) return {0.0, 0.0};
  return {p.slope * std::sin(phi) + p.level, 1.0};
}

std::array<double, 2> RunoutTorque::at(double spindle_angle) const {
  std::array<double, 2> torque{0.0, 0.0};
  const double lag = tool_.lag();
  for (std::size_t t = 0; t < teeth_.size(); ++t) {
    const double phi = spindle_angle + tooth_angle_[t];
    if (lag * depth_ < 1e-9) {
      const std::array<double, 2> d = density(teeth_[t], phi);
      for (std::size_t u = 0; u < 2; ++u) torque[u] += tool_.radius() * depth_ * d[u];
    } else {
      const std::array<double, 2> top = integral(teeth_[t], phi - lag * depth_),
                                  tip = integral(teeth_[t], phi);
      for (std::size_t u = 0; u < 2; ++u) torque[u] += tool_.radius() / lag * (tip[u] - top[u]);
    }
  }
  return torque;
}

std::array<double, 2> RunoutTorque::mean() const {
  std::array<double, 2> torque{0.0, 0.0};
  for (const std::vector<Piece>& pieces : teeth_) {
    for (std::size_t u = 0; u < 2; ++u) {
      torque[u] += tool_.radius() * depth_ * pieces.back().before[u] / TWO_PI;
    }
  }
  return torque;
}

}  // namespace smartmill::loadmeter
