#include "smartmill_sim/twin/regenerative_cut.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "trigonometry.h"

namespace smartmill::sim {
namespace {

using units::TWO_PI;

constexpr int REVOLUTIONS = 2;        // that a surface may wait for the next tooth that reaches it
constexpr double CELL_ANGLE = 0.2;    // [rad] of the edge: two-point Gauss errs by 4e-7 of a smooth force
constexpr double LEAST_CHIP = 1e-15;  // [m] at the ends of a contact, which still rub
constexpr double LEAST_LAG = 1e-6;    // [rad] over the depth; below it the edge is straight
constexpr double TANGENTIAL_DAMPING = 0.3;  // [1] of the radial force

}  // namespace

RegenerativeCut::RegenerativeCut(const ToolGeometry& tool, const CuttingLaw& law, double time_step,
                                 std::vector<double> radius_offset)
    : tool_(tool), law_(law), time_step_(time_step), lag_(tool.lag()), offset_(std::move(radius_offset)) {
  validate(tool);
  checkOffsets(tool, offset_);
  for (int j = 0; j < tool.teeth; ++j) tooth_angle_.push_back(tool.toothAngle(j));
}

void RegenerativeCut::engage(const std::vector<ContactArc>& arcs, const ToolMotion& now) {
  for (const ContactArc& a : arcs) validate(a);
  if (!(now.speed > 0.0)) throw Error("regenerative cut: the spindle stands");
  arcs_ = arcs;
  speed_ = now.speed;
  feed_ = {{now.velocity[0] / speed_, now.velocity[1] / speed_}};
  passes_.assign(offset_.size(), {});
  delays_.clear();
  const std::size_t teeth = offset_.size();
  std::size_t longest = 0;
  for (std::size_t j = 0; j < teeth; ++j) {
    for (int revolution = 0; revolution < REVOLUTIONS; ++revolution) {
      for (std::size_t step = 1; step <= teeth; ++step) {
        const std::size_t i = (j + step) % teeth;
        const double pitch = step == teeth ? TWO_PI : wrapped(tooth_angle_[i] - tooth_angle_[j]);
        const double ahead = pitch + revolution * TWO_PI;
        const double steps = ahead / (speed_ * time_step_), whole = std::floor(steps), f = steps - whole;
        if (whole < 2.0) throw Error("regenerative cut: a tooth period is shorter than two steps");
        // Cubic through the steps whole - 1 .. whole + 2 ago.
        Delay delay{static_cast<std::size_t>(whole),
                    {{(f + 1.0) * f * (f - 1.0) / 6.0, -(f + 1.0) * f * (f - 2.0) / 2.0,
                      (f + 1.0) * (f - 1.0) * (f - 2.0) / 2.0, -f * (f - 1.0) * (f - 2.0) / 6.0}},
                    {{0, 0}}};
        std::size_t d = 0;
        const auto alike = [&](const Delay& other) {
          return other.whole == delay.whole && std::abs(other.weights[2] - delay.weights[2]) < 1e-9;
        };
        while (d < delays_.size() && !alike(delays_[d])) ++d;
        if (d == delays_.size()) delays_.push_back(delay);
        passes_[j].push_back({d, offset_[j] - offset_[i], ahead});
        longest = std::max(longest, delay.whole);
      }
    }
  }
  planes_.resize(teeth * REVOLUTIONS);
  near_.resize(planes_.size());
  std::size_t size = 1;
  while (size < longest + 4) size *= 2;
  history_.assign(size, {{0, 0}});
  newest_ = 0;
}

void RegenerativeCut::setDepths(const std::vector<double>& depths) {
  for (std::size_t a = 0; a < arcs_.size(); ++a) arcs_[a].depth = depths.at(a);
}

void RegenerativeCut::push(const std::array<double, 2>& displacement) {
  if (history_.empty()) return;
  newest_ = (newest_ + 1) & (history_.size() - 1);
  history_[newest_] = displacement;
}

double RegenerativeCut::chip(double sine, double cosine) const {
  double least = near_[0].offset + near_[0].x * sine + near_[0].y * cosine;
  for (std::size_t k = 1; k < near_count_; ++k)
    least = std::min(least, near_[k].offset + near_[k].x * sine + near_[k].y * cosine);
  return least;
}

void RegenerativeCut::spread(double half) {
  if (half == spread_.half) return;
  const double gauss = half * 0.57735026918962576;
  spread_ = {half, std::sin(half), std::cos(half), std::sin(gauss), std::cos(gauss)};
}

// Most passes lie deeper than the last one all along a cell. Within w of its middle
// a sin + b cos >= min(C, C cos w) - |S| sin w, with C and S its value and slope in the middle.
void RegenerativeCut::keepNear(double sine, double cosine) {
  const Plane last = planes_[0];
  near_[0] = last;
  near_count_ = 1;
  for (std::size_t k = 1; k < planes_.size(); ++k) {
    const Plane& p = planes_[k];
    const double x = p.x - last.x, y = p.y - last.y;
    const double value = x * sine + y * cosine, slope = std::abs(x * cosine - y * sine);
    if (p.offset - last.offset + std::min(value, value * spread_.end_cosine) - slope * spread_.end_sine <=
        0.0)
      near_[near_count_++] = p;
  }
}

// Elementary force at one angle.
void RegenerativeCut::add(double sine, double cosine, double weight, CuttingForce& sum,
                          double& tangential) const {
  const CuttingCoefficients& k = law_.coefficients;
  const double thickness = std::max(chip(sine, cosine), LEAST_CHIP);
  const double edge = edgeShare(law_, thickness);
  double h = law_.chip_factor * thickness;
  if (law_.size_exponent != 0.0) h *= std::pow(thickness / law_.size_reference, -law_.size_exponent);
  const double damping = damping_[0] * sine + damping_[1] * cosine;
  const double ft = weight * (k.ktc * h + k.kte * edge + TANGENTIAL_DAMPING * damping);
  const double fr = weight * (k.krc * h + k.kre * edge + damping);
  sum.fx += -ft * cosine - fr * sine;
  sum.fy += ft * sine - fr * cosine;
  sum.fz += weight * (k.kac * h + k.kae * edge);
  tangential += ft;
}

// Force over immersion angles that one edge holds [N m/rad of lag], all in the arc.
void RegenerativeCut::cut(double from, double to, CuttingForce& sum, double& tangential) {
  const int cells = std::max(1, static_cast<int>(std::ceil((to - from) / CELL_ANGLE)));
  spread((to - from) / (2.0 * cells));
  const double half = spread_.half;
  for (int n = 0; n < cells; ++n) {
    const double middle = from + (2 * n + 1) * half;
    const auto [s, c] = sineCosine(middle);
    keepNear(s, c);
    const double s_end = c * spread_.end_sine, c_end = s * spread_.end_sine;
    const double left = chip(s * spread_.end_cosine - s_end, c * spread_.end_cosine + c_end);
    const double right = chip(s * spread_.end_cosine + s_end, c * spread_.end_cosine - c_end);
    if (left <= 0.0 && right <= 0.0) continue;
    if (left >= 0.0 && right >= 0.0) {
      const double s_gauss = c * spread_.gauss_sine, c_gauss = s * spread_.gauss_sine;
      add(s * spread_.gauss_cosine - s_gauss, c * spread_.gauss_cosine + c_gauss, half, sum, tangential);
      add(s * spread_.gauss_cosine + s_gauss, c * spread_.gauss_cosine - c_gauss, half, sum, tangential);
      continue;
    }
    // Contact begins or ends in the cell, the chip nearly straight there.
    const double zero = middle + half * (left + right) / (left - right);
    const double low = left < 0.0 ? zero : middle - half, high = left < 0.0 ? middle + half : zero;
    const double part = 0.5 * (high - low), gauss = part * 0.57735026918962576;
    for (const double side : {-gauss, gauss}) {
      const SineCosine at = sineCosine(0.5 * (high + low) + side);
      add(at.sine, at.cosine, part, sum, tangential);
    }
  }
}

CuttingForce RegenerativeCut::at(double angle, const std::array<double, 2>& displacement) {
  CuttingForce sum;
  if (arcs_.empty()) return sum;
  // history_[newest_] stands one step ago.
  const std::size_t mask = history_.size() - 1;
  for (Delay& d : delays_) {
    const std::array<double, 2>&a = history_[(newest_ - d.whole - 1) & mask],
                             &b = history_[(newest_ - d.whole) & mask],
                             &c = history_[(newest_ - d.whole + 1) & mask],
                             &e = history_[(newest_ - d.whole + 2) & mask];
    for (std::size_t i = 0; i < 2; ++i)
      d.value[i] = d.weights[0] * a[i] + d.weights[1] * b[i] + d.weights[2] * c[i] + d.weights[3] * e[i];
  }
  if (law_.damping != 0.0) {
    const double share = law_.damping / (time_step_ * speed_ * tool_.radius());
    for (std::size_t i = 0; i < 2; ++i) damping_[i] = share * (displacement[i] - history_[newest_][i]);
  } else {
    damping_ = {{0, 0}};
  }
  double tangential = 0.0;
  for (std::size_t j = 0; j < offset_.size(); ++j) {
    bool ready = false;
    for (const ContactArc& arc : arcs_) {
      const double spread = lag_ * arc.depth;
      const bool straight = spread < LEAST_LAG;
      double tip = wrapped(angle + tooth_angle_[j]);
      for (double low = tip - spread;; tip += TWO_PI, low += TWO_PI) {
        const double from = std::max(low, arc.entry), to = std::min(tip, arc.exit);
        const bool in = straight ? tip >= arc.entry && tip < arc.exit : to > from;
        if (in && !ready) {
          const std::vector<Pass>& passes = passes_[j];
          for (std::size_t k = 0; k < passes.size(); ++k) {
            const std::array<double, 2>& before = delays_[passes[k].delay].value;
            planes_[k] = {passes[k].offset, displacement[0] - before[0] + feed_[0] * passes[k].ahead,
                          displacement[1] - before[1] + feed_[1] * passes[k].ahead};
          }
          ready = true;
        }
        if (in) {
          // A straight edge stands at one angle: any little spread gives the same.
          CuttingForce part;
          double part_tangential = 0.0;
          if (straight) {
            cut(tip, tip + LEAST_LAG, part, part_tangential);
          } else {
            cut(from, to, part, part_tangential);
          }
          const double height = straight ? arc.depth / LEAST_LAG : 1.0 / lag_;  // [m/rad]
          sum.fx += part.fx * height;
          sum.fy += part.fy * height;
          sum.fz += part.fz * height;
          tangential += part_tangential * height;
        }
        if (low + TWO_PI >= arc.exit) break;
      }
    }
  }
  sum.torque = tangential * tool_.radius();
  return sum;
}

}  // namespace smartmill::sim
