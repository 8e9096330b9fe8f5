#include "plant/machine.h"

#include <algorithm>
#include <cmath>

#include "plant/cutting.h"
#include "plant/hidden.h"
#include "plant/measuring.h"
#include "plant/oscillator.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::plant {
namespace {

using Random = std::mt19937_64;

/// Modes of the tool tip along x and y.
class Tip {
 public:
  Tip(const Plant& plant, const Hidden& hidden, double step) {
    for (std::size_t a = 0; a < 2; ++a) {
      for (const PointMode& m : plant.tip[a]) add(a, m, step);
    }
    for (const EffectEntry* e : hidden.all("tool_flexibility")) {
      for (const Mode& m : e->flexibility.x.modes) add(0, {m.frequency, m.damping_ratio, m.gain}, step);
      for (const Mode& m : e->flexibility.y.modes) add(1, {m.frequency, m.damping_ratio, m.gain}, step);
    }
  }
  Point now() const {
    return sum([](const Oscillator& o, double) { return o.value(); });
  }
  /// At the end of the next step with constant force [N].
  Point next() const {
    return sum([](const Oscillator& o, double p) { return o.valueIf(p); });
  }
  Point nextRate() const {
    return sum([](const Oscillator& o, double p) { return o.rateIf(p); });
  }
  void step(const std::array<double, 3>& force) {
    force_ = force;
    for (std::size_t a = 0; a < 2; ++a) {
      for (auto& [mode, compliance] : axes_[a]) mode.step(compliance * force[a]);
    }
  }

 private:
  void add(std::size_t a, const PointMode& m, double step) {
    axes_[a].emplace_back(Oscillator(m.frequency, m.damping_ratio, step), m.compliance);
  }
  template <class What>
  Point sum(const What& what) const {
    std::array<double, 2> total{};
    for (std::size_t a = 0; a < 2; ++a) {
      for (const auto& [mode, compliance] : axes_[a]) total[a] += what(mode, compliance * force_[a]);
    }
    return {total[0], total[1]};
  }
  std::array<std::vector<std::pair<Oscillator, double>>, 2> axes_;
  std::array<double, 3> force_{};
};

/// Angle of a spindle with speed ripple, and scatter of the chip coefficients from revolution to revolution.
class Turning {
 public:
  Turning(double speed, double phase, const Unsteadiness& u, Random& random)
      : speed_(speed),
        phase_(phase),
        ripple_(u.speed_ripple),
        ripple_speed_(units::TWO_PI * std::uniform_real_distribution<double>(5.0, 15.0)(random)),
        ripple_phase_(std::uniform_real_distribution<double>(0.0, units::TWO_PI)(random)) {
    std::normal_distribution<double> normal(0.0, u.coefficient_scatter > 0.0 ? u.coefficient_scatter : 1.0);
    for (double& s : scatter_) s = u.coefficient_scatter > 0.0 ? normal(random) : 0.0;
  }
  double angle(double time) const {
    return phase_ +
           speed_ * (time - ripple_ / ripple_speed_ *
                                (std::cos(ripple_speed_ * time + ripple_phase_) - std::cos(ripple_phase_)));
  }
  /// [1] linear between the values of the revolutions
  double unsteadiness(double angle) const {
    const double turns = angle / units::TWO_PI + 1000.0;
    const std::size_t whole = static_cast<std::size_t>(turns);
    const double part = turns - static_cast<double>(whole);
    return (1.0 - part) * scatter_[whole % scatter_.size()] + part * scatter_[(whole + 1) % scatter_.size()];
  }

 private:
  double speed_, phase_, ripple_, ripple_speed_, ripple_phase_;
  std::array<double, 499> scatter_{};
};

// Force of a hammer hit: fast rise, slower fall, 0.8 ms.
double blow(double peak, double since) {
  const double share = since / 0.8e-3;
  return share <= 0.0 || share >= 1.0 ? 0.0 : peak * 6.75 * share * (1.0 - share) * (1.0 - share);
}

// Forward and back along each axis in turn, with rests between the strokes; jerk and its rate are continuous.
class AxisMoves {
 public:
  static constexpr double LENGTH = 0.8;  // [s]

  // [m]
  static double position(std::size_t axis, double t) { return STROKE * (way(axis, t, 0) - back(axis, t, 0)); }
  // [m/s2]
  static std::array<double, 3> acceleration(double t) {
    std::array<double, 3> now{};
    for (std::size_t a = 0; a < 3; ++a) now[a] = STROKE / (TIME * TIME) * (way(a, t, 2) - back(a, t, 2));
    return now;
  }

