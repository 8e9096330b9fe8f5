#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "smartmill_core/cutting/chip_rule.h"
#include "smartmill_core/cutting/corner.h"
#include "smartmill_core/error.h"
#include "smartmill_stability/solvers/delayed_system.h"
#include "solvers/floquet.h"
#include "solvers/forced_vibration.h"

// Contact of the teeth in the forced vibration. The tool is divided into axial slices, a revolution into
// cells. The chip thickness of a tooth is the smallest of those against the surfaces of the 1 .. teeth
// previous teeth; the tooth cuts where it is positive. For a given contact the forced vibration is a linear
// problem (harmonic balance over a revolution), and the vibration determines the contact: Newton's method for
// a piecewise linear function, which ends when the contact no longer changes.

namespace smartmill::stability {
namespace {

using units::TWO_PI;

constexpr int CELLS = CONTACT.cells;

double wrap(double angle) {
  angle = std::fmod(angle, TWO_PI);
  return angle < 0.0 ? angle + TWO_PI : angle;
}

/// Contact segment in time of one tooth in one slice.
struct ContactSegment {
  double begin, end;  ///< [s] may extend beyond the period
  std::size_t delay;  ///< index into the delays
};

class Contact {
 public:
  Contact(const RegenerativeSystem& system, double speed, double depth)
      : system_(system),
        chip_(*system.chip),
        speed_(speed),
        period_(TWO_PI / speed),
        teeth_(system.teeth),
        vibration_(system.modes, period_) {
    const ToolGeometry tool = system.tool();
    addSlices(tool, depth);
    bool alike = true;
    for (std::size_t s = 0; s < slices_.size(); ++s) {
      const double z = slices_[s].middle;
      ToolGeometry mill = tool;
      mill.edge = {};
      mill.diameter = 2.0 * (tool.radius() - slices_[s].inset);
      std::vector<double> offset;
      for (int k = 0; k < teeth_; ++k) {
        offset.push_back(
            (chip_.radius_offset.empty() ? 0.0 : chip_.radius_offset[static_cast<std::size_t>(k)]) +
            serrationAt(tool, k, z));
        angle_.push_back(tool.toothAngle(k) - (tool.helix > 0.0 ? tool.lagOf(k) : 0.0) * z);
      }
      if (!tool.edge.helix.empty()) {
        mill.pitch.clear();
        for (int k = 0; k < teeth_; ++k) mill.pitch.push_back(tool.pitchAt(k, z));
      }
      const ChipRule rule(mill, offset);
      addPasses(rule, s == 0 || !tool.edge.helix.empty());
      alike = alike && rule.alike();
    }
    solve(chip_.forced_vibration && !alike && !system.modes.empty());
  }

  double period() const { return period_; }
  const ForcedVibration& vibration() const { return vibration_; }
  const std::vector<double>& delays() const { return delays_; }
  bool tooManyBreaks() const { return breaks().size() > CONTACT.most_breaks; }

  std::vector<double> breaks() const {
    std::vector<double> times;
    for (const auto& of_edge : segments_) {
      for (const ContactSegment& s : of_edge) {
        times.push_back(std::fmod(s.begin, period_));
        times.push_back(std::fmod(s.end, period_));
      }
    }
    std::sort(times.begin(), times.end());
    times.erase(
        std::unique(times.begin(), times.end(), [&](double a, double b) { return b - a < 1e-9 * period_; }),
        times.end());
    return times;
  }

  void operator()(double t, double inside, Feedback& feedback) const {
    feedback.clear(delays_.size());
    const bool damps = system_.hasProcessDamping();
    double at = std::fmod(inside, period_);
    if (at < 0.0) at += period_;
    for (std::size_t e = 0; e < segments_.size(); ++e) {
      for (const ContactSegment& s : segments_[e]) {
        const double shifted = at < s.begin ? at + period_ : at;
        if (shifted < s.begin || shifted >= s.end) continue;
        const double angle = angle_[e] + speed_ * t;
        const Slice& slice = sliceOf(e);
        const Eigen::Matrix2d stiffness = slice.height * directional(system_.kt, slice.kr, angle);
        feedback.now += stiffness;
        feedback.delayed[s.delay] -= stiffness;
        if (damps)
          feedback.velocity +=
              slice.height / (speed_ * (0.5 * system_.diameter - slice.inset)) *
              directional(system_.damping_tangential, slice.chip_radial * system_.damping_radial, angle);
        break;
      }
    }
  }

