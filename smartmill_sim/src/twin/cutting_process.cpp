#include "smartmill_sim/twin/cutting_process.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

using units::TWO_PI;

constexpr int NODES = 4096;  // of the surface over a turn
constexpr double NODE_ANGLE = TWO_PI / NODES;
constexpr double NO_GAP = 1e-9;  // [m] below this gap the edge still rubs: chips near 0 are rounded
constexpr int BEHIND = 2;        // nodes right behind a tooth that are still as it found them
// At the tip half as high: where runout or vibration lifts a tooth out of the work, a slice leaves it as a
// whole, and what that does to a ringing sensor falls with the square of the height.
constexpr std::size_t THIN_SLICES = 8;
constexpr double MARGIN = (1 + BEHIND) * NODE_ANGLE;  // surface kept beyond an arc, for the chip at its end
constexpr double ON_WALL = 0.5 * NODE_ANGLE;          // [rad] a node this near to where the feed is tangent

constexpr std::size_t PASSAGES = 64;              // kept: eight nodes' worth
constexpr double PASSAGE_ANGLE = NODE_ANGLE / 8;  // at least between two

double wrapped(double angle) {
  const double a = std::fmod(angle, TWO_PI);
  return a < 0.0 ? a + TWO_PI : a;
}

int nodeIndex(long n) {
  const long m = n % NODES;
  return static_cast<int>(m < 0 ? m + NODES : m);
}

/// The angle's representative that lies in an arc's reach: [entry - margin, entry - margin + 2 pi).
double besideArc(double angle, const ContactArc& arc, double margin) {
  const double first = arc.entry - margin;
  return first + wrapped(angle - first);
}

bool holds(const ContactArc& arc, double angle, double slice_low) {
  if (slice_low >= arc.depth) return false;
  return besideArc(angle, arc, MARGIN) <= arc.exit + MARGIN;
}

}  // namespace

void validate(const ContactArc& arc) {
  if (!(arc.entry >= 0.0 && arc.exit > arc.entry && arc.exit <= TWO_PI + 1e-9 && arc.depth > 0.0)) {
    char text[160];
    std::snprintf(text, sizeof text, "contact from %g to %g rad over %g m is impossible", arc.entry, arc.exit,
                  arc.depth);
    throw Error(text);
  }
}

void checkOffsets(const ToolGeometry& tool, std::vector<double>& radius_offset) {
  const auto teeth = static_cast<std::size_t>(tool.teeth);
  if (radius_offset.empty()) radius_offset.assign(teeth, 0.0);
  if (radius_offset.size() != teeth) {
    throw Error("cutting: " + std::to_string(radius_offset.size()) + " radius offsets for " +
                std::to_string(teeth) + " teeth");
  }
}

CuttingProcess::CuttingProcess(const ToolGeometry& tool, const CuttingLaw& law,
                               std::vector<double> radius_offset, double slice_angle)
    : tool_(tool), law_(law), offset_(std::move(radius_offset)), sin_(NODES), cos_(NODES) {
  validate(tool);
  checkOffsets(tool, offset_);
  for (int n = 0; n < NODES; ++n) {
    sin_[static_cast<std::size_t>(n)] = std::sin(n * NODE_ANGLE);
    cos_[static_cast<std::size_t>(n)] = std::cos(n * NODE_ANGLE);
  }
  // Without helix every height is alike: one slice of any height.
  height_ = tool.lag() > 0.0 ? slice_angle / tool.lag() : 1e3;
}

// The latest reach of any tooth at this angle, had the tool always moved as now.
double CuttingProcess::steadySurface(double node_angle, double lag, const ToolMotion& now) const {
  const double s = std::sin(node_angle), c = std::cos(node_angle);
  const double along = now.velocity[0] * s + now.velocity[1] * c;  // [m/s] into the work
  double reach = -1e300;
  for (int j = 0; j < tool_.teeth; ++j) {
    // As in cut(): the nodes right behind a tooth are still as the tooth found them.
    constexpr double NEAR = BEHIND * NODE_ANGLE;
    const double past = wrapped(now.angle + tool_.toothAngle(j) - lag - node_angle - NEAR) + NEAR;
    const double since = now.speed > 0.0 ? past / now.speed : 0.0;
    reach = std::max(reach, offset_[static_cast<std::size_t>(j)] - along * since);
  }
  return tool_.radius() + reach + now.centre[0] * s + now.centre[1] * c;
}

double CuttingProcess::lagOf(const Slice& slice, const ContactArc& arc) const {
  return tool_.lag() * 0.5 * (slice.low + std::min(slice.high, arc.depth));
}

