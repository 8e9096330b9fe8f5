#include <algorithm>
#include <array>
#include <cmath>

#include "smartmill_core/cutting/corner.h"
#include "smartmill_core/cutting/cutting_law.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/require.h"
#include "smartmill_stability/solvers/delayed_system.h"
#include "smartmill_stability/solvers/solver.h"
#include "solvers/floquet.h"

namespace smartmill::stability {
namespace {

using units::PI;
using units::TWO_PI;

}  // namespace

Eigen::Matrix2d directional(double tangential, double radial, double angle) {
  const double s = std::sin(angle), c = std::cos(angle);
  const Eigen::Vector2d force(-tangential * c - radial * s, tangential * s - radial * c);
  return force * Eigen::RowVector2d(s, c);
}

namespace {

/// Antiderivative of directional() over the angle.
Eigen::Matrix2d directionalIntegral(double tangential, double radial, double angle) {
  const double s2 = 0.25 * std::sin(2.0 * angle), sc = 0.5 * std::sin(angle) * std::sin(angle);
  const double ss = 0.5 * angle - s2, cc = 0.5 * angle + s2;
  Eigen::Matrix2d m;
  m << -tangential * sc - radial * ss, -tangential * cc - radial * sc, tangential * ss - radial * sc,
      tangential * sc - radial * cc;
  return m;
}

/// directional() with the coefficients of the system at an angle [rad].
Eigen::Matrix2d stiffnessAt(const RegenerativeSystem& system, double angle) {
  if (!system.along_arc) return directional(system.kt, system.kr, angle);
  const auto [tangential, radial] = system.along_arc(angle);
  return directional(tangential, radial, angle);
}

constexpr double NO_SWEEP = 1e-9;  // [rad] lag of an edge that is taken as straight
constexpr int ARC_PARTS = 1024;

double wrap(double angle) {
  angle = std::fmod(angle, TWO_PI);
  return angle < 0.0 ? angle + TWO_PI : angle;
}

/// Feedback of the teeth of a cut at one speed and depth.
class Teeth {
 public:
  Teeth(const RegenerativeSystem& system, double speed, double depth) : system_(system), speed_(speed) {
    const ToolGeometry tool = system.tool();
    swept_ = system.helix > 0.0 ? tool.lag() * depth : 0.0;
    depth_ = depth;
    const double v = 0.5 * speed * system.diameter;
    damps_ = system.hasProcessDamping();
    tangential_damping_ = damps_ ? system.damping_tangential / v : 0.0;
    radial_damping_ = damps_ ? system.damping_radial / v : 0.0;
    for (int k = 0; k < system.teeth; ++k) {
      angle_.push_back(tool.toothAngle(k));
      const double delay = system.evenPitch() ? TWO_PI / system.teeth / speed : system.pitchOf(k) / speed;
      std::size_t d = 0;
      while (d < delays_.size() && std::abs(delays_[d] - delay) > 1e-9 * delay) ++d;
      if (d == delays_.size()) delays_.push_back(delay);
      delay_.push_back(d);
    }
    if (system.along_arc && swept_ >= NO_SWEEP) sumAlongArc();
  }

  const std::vector<double>& delays() const { return delays_; }

  std::vector<double> breaks(double period) const {
    std::vector<double> times;
    for (const double angle : angle_) {
      for (const double edge : {system_.entry, system_.exit, system_.entry + swept_, system_.exit + swept_}) {
        const double t = wrap(edge - angle) / speed_;
        // Only those of one principal period; with even pitch the teeth are identical.
        if (t < period * (1.0 - 1e-12)) times.push_back(t);
      }
    }
    // A kink of the surface acts again one delay later, which for uneven pitch is another time within the
    // period.
    if (!system_.evenPitch()) {
      const std::vector<double> first = times;
      for (const double t : first) {
        for (const double delay : delays_) times.push_back(std::fmod(t + delay, period));
      }
    }
    return times;
  }

