#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "smartmill_core/cutting/chip_rule.h"
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
    const ToolGeometry tool{system.teeth, system.diameter, system.helix, system.pitch};
    const double lag = system.helix > 0.0 ? tool.lag() : 0.0;
    double required = std::max(1.0, lag * depth / CONTACT.slice_lag);
    if (chip_.serration_amplitude > 0.0)
      required = std::max(required, CONTACT.wave_slices * depth / chip_.serration_wavelength);
    slices_ = std::min(CONTACT.most_slices, static_cast<int>(std::ceil(required)));
    height_ = depth / slices_;
    bool alike = true;
    for (int s = 0; s < slices_; ++s) {
      const double z = (s + 0.5) * height_;
      std::vector<double> offset;
      for (int k = 0; k < teeth_; ++k) {
        offset.push_back(offsetAt(k, z));
        angle_.push_back(tool.toothAngle(k) - lag * z);
      }
      const ChipRule rule(tool, offset);
      addPasses(rule, s == 0);
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
    feedback.now.setZero();
    feedback.velocity.setZero();
    feedback.delayed.assign(delays_.size(), Eigen::Matrix2d::Zero());
    const double damp = system_.hasProcessDamping() ? 1.0 / (0.5 * speed_ * system_.diameter) : 0.0;
    double at = std::fmod(inside, period_);
    if (at < 0.0) at += period_;
    for (std::size_t e = 0; e < segments_.size(); ++e) {
      for (const ContactSegment& s : segments_[e]) {
        const double shifted = at < s.begin ? at + period_ : at;
        if (shifted < s.begin || shifted >= s.end) continue;
        const double angle = angle_[e] + speed_ * t;
        const Eigen::Matrix2d stiffness = height_ * directional(system_.kt, system_.kr, angle);
        feedback.now += stiffness;
        feedback.delayed[s.delay] -= stiffness;
        if (damp > 0.0)
          feedback.velocity +=
              height_ * damp * directional(system_.damping_tangential, system_.damping_radial, angle);
        break;
      }
    }
  }

 private:
  std::size_t edge(int s, int k) const { return static_cast<std::size_t>(s * teeth_ + k); }
  std::size_t pass(int k, int m) const { return static_cast<std::size_t>(k * teeth_ + m - 1); }
  /// Chip of an edge against the m-th previous tooth, without vibration.
  const ChipShape& rigidChip(std::size_t e, int m) const {
    return rigid_chips_[e * static_cast<std::size_t>(teeth_) + static_cast<std::size_t>(m - 1)];
  }

  /// [m] Radius of tooth k at height z minus the nominal radius.
  double offsetAt(int k, double z) const {
    double offset = chip_.radius_offset.empty() ? 0.0 : chip_.radius_offset[static_cast<std::size_t>(k)];
    if (chip_.serration_amplitude > 0.0)
      offset += chip_.serration_amplitude *
                std::sin(TWO_PI * (z / chip_.serration_wavelength + static_cast<double>(k) / teeth_));
    return offset;
  }

  /// Adds the previous passes of one revolution. The forced vibration is synchronous with the revolution, so
  /// older surfaces are deeper.
  void addPasses(const ChipRule& rule, bool first_slice) {
    for (int k = 0; k < teeth_; ++k) {
      for (int m = 1; m <= teeth_; ++m) {
        rigid_chips_.push_back(rule.steadyShape(k, m, {{chip_.feed * teeth_ / TWO_PI, 0.0}}));
        if (!first_slice) continue;
        const double delay = rule.turn(k, m) / speed_;
        std::size_t d = 0;
        while (d < delays_.size() && std::abs(delays_[d] - delay) > 1e-9 * delay) ++d;
        if (d == delays_.size()) delays_.push_back(delay);
        delay_.push_back(d);
      }
    }
  }

  /// [m] Chip thickness of a tooth against the m-th previous tooth at a cell.
  double chipAgainst(int s, int k, int m, int cell) const {
    const std::size_t e = edge(s, k), p = pass(k, m);
    const double angle = angle_[e] + TWO_PI * (cell + 0.5) / CELLS;
    const double sine = std::sin(angle), cosine = std::cos(angle);
    double h = rigidChip(e, m).at(sine, cosine);
    if (!vibration_.empty()) {
      const auto i = static_cast<std::size_t>(cell);
      const auto &now = vibration_.motion(), &before = vibration_.delayed(delay_[p]);
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
    for (int s = 0; s < slices_; ++s) {
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
    for (int s = 0; s < slices_; ++s) {
      for (int k = 0; k < teeth_; ++k) {
        const std::size_t e = edge(s, k);
        for (int cell = 0; cell < CELLS; ++cell) {
          const auto i = static_cast<std::size_t>(cell);
          const int m = pattern[e * CELLS + i];
          if (m == 0) continue;
          const double angle = angle_[e] + TWO_PI * (cell + 0.5) / CELLS;
          const double sine = std::sin(angle), cosine = std::cos(angle);
          const Eigen::Matrix2d d = inArc(e, cell) * height_ * directional(system_.kt, system_.kr, angle);
          forces.gain[0][i] += d;
          forces.gain[1 + delay_[pass(k, m)]][i] -= d;
          // directional() is force times normal; multiplied by the normal it is the force per chip thickness.
          // The edge force is that of a chip of one metre with the coefficients kte and kre.
          const Eigen::Vector2d normal(sine, cosine);
          forces.force[i] += d * normal * rigidChip(e, m).at(sine, cosine) +
                             inArc(e, cell) * height_ * directional(chip_.kte, chip_.kre, angle) * normal;
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
    for (int s = 0; s < slices_; ++s) {
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
          if (m > 0 && to > from + 1e-9 * period_) segments_[e].push_back({from, to, delay_[pass(k, m)]});
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
  int teeth_, slices_ = 1;
  double height_ = 0.0;                 // [m] of a slice
  std::vector<double> angle_;           // [rad] of each edge at time 0
  std::vector<double> delays_;          // [s]
  std::vector<ChipShape> rigid_chips_;  // of each edge against each pass
  std::vector<std::size_t> delay_;      // of each pass
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
  delayed.stiffness = depth * std::hypot(system.kt, system.kr);
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