 private:
  static constexpr double STROKE = 12e-3, TIME = 0.1, REST = 0.02;  // [m], [s], [s]
  static double way(std::size_t axis, double t, int order) {
    return septic((t - REST - 2.0 * static_cast<double>(axis) * (TIME + REST)) / TIME, order);
  }
  static double back(std::size_t axis, double t, int order) { return way(axis, t - TIME - REST, order); }
  // From 0 at 0 to 1 at 1, or its second derivative.
  static double septic(double x, int order) {
    if (x <= 0.0) return 0.0;
    if (x >= 1.0) return order == 0 ? 1.0 : 0.0;
    const double x2 = x * x;
    return order == 0 ? x2 * x2 * (35.0 - 84.0 * x + 70.0 * x2 - 20.0 * x2 * x)
                      : x2 * (420.0 - 1680.0 * x + 2100.0 * x2 - 840.0 * x2 * x);
  }
};

/// One test from its first sample to its last.
class TestRun {
 public:
  TestRun(const Plant& plant, const CampaignTest& test, const RunOptions& options, Random& random)
      : plant_(plant),
        test_(test),
        options_(options),
        random_(random),
        hidden_(plant),
        step_(1.0 / (test.sample_rate * options.steps)),
        turning_(test.spindle_speed,
                 options.phase ? *options.phase
                               : std::uniform_real_distribution<double>(0.0, units::TWO_PI)(random),
                 plant.unsteadiness, random),
        sensor_(plant, hidden_, units::rpmFromRadPerSec(test.spindle_speed), step_),
        tip_(plant, hidden_, step_),
        disturbance_(hidden_, test.spindle_speed, random),
        chain_(plant, hidden_, test.start_time.value_or(0.0), test.spindle_speed, step_, random),
        peak_(std::uniform_real_distribution<double>(150.0, 300.0)(random)) {
    if (plant.spindle && turns()) drive_.emplace(plant, hidden_, test, step_);
    for (std::size_t a = 0; a < 3; ++a)
      noise_.emplace_back(plant.noise_rms[a], plant.unsteadiness.noise_colour, test.sample_rate);
    if (test.kind == TestKind::cut) prepareWork();
  }

  Record run() {
    const std::size_t samples = samplesOf(test_);
    for (std::size_t i = 0; i < samples; ++i) {
      for (int s = 0; s < options_.steps; ++s) {
        const double t =
            (static_cast<double>(i) + static_cast<double>(s) / options_.steps) / test_.sample_rate;
        step(t);
        if (s == 0) show(t);
      }
    }
    return record();
  }

 private:
  bool isTap() const { return test_.kind == TestKind::tap; }
  bool isMove() const { return test_.kind == TestKind::move; }
  bool turns() const { return !isTap() && !isMove(); }
  double angle(double t) const { return turns() ? turning_.angle(t) : 0.0; }
  double hammer(double t) const { return isTap() ? blow(peak_, t - 5e-3) : 0.0; }

  // The surface as left by earlier revolutions of a tool without vibration.
  void prepareWork() {
    cutting_.emplace(plant_, hidden_, test_, options_.slice, test_.spindle_speed * step_);
    engage_ = test_.engage_time.value_or(0.0);
    feed_ = test_.engagement->feed_per_tooth * plant_.tool.teeth * test_.spindle_speed / units::TWO_PI *
            (hidden_.has("feed_error") ? hidden_("feed_error", "ratio") : 1.0);
    const double before = 10.0 * units::TWO_PI / test_.spindle_speed;
    came_ = before * feed_;
    for (double t = engage_ - before; t < engage_ - 0.5 * step_; t += step_)
      cutting_->step(angle(t) + test_.feed_direction, {feed_ * (t - engage_) + came_, 0.0}, {}, 0.0, 0.0,
                     0.0);
  }

  // Between the axes of the machine and those of the cut, whose x is along the feed.
  Point turned(const Point& p, double by) const {
    const double c = std::cos(by), s = std::sin(by);
    return {c * p.x - s * p.y, s * p.x + c * p.y};
  }

  void step(double t) {
    Cutting::Result chip;
    if (cutting_ && t >= engage_ - 0.5 * step_) {
      const Point at = tip_.next();
      const double fed = feed_ * (t - engage_);
      const double direction = test_.feed_direction;
      const Point moved = turned(at, -direction);
      chip = cutting_->step(angle(t) + direction, {came_ + fed + moved.x, moved.y},
                            turned(tip_.nextRate(), -direction), turning_.unsteadiness(angle(t)), t - engage_,
                            fed);
      const Point force = turned({chip.force[0], chip.force[1]}, direction);
      chip.force[0] = force.x;
      chip.force[1] = force.y;
    }
    tip_.step(chip.force);
    std::array<double, 3> force =
        disturbance_.force(angle(t), isMove() ? AxisMoves::acceleration(t) : std::array<double, 3>{});
    for (std::size_t a = 0; a < 3; ++a) force[a] += chip.force[a];
    force[test_.direction == "y" ? 1 : test_.direction == "z" ? 2 : 0] += hammer(t);
    sensor_.step(force);
    if (drive_) drive_->step(chip.torque);
    const std::array<double, 3> output = sensor_.output();
    chain_.feed({output[0], output[1], output[2], drive_ ? drive_->value() : 0.0});
  }