  void operator()(double t, double inside, Feedback& feedback) const {
    feedback.clear(delays_.size());
    for (std::size_t k = 0; k < angle_.size(); ++k) {
      const double middle = wrap(angle_[k] + speed_ * inside);
      const double angle = middle + speed_ * (t - inside);
      if (swept_ < NO_SWEEP) {
        add(feedback, k, angle, middle);
        // An arc beyond a full revolution contains angle + 2 pi too.
        if (system_.exit > TWO_PI) add(feedback, k, angle + TWO_PI, middle + TWO_PI);
        continue;
      }
      // The edge covers the angles from angle - swept to angle.
      for (double turn = 0.0; angle + turn - swept_ < system_.exit; turn += TWO_PI) {
        const double high = std::min(angle + turn, system_.exit);
        const double low = std::max(angle + turn - swept_, system_.entry);
        if (high > low) addBetween(feedback, k, low, high);
      }
    }
  }

 private:
  void addStiffness(Feedback& feedback, std::size_t k, const Eigen::Matrix2d& stiffness) const {
    feedback.now += stiffness;
    feedback.delayed[delay_[k]] -= system_.overlap * stiffness;
  }

  void add(Feedback& feedback, std::size_t k, double angle, double middle) const {
    if (middle <= system_.entry || middle >= system_.exit) return;
    addStiffness(feedback, k, depth_ * stiffnessAt(system_, angle));
    if (damps_) feedback.velocity += depth_ * directional(tangential_damping_, radial_damping_, angle);
  }

  /// Integrals of the stiffness from the entry to evenly spaced angles.
  void sumAlongArc() {
    const double step = (system_.exit - system_.entry) / ARC_PARTS;
    arc_.assign(1, Eigen::Matrix2d::Zero());
    for (int i = 0; i < ARC_PARTS; ++i)
      arc_.push_back(arc_.back() + step * stiffnessAt(system_, system_.entry + (i + 0.5) * step));
  }

  Eigen::Matrix2d arcUpTo(double angle) const {
    const double position =
        std::clamp((angle - system_.entry) / (system_.exit - system_.entry), 0.0, 1.0) * ARC_PARTS;
    const auto part = std::min(static_cast<std::size_t>(position), arc_.size() - 2);
    const double share = position - static_cast<double>(part);
    return (1.0 - share) * arc_[part] + share * arc_[part + 1];
  }

  void addBetween(Feedback& feedback, std::size_t k, double low, double high) const {
    const auto integral = [&](double tangential, double radial) -> Eigen::Matrix2d {
      return (depth_ / swept_) *
             (directionalIntegral(tangential, radial, high) - directionalIntegral(tangential, radial, low));
    };
    addStiffness(
        feedback, k,
        arc_.empty() ? integral(system_.kt, system_.kr) : depth_ / swept_ * (arcUpTo(high) - arcUpTo(low)));
    if (damps_) feedback.velocity += integral(tangential_damping_, radial_damping_);
  }