 private:
  /// A height of the tool with one contact.
  struct Slice {
    double middle, height;     ///< [m]
    double kr;                 ///< [N/m2] across the tool
    double chip_radial = 1.0;  ///< [1] sin(kappa)
    double inset = 0.0;        ///< [m] tool radius minus local radius
  };

  int sliceCount() const { return static_cast<int>(slices_.size()); }
  std::size_t edge(int s, int k) const { return static_cast<std::size_t>(s * teeth_ + k); }
  const Slice& sliceOf(std::size_t edge) const { return slices_[edge / static_cast<std::size_t>(teeth_)]; }
  /// Delay of an edge against the m-th previous tooth.
  std::size_t delayOf(std::size_t edge, int m) const {
    const std::size_t first = edge * static_cast<std::size_t>(teeth_) + static_cast<std::size_t>(m - 1);
    return delay_[first % delay_.size()];
  }

  /// Slices of the corner, then equal ones above it.
  void addSlices(const ToolGeometry& tool, double depth) {
    const EdgeShape& shape = system_.edge;
    const double corner = std::min(depth, cornerHeight(tool));
    double most_lag = system_.helix > 0.0 ? tool.lag() : 0.0, pitch_change = 0.0;  // [rad/m]
    for (int k = 0; k < teeth_ && !shape.helix.empty(); ++k) {
      most_lag = std::max(most_lag, tool.lagOf(k));
      pitch_change = std::max(pitch_change, std::abs(tool.lagOf((k + 1) % teeth_) - tool.lagOf(k)));
    }
    const auto add = [&](double low, double high, double across, double along, double inset) {
      const double rise = high - low;
      double required =
          std::max({1.0, most_lag * rise / CONTACT.slice_lag, pitch_change * rise / CONTACT.pitch_change});
      if (shape.serrated())
        required = std::max(required, CONTACT.wave_slices * rise / shape.serration_wavelength);
      const int count = std::min(CONTACT.most_slices, static_cast<int>(std::ceil(required)));
      for (int s = 0; s < count; ++s) {
        Slice slice{low + (s + 0.5) * (rise / count), rise / count, system_.kr};
        if (shape.inclined()) {
          slice.kr = system_.kr * across - system_.ka * along;
          slice.chip_radial = across;
          slice.inset = inset;
        }
        slices_.push_back(slice);
      }
    };
    for (const EdgeSlice& whole : edgeSlices(tool, depth)) {
      if (!whole.curved || whole.low >= depth) break;
      const EdgeSlice slice = between(whole.low, std::min(depth, whole.high), whole, tool);
      add(slice.low, slice.high, slice.chip_radial, slice.chip_axial, slice.inset);
    }
    if (depth <= corner) return;
    const double sine = std::sin(shape.edge_angle), cosine = std::cos(shape.edge_angle);
    add(corner, depth, sine, shape.edge_angle < 0.5 * units::PI ? cosine : 0.0,
        shape.edge_angle < 0.5 * units::PI ? -0.5 * (corner + depth) * cosine / sine : 0.0);
  }

  /// Chip of an edge against the m-th previous tooth, without vibration.
  const ChipShape& rigidChip(std::size_t e, int m) const {
    return rigid_chips_[e * static_cast<std::size_t>(teeth_) + static_cast<std::size_t>(m - 1)];
  }

  /// Adds the previous passes of one revolution. The forced vibration is synchronous with the revolution, so
  /// older surfaces are deeper.
  /// @param with_delays of this slice; otherwise those of the first one
  void addPasses(const ChipRule& rule, bool with_delays) {
    for (int k = 0; k < teeth_; ++k) {
      for (int m = 1; m <= teeth_; ++m) {
        rigid_chips_.push_back(rule.steadyShape(k, m, {{chip_.feed * teeth_ / TWO_PI, 0.0}}));
        if (!with_delays) continue;
        double turn = rule.turn(k, m);
        if (!system_.edge.helix.empty()) turn = CONTACT.delay_step * std::round(turn / CONTACT.delay_step);
        const double delay = m == teeth_ ? period_ : turn / speed_;
        std::size_t d = 0;
        while (d < delays_.size() && std::abs(delays_[d] - delay) > 1e-9 * delay) ++d;
        if (d == delays_.size()) delays_.push_back(delay);
        delay_.push_back(d);
      }
    }
  }