void CuttingProcess::growTo(double depth) {
  while (slices_.empty() || slices_.back().high < depth) {
    const double low = slices_.empty() ? 0.0 : slices_.back().high;
    const double height = slices_.size() < THIN_SLICES ? 0.5 * height_ : height_;
    slices_.push_back({low, low + height, std::vector<double>(NODES, 0.0),
                       std::vector<double>(static_cast<std::size_t>(tool_.teeth), 0.0)});
  }
}

void CuttingProcess::engage(const std::vector<ContactArc>& arcs, const ToolMotion& now) {
  double depth = 0.0;
  for (const ContactArc& a : arcs) {
    validate(a);
    depth = std::max(depth, a.depth);
  }
  if (depth > 0.0) growTo(depth);
  for (Slice& slice : slices_) {
    for (int n = 0; n < NODES; ++n) {
      const double angle = n * NODE_ANGLE;
      const auto in = [&](const ContactArc& a) { return holds(a, angle, slice.low); };
      const auto arc = std::find_if(arcs.begin(), arcs.end(), in);
      if (arc != arcs.end() && std::none_of(arcs_.begin(), arcs_.end(), in)) {
        slice.surface[static_cast<std::size_t>(n)] = steadySurface(angle, lagOf(slice, *arc), now);
      }
    }
  }
  arcs_ = arcs;
}

void CuttingProcess::setDepths(const std::vector<double>& depths, const ToolMotion& now) {
  bool new_slice = false;
  for (std::size_t a = 0; a < arcs_.size(); ++a) {
    // Each arc's surface reaches to the end of its last slice.
    const auto last = std::find_if(slices_.begin(), slices_.end(),
                                   [&](const Slice& slice) { return slice.high >= arcs_[a].depth; });
    new_slice = new_slice || last == slices_.end() || depths.at(a) > last->high;
  }
  if (new_slice) {
    std::vector<ContactArc> arcs = arcs_;
    for (std::size_t a = 0; a < arcs.size(); ++a) arcs[a].depth = depths[a];
    engage(arcs, now);
  } else {
    for (std::size_t a = 0; a < arcs_.size(); ++a) arcs_[a].depth = depths[a];
  }
}

// Where the feed is tangent, on the walls of a slot, nothing takes a mark away again that a tooth has left.
// Such a node tells of a point only: the chip beside it is taken from the two nodes next to it in the
// material.
long CuttingProcess::leftNode(long left, const ToolMotion& now) const {
  const double speed = std::hypot(now.velocity[0], now.velocity[1]);
  const auto inside = [&](long n) {
    const auto i = static_cast<std::size_t>(nodeIndex(n));
    return now.velocity[0] * sin_[i] + now.velocity[1] * cos_[i] > ON_WALL * speed;
  };
  if (inside(left)) return inside(left + 1) ? left : left - 1;
  for (long next = left + 1; next <= left + BEHIND; ++next) {
    if (inside(next)) return next;
  }
  if (inside(left - 1)) return left - 2;
  return left;
}

void CuttingProcess::cut(Slice& slice, int tooth, double before, double angle, const ContactArc& arc,
                         const ToolMotion& now, CuttingForce& sum) {
  const auto j = static_cast<std::size_t>(tooth);
  const double radius = tool_.radius() + offset_[j];
  const double top = std::min(slice.high, arc.depth);
  const double half = 0.5 * tool_.lag() * (top - slice.low);
  // The part of the slice that is in the arc.
  double length = top - slice.low, middle = angle;
  if (half > 0.0) {
    const double from = std::max(angle - half, arc.entry), to = std::min(angle + half, arc.exit);
    length *= std::clamp((to - from) / (2.0 * half), 0.0, 1.0);
    middle = 0.5 * (from + to);
  } else if (angle < arc.entry || angle >= arc.exit) {
    length = 0.0;
  }
  if (length > 0.0) {
    const double s = std::sin(middle), c = std::cos(middle);
    // At the exit the surface behind the slice's middle is this tooth's own: the chip of the middle serves.
    const double at = std::max(angle, middle);
    if (at <= arc.exit) {
      const double place = at / NODE_ANGLE;
      const long left = leftNode(static_cast<long>(std::floor(place)), now);
      const double share = place - static_cast<double>(left);
      const auto a = static_cast<std::size_t>(nodeIndex(left));
      const auto b = static_cast<std::size_t>(nodeIndex(left + 1));
      // Against the tool's centre, where the surface is smooth enough to be interpolated.
      const double sa = slice.surface[a] - now.centre[0] * sin_[a] - now.centre[1] * cos_[a];
      const double sb = slice.surface[b] - now.centre[0] * sin_[b] - now.centre[1] * cos_[b];
      const double outward = at == middle
                                 ? now.displacement[0] * s + now.displacement[1] * c
                                 : now.displacement[0] * std::sin(at) + now.displacement[1] * std::cos(at);
      slice.chip[j] = radius + outward - sa - share * (sb - sa);
    }
    const double chip = std::max(slice.chip[j], 0.0);
    if (slice.chip[j] > -NO_GAP) {
      const CuttingCoefficients& k = law_.coefficients;
      double kc = law_.chip_factor;
      if (law_.size_exponent != 0.0 && chip > 0.0)
        kc *= std::pow(chip / law_.size_reference, -law_.size_exponent);
      const double h = kc * chip, edge = edgeShare(law_, chip);
      double ft = (k.ktc * h + k.kte * edge) * length;
      double fr = (k.krc * h + k.kre * edge) * length;
      const double fa = (k.kac * h + k.kae * edge) * length;
      if (law_.damping != 0.0 && now.speed > 0.0 && moved_) {
        const double dt = wrapped(now.angle - last_.angle) / now.speed;
        const double rate = dt > 0.0 ? ((now.displacement[0] - last_.displacement[0]) * s +
                                        (now.displacement[1] - last_.displacement[1]) * c) /
                                           dt
                                     : 0.0;
        const double damping = law_.damping * rate / (now.speed * tool_.radius()) * length;
        fr += damping;
        ft += 0.3 * damping;
      }
      sum.fx += -ft * c - fr * s;
      sum.fy += ft * s - fr * c;
      sum.fz += fa;
      sum.torque += ft * tool_.radius();
    }
  }
  // Cut the nodes passed since the last step, but those right behind the tooth, still needed as they were.
  // Each is left where the tip was when the tooth passed it.
  const long first = static_cast<long>(std::floor(before / NODE_ANGLE)) + 1 - BEHIND;
  const long last = static_cast<long>(std::floor(angle / NODE_ANGLE)) - BEHIND;
  for (long n = first; n <= last; ++n) {
    const auto i = static_cast<std::size_t>(nodeIndex(n));
    const auto [x, y] = tipBack(angle - static_cast<double>(n) * NODE_ANGLE);
    slice.surface[i] = std::max(slice.surface[i], radius + x * sin_[i] + y * cos_[i]);
  }
}

