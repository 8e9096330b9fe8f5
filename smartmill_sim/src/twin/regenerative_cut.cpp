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

constexpr int REVOLUTIONS = 2;      // that a surface may wait for the next tooth that reaches it
constexpr double CELL_ANGLE = 0.2;  // [rad] of the edge: two-point Gauss errs by 4e-7 of a smooth force
constexpr double LEAST_LAG = 1e-6;  // [rad] over the depth; below it the edge is straight
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
  double least = 1e300;
  for (const Plane& p : near_) least = std::min(least, p.offset + p.x * sine + p.y * cosine);
  return least;
}

// Most passes lie deeper than the last one all along the edge: with m the middle and w the half width,
// a sin + b cos >= min(C, C cos w) - |S| sin w, C and S its value and slope in the middle.
void RegenerativeCut::keepNear(double from, double to) {
  near_.assign(1, planes_.front());
  const Plane& last = planes_.front();
  const SineCosine middle = sineCosine(0.5 * (from + to)), half = sineCosine(0.5 * (to - from));
  for (std::size_t k = 1; k < planes_.size(); ++k) {
    const Plane& p = planes_[k];
    const double x = p.x - last.x, y = p.y - last.y;
    const double value = x * middle.sine + y * middle.cosine;
    const double slope = std::abs(x * middle.cosine - y * middle.sine);
    if (p.offset - last.offset + std::min(value, value * half.cosine) - slope * half.sine <= 0.0)
      near_.push_back(p);
  }
}

// Force over immersion angles that one edge holds [N m/rad of lag], all in the arc.
void RegenerativeCut::cut(double from, double to, CuttingForce& sum, double& tangential) {
  keepNear(from, to);
  const CuttingCoefficients& k = law_.coefficients;
  const double ktc = k.ktc * law_.chip_factor, krc = k.krc * law_.chip_factor, kac = k.kac * law_.chip_factor;
  const int cells = std::max(1, static_cast<int>(std::ceil((to - from) / CELL_ANGLE)));
  const double cell = (to - from) / cells;
  SineCosine left = sineCosine(from);
  double chip_left = chip(left.sine, left.cosine);
  for (int n = 0; n < cells; ++n) {
    const double start = from + n * cell;
    const SineCosine right = sineCosine(start + cell);
    const double chip_right = chip(right.sine, right.cosine);
    double low = 0.0, high = 1.0;
    const bool contact = chip_left > 0.0 || chip_right > 0.0;
    if (contact && chip_left < 0.0) low = chip_left / (chip_left - chip_right);
    if (contact && chip_right < 0.0) high = chip_left / (chip_left - chip_right);
    chip_left = chip_right;
    if (!contact) continue;
    const double weight = 0.5 * (high - low) * cell, middle = 0.5 * (high + low);
    for (const double side : {-0.28867513459481287, 0.28867513459481287}) {
      const SineCosine at = sineCosine(start + (middle + side * (high - low)) * cell);
      double h = std::max(chip(at.sine, at.cosine), 1e-15);
      const double edge = edgeShare(law_, h);
      if (law_.size_exponent != 0.0) h *= std::pow(h / law_.size_reference, -law_.size_exponent);
      const double damping = damping_[0] * at.sine + damping_[1] * at.cosine;
      const double ft = weight * (ktc * h + k.kte * edge + TANGENTIAL_DAMPING * damping);
      const double fr = weight * (krc * h + k.kre * edge + damping);
      sum.fx += -ft * at.cosine - fr * at.sine;
      sum.fy += ft * at.sine - fr * at.cosine;
      sum.fz += weight * (kac * h + k.kae * edge);
      tangential += ft;
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
          planes_.clear();
          for (const Pass& p : passes_[j]) {
            const std::array<double, 2>& before = delays_[p.delay].value;
            planes_.push_back({p.offset, displacement[0] - before[0] + feed_[0] * p.ahead,
                               displacement[1] - before[1] + feed_[1] * p.ahead});
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