  /// [m] Chip thickness of a tooth against the m-th previous tooth at a cell.
  double chipAgainst(int s, int k, int m, int cell) const {
    const std::size_t e = edge(s, k);
    const double angle = angle_[e] + TWO_PI * (cell + 0.5) / CELLS;
    const double sine = std::sin(angle), cosine = std::cos(angle);
    double h = rigidChip(e, m).at(sine, cosine);
    if (!vibration_.empty()) {
      const auto i = static_cast<std::size_t>(cell);
      const auto &now = vibration_.motion(), &before = vibration_.delayed(delayOf(e, m));
      h += (now[0][i] - before[0][i]) * sine + (now[1][i] - before[1][i]) * cosine;
    }
    return h;
  }

  /// Previous tooth (1 .. teeth) that left the surface at a cell, and the chip thickness [m].
  std::pair<int, double> thinnestChip(int s, int k, int cell) const {
    std::pair<int, double> best{1, chipAgainst(s, k, 1, cell)};
    for (int m = 2; m <= teeth_; ++m) {
      const double h = chipAgainst(s, k, m, cell);
      if (h < best.second) best = {m, h};
    }
    return best;
  }

  /// [1] Fraction of a cell of an edge within the arc.
  double inArc(std::size_t e, int cell) const {
    const double width = TWO_PI / CELLS, middle = wrap(angle_[e] + width * (cell + 0.5));
    double share = 0.0;
    for (const double turn : {-TWO_PI, 0.0, TWO_PI}) {
      const double from = std::max(middle + turn - 0.5 * width, system_.entry);
      const double to = std::min(middle + turn + 0.5 * width, system_.exit);
      share += std::max(0.0, to - from) / width;
    }
    return share;
  }

  using Pattern = std::vector<signed char>;  // [edge * CELLS + cell]: 0 no contact, else m

  Pattern patternOf() const {
    Pattern pattern(angle_.size() * CELLS, 0);
    for (int s = 0; s < sliceCount(); ++s) {
      for (int k = 0; k < teeth_; ++k) {
        const std::size_t e = edge(s, k);
        for (int cell = 0; cell < CELLS; ++cell) {
          if (inArc(e, cell) <= 0.0) continue;
          const auto [m, h] = thinnestChip(s, k, cell);
          if (h > 0.0) pattern[e * CELLS + static_cast<std::size_t>(cell)] = static_cast<signed char>(m);
        }
      }
    }
    return pattern;
  }

  void solve(bool with_motion) {
    Pattern pattern = patternOf();
    for (int i = 0; with_motion && i < CONTACT.most_iterations; ++i) {
      vibration_.update(forcesOf(pattern), delays_, i < CONTACT.most_iterations / 2 ? 1.0 : 0.5);
      const Pattern next = patternOf();
      std::size_t changed = 0;
      for (std::size_t c = 0; c < next.size(); ++c) changed += next[c] != pattern[c];
      pattern = next;
      if (changed == 0) break;
    }
    setSegments(pattern);
  }

  ContactForces forcesOf(const Pattern& pattern) const {
    ContactForces forces{
        std::vector<std::vector<Eigen::Matrix2d>>(
            1 + delays_.size(), std::vector<Eigen::Matrix2d>(CELLS, Eigen::Matrix2d::Zero())),
        std::vector<Eigen::Vector2d>(CELLS, Eigen::Vector2d::Zero())};
    for (int s = 0; s < sliceCount(); ++s) {
      for (int k = 0; k < teeth_; ++k) {
        const std::size_t e = edge(s, k);
        const Slice& slice = sliceOf(e);
        for (int cell = 0; cell < CELLS; ++cell) {
          const auto i = static_cast<std::size_t>(cell);
          const int m = pattern[e * CELLS + i];
          if (m == 0) continue;
          const double angle = angle_[e] + TWO_PI * (cell + 0.5) / CELLS;
          const double sine = std::sin(angle), cosine = std::cos(angle);
          const Eigen::Matrix2d d = inArc(e, cell) * slice.height * directional(system_.kt, slice.kr, angle);
          forces.gain[0][i] += d;
          forces.gain[1 + delayOf(e, m)][i] -= d;
          // directional() is force times normal; multiplied by the normal it is the force per chip thickness.
          // The edge force is that of a chip of one metre with the coefficients kte and kre.
          const Eigen::Vector2d normal(sine, cosine);
          forces.force[i] +=
              d * normal * rigidChip(e, m).at(sine, cosine) +
              inArc(e, cell) * slice.height * directional(chip_.kte, chip_.kre, angle) * normal;
        }
      }
    }
    return forces;
  }