void CuttingProcess::remember(const ToolMotion& now, double turned) {
  turned_ += turned;
  const Passage here{turned_, {{now.centre[0] + now.displacement[0], now.centre[1] + now.displacement[1]}}};
  if (passages_.empty()) passages_.assign(PASSAGES, here);
  // The newest always stands at now; it stays once the spindle has turned on far enough.
  const Passage& before = passages_[(newest_ + PASSAGES - 1) % PASSAGES];
  if (passages_[newest_].turned - before.turned >= PASSAGE_ANGLE) newest_ = (newest_ + 1) % PASSAGES;
  passages_[newest_] = here;
}

std::array<double, 2> CuttingProcess::tipBack(double angle) const {
  const double at = turned_ - angle;
  std::size_t after = newest_, before = newest_;
  for (std::size_t k = 1; k < PASSAGES; ++k) {
    const std::size_t earlier = (newest_ + PASSAGES - k) % PASSAGES;
    // Before the first step the tool came as it went on.
    if (passages_[earlier].turned == passages_[before].turned) break;
    after = before;
    before = earlier;
    if (passages_[before].turned <= at) break;
  }
  const Passage &a = passages_[before], &b = passages_[after];
  const double span = b.turned - a.turned;
  const double share = span > 0.0 ? (at - a.turned) / span : 1.0;
  return {{a.tip[0] + share * (b.tip[0] - a.tip[0]), a.tip[1] + share * (b.tip[1] - a.tip[1])}};
}

CuttingForce CuttingProcess::step(const ToolMotion& now) {
  CuttingForce sum;
  remember(now, moved_ ? wrapped(now.angle - last_.angle) : 0.0);
  if (!arcs_.empty()) {
    const double turned = moved_ ? wrapped(now.angle - last_.angle) : 0.0;
    const ToolMotion before = moved_ ? last_ : now;
    if (!moved_) last_ = before;
    const double half_slice = 0.5 * tool_.lag() * height_;
    const double margin = MARGIN + half_slice;
    for (int j = 0; j < tool_.teeth; ++j) {
      const double tip = now.angle + tool_.toothAngle(j);
      for (const ContactArc& arc : arcs_) {
        // Most teeth are away from the arc with all of their edge.
        const double reach = arc.exit - arc.entry + 2.0 * margin + turned;
        if (reach + tool_.lag() * arc.depth < TWO_PI) {
          if (wrapped(tip - (arc.entry - margin)) > reach + tool_.lag() * arc.depth) continue;
        }
        for (Slice& slice : slices_) {
          if (slice.low >= arc.depth) break;
          const double angle = besideArc(tip - lagOf(slice, arc), arc, margin);
          if (angle > arc.exit + margin + turned) continue;
          cut(slice, j, angle - turned, angle, arc, now, sum);
        }
      }
    }
  }
  last_ = now;
  moved_ = true;
  return sum;
}

}  // namespace smartmill::sim