  RegenerativeSystem system_;
  double speed_, depth_ = 0.0, swept_ = 0.0;
  bool damps_ = false;
  double tangential_damping_ = 0.0, radial_damping_ = 0.0;
  std::vector<double> angle_, delays_;
  std::vector<std::size_t> delay_;
  std::vector<Eigen::Matrix2d> arc_;
};

/// The same for edges of any shape. The feedback is integrated over the height by Gauss quadrature between
/// the exact ends of an edge in the arc, over kappa in the corner, where it is smooth.
class ShapedTeeth {
 public:
  ShapedTeeth(const RegenerativeSystem& system, double speed, double depth)
      : system_(system), tool_(system.tool()), speed_(speed) {
    corner_ = std::min(depth, cornerHeight(tool_));
    if (corner_ > 0.0) bands_.push_back({0.0, corner_, true, {}});
    // The delay is that of the middle of a slice.
    if (!system.edge.helix.empty()) {
      bands_.clear();
      for (const EdgeSlice& slice : edgeSlices(tool_, depth)) {
        const double top = std::min(slice.high, depth);
        if (top > slice.low) bands_.push_back({slice.low, top, slice.curved, {}});
      }
    }
    if (bands_.empty() || bands_.back().high < depth) bands_.push_back({corner_, depth, false, {}});
    ends_ = {0.0};
    if (corner_ > 0.0 && corner_ < depth) ends_.push_back(corner_);
    ends_.push_back(depth);
    for (int k = 0; k < system.teeth; ++k) {
      angle_.push_back(tool_.toothAngle(k));
      lag_.push_back(tool_.lagOf(k));
      for (Band& band : bands_)
        band.delay.push_back(delayIndex(tool_.pitchAt(k, 0.5 * (band.low + band.high)) / speed));
    }
  }

  const std::vector<double>& delays() const { return delays_; }

  std::vector<double> breaks(double period) const {
    std::vector<double> times;
    for (std::size_t k = 0; k < angle_.size(); ++k) {
      for (const double edge : {system_.entry, system_.exit}) {
        for (const double height : ends_) {
          const double t = wrap(edge - angle_[k] + lag_[k] * height) / speed_;
          if (t < period * (1.0 - 1e-12)) times.push_back(t);
        }
      }
    }
    return times;
  }

  void operator()(double t, double inside, Feedback& feedback) const {
    feedback.clear(delays_.size());
    for (std::size_t k = 0; k < angle_.size(); ++k) {
      const double middle = wrap(angle_[k] + speed_ * inside);
      const double angle = middle + speed_ * (t - inside);
      for (const Band& band : bands_) {
        const double swept = lag_[k] * (band.high - band.low), top = angle - lag_[k] * band.low;
        if (swept < NO_SWEEP) {
          // An arc beyond a full revolution contains angle + 2 pi too.
          for (const double turn : {0.0, TWO_PI}) {
            const double at = middle - lag_[k] * band.low + turn;
            if (at > system_.entry && at < system_.exit)
              addBand(feedback, k, band, angle + turn, band.low, band.high);
          }
          continue;
        }
        // The band covers the angles from top - swept to top.
        for (double turn = -TWO_PI * std::floor(top / TWO_PI); top + turn - swept < system_.exit;
             turn += TWO_PI) {
          const double low = std::max(band.low, (angle + turn - system_.exit) / lag_[k]);
          const double high = std::min(band.high, (angle + turn - system_.entry) / lag_[k]);
          if (high > low) addBand(feedback, k, band, angle + turn, low, high);
        }
      }
    }
  }

 private:
  struct Band {
    double low, high;  // [m]
    bool curved;
    std::vector<std::size_t> delay;  // of each tooth
  };

  std::size_t delayIndex(double delay) {
    std::size_t d = 0;
    while (d < delays_.size() && std::abs(delays_[d] - delay) > 1e-9 * delay) ++d;
    if (d == delays_.size()) delays_.push_back(delay);
    return d;
  }