  /// Joins cells to contact segments, whose ends are where the chip thickness is zero or where the surface of
  /// another tooth begins.
  void setSegments(const Pattern& pattern) {
    const double width = period_ / CELLS;
    segments_.assign(angle_.size(), {});
    for (int s = 0; s < sliceCount(); ++s) {
      for (int k = 0; k < teeth_; ++k) {
        const std::size_t e = edge(s, k);
        // Entry and exit of this edge in time.
        const double begin = wrap(system_.entry - angle_[e]) / speed_;
        const double end = begin + (system_.exit - system_.entry) / speed_;
        const auto of = [&](int cell) {
          return static_cast<int>(
              pattern[e * CELLS + static_cast<std::size_t>(((cell % CELLS) + CELLS) % CELLS)]);
        };
        const auto first = static_cast<int>(std::floor(begin / width));
        const auto last = static_cast<int>(std::ceil(end / width)) - 1;
        double from = begin;
        int m = of(first);
        for (int cell = first + 1; cell <= last + 1; ++cell) {
          const int next = cell <= last ? of(cell) : -1;
          if (next == m) continue;
          double to = end;
          if (cell <= last) to = std::clamp(change(s, k, cell - 1, m, next), from, end);
          if (m > 0 && to > from + 1e-9 * period_) segments_[e].push_back({from, to, delayOf(e, m)});
          from = to;
          m = next;
        }
      }
    }
  }

  /// [s] Transition from contact a to b between the middles of a cell and the next.
  double change(int s, int k, int cell, int a, int b) const {
    const int here = ((cell % CELLS) + CELLS) % CELLS, next = (here + 1) % CELLS;
    double before, after;
    if (a == 0 || b == 0) {
      const int m = a == 0 ? b : a;
      before = chipAgainst(s, k, m, here);
      after = chipAgainst(s, k, m, next);
    } else {
      before = chipAgainst(s, k, a, here) - chipAgainst(s, k, b, here);
      after = chipAgainst(s, k, a, next) - chipAgainst(s, k, b, next);
    }
    const double share = before * after < 0.0 ? before / (before - after) : 0.5;
    return (cell + 0.5 + share) * period_ / CELLS;
  }

  RegenerativeSystem system_;
  ChipGeometry chip_;
  double speed_, period_;
  int teeth_;
  std::vector<Slice> slices_;
  std::vector<double> angle_;           // [rad] of each edge at time 0
  std::vector<double> delays_;          // [s]
  std::vector<ChipShape> rigid_chips_;  // of each edge against each pass
  std::vector<std::size_t> delay_;      // of each pass of the first slice, or of all
  ForcedVibration vibration_;
  std::vector<std::vector<ContactSegment>> segments_;  // of each edge
};

}  // namespace

ForcedVibration forcedVibration(const RegenerativeSystem& system, double speed, double depth) {
  if (!system.chip) throw Error("forced vibration: expected a system with a chip geometry");
  if (!(speed > 0.0) || !(depth > 0.0)) throw Error("forced vibration: expected speed and depth above 0");
  return Contact(system, speed, depth).vibration();
}

DelayedSystem contactSystem(const RegenerativeSystem& system, double speed, double depth) {
  if (!system.chip) throw Error("stability: expected a system with a chip geometry");
  if (!(speed > 0.0) || !(depth > 0.0)) throw Error("stability: expected speed and depth above 0");
  const Contact contact(system, speed, depth);
  DelayedSystem delayed;
  delayed.modes = system.modes;
  delayed.stiffness =
      depth * std::hypot(system.kt, system.edge.inclined() ? std::hypot(system.kr, system.ka) : system.kr);
  delayed.period = contact.period();
  delayed.delays = contact.delays();
  delayed.rate = 2.0 * speed;
  if (contact.tooManyBreaks()) {
    // Many small jumps: treated as smooth feedback.
    delayed.feedback = [contact](double t, double, Feedback& feedback) { contact(t, t, feedback); };
  } else {
    delayed.breaks = contact.breaks();
    delayed.feedback = contact;
  }
  return delayed;
}

}  // namespace smartmill::stability