  double normal(double rms) { return options_.noise ? rms * normal_(random_) : 0.0; }

  void show(double t) {
    const Channels c = chain_.output(t, angle(t));
    time_.push_back(t);
    angles_.push_back(std::fmod(angle(t), units::TWO_PI));
    for (std::size_t a = 0; a < 3; ++a)
      force_[a].push_back(c[a] + (options_.noise ? noise_[a](random_) : 0.0));
    hammer_.push_back(hammer(t) + normal(0.2));
    if (isMove()) {
      for (std::size_t a = 0; a < 3; ++a) axes_[a].push_back(AxisMoves::position(a, t));
    }
    if (drive_) {
      const double volt = c[LOAD] + normal(plant_.load_meter_noise),
                   bit = plant_.spindle->load_meter_resolution;
      load_.push_back(options_.noise ? bit * std::round(volt / bit) : volt);
    }
    if (options_.show_tip) {
      tip_x_.push_back(tip_.now().x + normal(plant_.tip_noise));
      tip_y_.push_back(tip_.now().y + normal(plant_.tip_noise));
    }
  }

  Record record() const {
    Record r;
    r.time = time_;
    if (turns() && options_.show_angle) r.add("spindle_angle") = angles_;
    r.add("fx") = force_[0];
    r.add("fy") = force_[1];
    r.add("fz") = force_[2];
    if (isTap()) r.add("hammer") = hammer_;
    if (isMove()) {
      for (std::size_t a = 0; a < 3; ++a) r.add(std::string("axis_") + "xyz"[a]) = axes_[a];
    }
    if (drive_) r.add("load_meter") = load_;
    if (options_.show_tip && turns()) {
      r.add("tool_x") = tip_x_;
      r.add("tool_y") = tip_y_;
    }
    return r;
  }

  const Plant& plant_;
  const CampaignTest& test_;
  const RunOptions& options_;
  Random& random_;
  Hidden hidden_;
  double step_;  // [s]
  Turning turning_;
  Sensor sensor_;
  Tip tip_;
  Disturbance disturbance_;
  Chain chain_;
  double peak_;  // [N] of the hammer
  std::optional<Drive> drive_;
  std::vector<Noise> noise_;
  std::normal_distribution<double> normal_;
  std::optional<Cutting> cutting_;
  double engage_ = 0.0, feed_ = 0.0, came_ = 0.0;  // [s], [m/s], [m] travel of the axis until engagement
  std::vector<double> time_, angles_, hammer_, load_, tip_x_, tip_y_;
  std::array<std::vector<double>, 3> force_, axes_;
};

}  // namespace

const std::vector<std::string>& outsideKinds() {
  static const std::vector<std::string> KINDS{"tone", "settling",         "half_order", "bursts",     "curve",
                                              "kink", "softer_with_time", "hard_skin",  "lost_corner"};
  return KINDS;
}

const std::vector<std::string>& requestedOutsideKinds() {
  static const std::vector<std::string> KINDS{"hard_spot",     "hardness_wave", "hardness_slope",
                                              "zero_drift",    "zero_approach", "zero_step",
                                              "zero_of_record"};
  return KINDS;
}

Plant plantOf(const MachineModel& model) {
  Plant p;
  p.tool = model.needTool("mill");
  ToolGeometry above_corner = p.tool;
  above_corner.edge.corner_radius = 0.0;
  requireStraightEdge(above_corner, "to mill");
  p.cutting = model.needCutting("mill");
  for (const Mode& m : model.tool_tip.x.modes) p.tip[0].push_back({m.frequency, m.damping_ratio, m.gain});
  for (const Mode& m : model.tool_tip.y.modes) p.tip[1].push_back({m.frequency, m.damping_ratio, m.gain});
  for (std::size_t a = 0; a < 3; ++a) {
    p.sensor_direct[a] = model.force_sensor.axis[a].direct;
    for (const Mode& m : model.force_sensor.axis[a].modes) {
      SensorMode mode;
      mode.frequency = m.frequency;
      mode.damping_ratio = m.damping_ratio;
      mode.input[a] = m.gain;
      mode.output[a] = 1.0;
      p.sensor.push_back(mode);
    }
  }
  if (model.force_sensor.noise_rms) p.noise_rms = *model.force_sensor.noise_rms;
  p.spindle = model.spindle;
  p.effects = model.effects;
  return p;
}

std::size_t samplesOf(const CampaignTest& test) {
  const double seconds = test.kind == TestKind::move  ? AxisMoves::LENGTH
                         : test.kind == TestKind::tap ? 0.12
                         : test.kind == TestKind::air ? 0.15
                         : test.spindle_speed < 200.0 ? 0.3
                                                      : 0.2;
  return static_cast<std::size_t>(seconds * test.sample_rate);
}

Record run(const Plant& plant, const CampaignTest& test, const RunOptions& options, Random& random) {
  return TestRun(plant, test, options, random).run();
}

}  // namespace smartmill::plant