  /// Adds the edge of tooth k between two heights of a band, its tip at an angle.
  void addBand(Feedback& feedback, std::size_t k, const Band& band, double angle, double low,
               double high) const {
    const double radius = tool_.edge.corner_radius;
    const auto lean = [radius](double z) { return std::acos(std::clamp(1.0 - z / radius, -1.0, 1.0)); };
    // Over kappa in the corner (dz = r sin(kappa) dkappa), over z above it.
    const double from = band.curved ? lean(low) : low, to = band.curved ? lean(high) : high;
    const double range = std::max(lag_[k] * (high - low), band.curved ? to - from : 0.0);
    const int parts = std::max(1, static_cast<int>(std::ceil(range / GAUSS_RANGE)));
    const double half = 0.5 * (to - from) / parts;
    for (int p = 0; p < parts; ++p) {
      for (const auto& [x, w] : EDGE_GAUSS) {
        const double at = from + (2 * p + 1 + x) * half;
        const double kappa = band.curved ? at : tool_.edge.edge_angle;
        const double sine = std::sin(kappa), cosine = std::cos(kappa);
        const double z = band.curved ? radius * (1.0 - cosine) : at;
        const double height = w * half * (band.curved ? radius * sine : 1.0);
        const double phi = angle - lag_[k] * z;
        const Eigen::Matrix2d stiffness =
            height * directional(system_.kt, system_.kr * sine - system_.ka * cosine, phi);
        feedback.now += stiffness;
        feedback.delayed[band.delay[k]] -= system_.overlap * stiffness;
        if (!system_.hasProcessDamping()) continue;
        const double speed = speed_ * localRadius(kappa, z);
        feedback.velocity += height * directional(system_.damping_tangential / speed,
                                                  system_.damping_radial * sine / speed, phi);
      }
    }
  }

  /// [m] Of the edge at a height.
  double localRadius(double kappa, double z) const {
    const EdgeShape& edge = tool_.edge;
    if (z < corner_)
      return tool_.radius() - edge.corner_radius * (std::tan(0.5 * edge.edge_angle) - std::sin(kappa));
    return tool_.radius() + (edge.edge_angle < 0.5 * PI ? z / std::tan(edge.edge_angle) : 0.0);
  }

  static constexpr double GAUSS_RANGE = 1.0;  // [rad] of four Gauss points: error of sines 1e-9
  static constexpr std::array<std::array<double, 2>, 4> EDGE_GAUSS{
      {{{-0.8611363115940526, 0.3478548451374538}},
       {{-0.3399810435848563, 0.6521451548625461}},
       {{0.3399810435848563, 0.6521451548625461}},
       {{0.8611363115940526, 0.3478548451374538}}}};

  RegenerativeSystem system_;
  ToolGeometry tool_;
  double speed_, corner_ = 0.0;
  std::vector<Band> bands_;
  std::vector<double> ends_;  // [m] heights where the edge or its curvature ends
  std::vector<double> angle_, lag_, delays_;
};

}  // namespace

void RegenerativeSystem::setProcessDamping(double coefficient) {
  damping_radial = coefficient;
  damping_tangential = TANGENTIAL_DAMPING * coefficient;
}

void RegenerativeSystem::validate() const {
  for (const SystemMode& mode : modes) {
    require("mode frequency [Hz]", mode.frequency, Range::positive());
    require("mode damping ratio", mode.damping_ratio, Range::open(0.0, 1.0));
    for (const double v : {mode.input[0], mode.input[1], mode.output[0], mode.output[1]})
      require("mode vector", v, Range{});
  }
  require("entry angle [rad]", entry, Range::notNegative());
  require("tangential coefficient [N/m2]", kt, Range::notNegative());
  require("radial coefficient [N/m2]", kr, Range::notNegative());
  require(kt + kr > 0.0, "tangential and radial coefficient [N/m2]", kt + kr, "above 0");
  require("tangential process damping [N/m]", damping_tangential, Range::notNegative());
  require("radial process damping [N/m]", damping_radial, Range::notNegative());
  require("overlap", overlap, Range::closed(0.0, 1.0));
  const bool needs_diameter = helix > 0.0 || hasProcessDamping();
  require(diameter > 0.0 || !needs_diameter, "diameter [m]", diameter, "above 0");
  if (variation) variation->validate();
  if (chip && variation) throw Error("chip geometry with a speed variation: expected only one of them");
  if (chip && along_arc)
    throw Error("chip geometry with coefficients along the arc: expected only one of them");
  if (chip) {
    if (cut != Cut::milling) throw Error("chip geometry in turning: expected milling");
    require("feed per tooth [m]", chip->feed, Range::positive());
    require(chip->radius_offset.empty() || static_cast<int>(chip->radius_offset.size()) == teeth,
            "number of radius offsets", static_cast<double>(chip->radius_offset.size()),
            "one for each tooth");
    require("tangential edge force [N/m]", chip->kte, Range::notNegative());
    require("radial edge force [N/m]", chip->kre, Range::notNegative());
    require(exit <= TWO_PI + 1e-9, "exit angle with a chip geometry [rad]", exit, "at most 2 pi");
  }
  if (!edge.straight()) {
    if (cut != Cut::milling) throw Error("edge shape in turning: expected milling");
    if (along_arc) requireStraightEdge(tool(), "for coefficients along the arc");
    if (edge.serrated() && !chip)
      throw Error("serrated edge: expected a chip geometry (the feed determines which teeth cut)");
    if (edge.inclined()) require("axial coefficient [N/m2]", ka, Range::notNegative());
    if (edge.inclined() || !edge.helix.empty()) require("diameter [m]", diameter, Range::positive());
    smartmill::validate(edge, tool());
  }
  if (cut == Cut::turning) {
    require(teeth == 1, "number of teeth in turning", teeth, "1");
    require(helix == 0.0, "helix in turning [rad]", helix, "0");
    return;
  }
  require("number of teeth", teeth, Range::closed(1, 20));
  require("exit angle [rad]", exit, Range::openLow(entry, entry + TWO_PI + 1e-9));
  require("helix [rad]", helix, Range::openHigh(0.0, 80.0 * PI / 180.0));
  if (!pitch.empty()) {
    require(static_cast<int>(pitch.size()) == teeth, "number of pitches", static_cast<double>(pitch.size()),
            "one for each tooth");
    double sum = 0.0;
    for (const double p : pitch) {
      require("pitch [rad]", p, Range::positive());
      sum += p;
    }
    require(std::abs(sum - TWO_PI) < 1e-6, "sum of the pitches [rad]", sum, "2 pi");
  }
}

ToolGeometry RegenerativeSystem::tool() const {
  return {teeth, diameter, helix, pitch, edge};
}

double RegenerativeSystem::meanRadial(double depth) const {
  if (!edge.inclined()) return kr;
  const double corner = std::min(depth, cornerHeight(tool()));
  double sine = 0.0, cosine = 0.0;  // [m] integrals over the height
  if (corner > 0.0) {
    EdgeSlice whole;
    whole.curved = true;
    const EdgeSlice slice = between(0.0, corner, whole, tool());
    sine = corner * slice.chip_radial;
    cosine = corner * slice.chip_axial;
  }
  sine += (depth - corner) * std::sin(edge.edge_angle);
  if (edge.edge_angle < 0.5 * PI) cosine += (depth - corner) * std::cos(edge.edge_angle);
  return (kr * sine - ka * cosine) / depth;
}

RegenerativeSystem RegenerativeSystem::straightened(double depth) const {
  RegenerativeSystem straight = *this;
  straight.kr = meanRadial(depth);
  straight.edge = {};
  return straight;
}

bool RegenerativeSystem::evenPitch() const {
  if (!edge.helix.empty() &&
      std::any_of(edge.helix.begin(), edge.helix.end(), [&](double h) { return h != edge.helix.front(); }))
    return false;
  return std::all_of(pitch.begin(), pitch.end(),
                     [&](double p) { return std::abs(p * teeth / TWO_PI - 1.0) < 1e-9; });
}

double RegenerativeSystem::pitchOf(int tooth) const {
  return pitch.empty() ? TWO_PI / teeth : pitch[static_cast<std::size_t>(tooth)];
}

std::vector<SystemMode> systemModes(const ModalModel& model, int axis) {
  std::vector<SystemMode> modes;
  const auto add = [&](double frequency, double damping, double gain) {
    if (gain == 0.0) return;
    // gain w^2 / (w^2 - ...) = output input / (w^2 - ...); the output carries the sign of the gain.
    const double size = units::TWO_PI * frequency * std::sqrt(std::abs(gain));
    SystemMode mode{frequency, damping, {{0.0, 0.0}}, {{0.0, 0.0}}};
    mode.input[static_cast<std::size_t>(axis)] = size;
    mode.output[static_cast<std::size_t>(axis)] = std::copysign(size, gain);
    modes.push_back(mode);
  };
  double highest = 0.0;
  for (const Mode& mode : model.modes) {
    highest = std::max(highest, mode.frequency);
    add(mode.frequency, mode.damping_ratio, mode.gain);
  }
  constexpr double ABOVE = 4.0, DAMPING = 0.5;
  if (highest > 0.0) add(ABOVE * highest, DAMPING, model.direct);
  return modes;
}

std::vector<SystemMode> systemModes(const ModalModel& x, const ModalModel& y) {
  std::vector<SystemMode> modes = systemModes(x, 0);
  const std::vector<SystemMode> other = systemModes(y, 1);
  modes.insert(modes.end(), other.begin(), other.end());
  return modes;
}

std::array<std::complex<double>, 4> receptance(const std::vector<SystemMode>& modes, double f) {
  std::array<std::complex<double>, 4> g{};
  const double w = TWO_PI * f;
  for (const SystemMode& mode : modes) {
    const double wn = TWO_PI * mode.frequency;
    const std::complex<double> h =
        1.0 / std::complex<double>(wn * wn - w * w, 2.0 * mode.damping_ratio * wn * w);
    for (std::size_t i = 0; i < 2; ++i)
      for (std::size_t j = 0; j < 2; ++j) g[2 * i + j] += mode.output[i] * mode.input[j] * h;
  }
  return g;
}

namespace {

/// At constant speed.
DelayedSystem steadySystem(const RegenerativeSystem& system, double speed, double depth) {
  DelayedSystem delayed;
  delayed.modes = system.modes;
  delayed.stiffness =
      depth * std::hypot(system.kt, system.edge.inclined() ? std::hypot(system.kr, system.ka) : system.kr);
  if (system.cut == Cut::turning) {
    delayed.period = TWO_PI / speed;
    delayed.delays = {delayed.period};
    const Eigen::Matrix2d stiffness = depth * stiffnessAt(system, system.entry);
    Eigen::Matrix2d damping = Eigen::Matrix2d::Zero();
    if (system.diameter > 0.0)
      damping = depth / (0.5 * speed * system.diameter) *
                directional(system.damping_tangential, system.damping_radial, system.entry);
    const double overlap = system.overlap;
    delayed.feedback = [stiffness, damping, overlap](double, double, Feedback& feedback) {
      feedback.now = stiffness;
      feedback.velocity = damping;
      feedback.delayed.assign(1, -overlap * stiffness);
    };
    return delayed;
  }
  if (system.chip && depth > 0.0) return contactSystem(system, speed, depth);
  delayed.period = TWO_PI / speed / (system.evenPitch() ? system.teeth : 1);
  delayed.rate = 2.0 * speed;
  const auto use = [&](const auto& teeth) {
    delayed.delays = teeth.delays();
    delayed.breaks = teeth.breaks(delayed.period);
    delayed.feedback = teeth;
  };
  if (system.edge.straight()) {
    use(Teeth(system, speed, depth));
  } else {
    use(ShapedTeeth(system, speed, depth));
  }
  return delayed;
}

}  // namespace

DelayedSystem delayedSystem(const RegenerativeSystem& system, double speed, double depth) {
  require("spindle speed [rad/s]", speed, Range::positive());
  require("depth [m]", depth, Range::notNegative());
  const DelayedSystem steady = steadySystem(system, speed, depth);
  return system.variation ? withSpeedVariation(steady, *system.variation, speed) : steady;
}

}  // namespace smartmill::stability
