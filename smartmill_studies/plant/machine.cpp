#include "plant/machine.h"

#include <algorithm>
#include <cmath>
#include <deque>

#include "plant/front.h"
#include "plant/oscillator.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::plant {
namespace {

using Random = std::mt19937_64;
using Channels = std::array<double, 4>;  // fx, fy, fz [N], load meter [V]

constexpr std::size_t LOAD = 3;

std::size_t channelNumber(const std::string& name) {
  const std::vector<std::string> names{"fx", "fy", "fz", "load_meter"};
  const auto at = std::find(names.begin(), names.end(), name);
  if (at == names.end()) throw Error("plant: no channel '" + name + "'");
  return static_cast<std::size_t>(at - names.begin());
}

/// The hidden effects of one plant, by name and key.
class Hidden {
 public:
  explicit Hidden(const Plant& plant) : plant_(plant) {}

  bool has(const std::string& name) const { return find(name) != nullptr; }
  /// 0 without the effect or the key
  double operator()(const std::string& name, const std::string& key) const {
    const EffectEntry* e = find(name);
    if (!e) return 0.0;
    const auto at = e->numbers.find(key);
    return at == e->numbers.end() ? 0.0 : at->second;
  }
  std::vector<double> list(const std::string& name, const std::string& key) const {
    const EffectEntry* e = find(name);
    return e && e->lists.count(key) ? e->lists.at(key) : std::vector<double>();
  }
  std::vector<const EffectEntry*> all(const std::string& name) const {
    std::vector<const EffectEntry*> found;
    for (const EffectEntry& e : plant_.effects) {
      if (e.name == name) found.push_back(&e);
    }
    return found;
  }

 private:
  const EffectEntry* find(const std::string& name) const {
    for (const EffectEntry& e : plant_.effects) {
      if (e.name == name) return &e;
    }
    return nullptr;
  }
  const Plant& plant_;
};

bool isOutside(const Plant& plant, const std::string& kind) {
  return plant.outside && plant.outside->kind == kind;
}

/// Where the teeth stand and how far they reach.
struct Teeth {
  std::vector<double> angle;   // [rad] against tooth 1
  std::vector<double> radius;  // [m]
  double lag = 0.0;            // [rad/m]
};

Teeth teethOf(const Plant& plant, const Hidden& hidden) {
  Teeth teeth;
  const int count = plant.tool.teeth;
  std::vector<double> pitch = plant.tool.pitch;
  if (pitch.empty()) pitch.assign(count, units::TWO_PI / count);
  const std::vector<double> uneven = hidden.list("uneven_pitch", "pitch_deg");
  for (std::size_t k = 0; k < uneven.size(); ++k) pitch[k] = units::radFromDeg(uneven[k]);
  const double radius = 0.5 * plant.tool.diameter;
  const std::vector<double> offsets = hidden.list("tooth_radius", "offset_um");
  double at = 0.0;
  for (int k = 0; k < count; ++k) {
    const double runout = units::UM * hidden("runout", "offset_um");
    teeth.angle.push_back(at);
    teeth.radius.push_back(radius + runout * std::cos(units::radFromDeg(hidden("runout", "angle_deg")) - at) +
                           (offsets.empty() ? 0.0 : units::UM * offsets[k]));
    at += pitch[k];
  }
  const double helix =
      hidden.has("helix") ? units::radFromDeg(hidden("helix", "helix_deg")) : plant.tool.helix;
  teeth.lag = std::tan(helix) / radius;
  return teeth;
}

/// From a chip to the forces on a length of edge.
class Law {
 public:
  Law(const Plant& plant, const Hidden& hidden, const CampaignTest& test)
      : plant_(plant),
        c_(plant.cutting),
        growth_(hidden("tool_wear", "edge_growth_per_min") / 60.0),
        cut_before_(test.cut_time_before.value_or(0.0)),
        exponent_(hidden("size_effect", "exponent")),
        reference_(units::UM * hidden("size_effect", "reference_chip_um")),
        buildup_(units::UM * hidden("edge_buildup", "chip_um")),
        damping_(units::N_PER_MM * hidden("process_damping", "coefficient_n_per_mm")) {
    c_.ktc += units::N_PER_MM2 * hidden("chip_coefficients", "Ktc_n_per_mm2");
    c_.krc += units::N_PER_MM2 * hidden("chip_coefficients", "Krc_n_per_mm2");
    c_.kac += units::N_PER_MM2 * hidden("chip_coefficients", "Kac_n_per_mm2");
    c_.kte += units::N_PER_MM * hidden("edge_forces", "Kte_n_per_mm");
    c_.kre += units::N_PER_MM * hidden("edge_forces", "Kre_n_per_mm");
    c_.kae += units::N_PER_MM * hidden("edge_forces", "Kae_n_per_mm");
    speed_ = test.spindle_speed * 0.5 * plant.tool.diameter;
    if (hidden.has("cutting_speed"))
      chip_factor_ = std::pow(speed_ / (units::M_PER_MIN * hidden("cutting_speed", "reference_m_per_min")),
                              -hidden("cutting_speed", "exponent"));
  }

  /// What holds at a time: unsteadiness [1] of the chip coefficients, time since engagement [s].
  void setTime(double unsteadiness, double in_cut) {
    now_ = chip_factor_ * (1.0 + unsteadiness);
    if (isOutside(plant_, "softer_with_time"))
      now_ *= 1.0 + plant_.outside->size * std::exp(-in_cut / plant_.outside->place);
    edge_ = 1.0 + growth_ * (cut_before_ + in_cut);
  }

  /// Tangential, radial, axial force [N/m] on an edge. @param chip [m] > 0 @param into [m/s] velocity into
  /// the work @param height [m] above the tip @param depth [m] of the cut
  std::array<double, 3> force(double chip, double into, double height, double depth) const {
    double specific = now_, edge = edge_;
    if (exponent_ != 0.0) specific *= std::pow(chip / reference_, -exponent_);
    if (buildup_ > 0.0) edge *= 1.0 - std::exp(-chip / buildup_);
    if (plant_.outside) {
      const Outside& o = *plant_.outside;
      if (o.kind == "kink" && chip > o.place)
        specific *= (o.place + (1.0 - o.size) * (chip - o.place)) / chip;
      if (o.kind == "hard_skin" && height > depth - o.place) specific *= 1.0 + o.size;
    }
    const double flank = damping_ * into / speed_;
    return {specific * c_.ktc * chip + edge * c_.kte + 0.3 * flank,
            specific * c_.krc * chip + edge * c_.kre + flank, specific * c_.kac * chip + edge * c_.kae};
  }

 private:
  const Plant& plant_;
  CuttingCoefficients c_;
  double growth_, cut_before_, exponent_, reference_, buildup_, damping_;
  double speed_ = 0.0, chip_factor_ = 1.0, now_ = 1.0, edge_ = 1.0;
};

/// Slices of the tool in the work.
class Cutting {
 public:
  struct Result {
    std::array<double, 3> force{};  // [N] on the tool
    double torque = 0.0;            // [N m]
  };

  Cutting(const Plant& plant, const Hidden& hidden, const CampaignTest& test, double slice, double step_angle)
      : plant_(plant),
        teeth_(teethOf(plant, hidden)),
        law_(plant, hidden, test),
        cut_(*test.engagement),
        slice_(slice) {
    depth_ = cut_.axial_depth;
    if (hidden.has("thermal_growth"))
      depth_ +=
          units::UM * hidden("thermal_growth", "growth_um") *
          (1.0 - std::exp(-test.start_time.value_or(0.0) / hidden("thermal_growth", "time_constant_s")));
    tilt_ = 1e-3 * hidden("depth_tilt", "slope_um_per_mm");
    slices_ = static_cast<std::size_t>(std::ceil((depth_ + std::abs(tilt_) * 0.02) / slice_));
    fronts_.assign(slices_, Front(0.5 * plant.tool.diameter, plant.tool.teeth, step_angle));
  }

  /// One step. @param axis of the tool [m] @param rate [m/s] of its vibration @param fed [m] since engagement
  Result step(double angle, const Point& axis, const Point& rate, double unsteadiness, double in_cut,
              double fed) {
    Result sum;
    const double depth = depth_ + tilt_ * fed, radius = 0.5 * plant_.tool.diameter;
    law_.setTime(unsteadiness, in_cut);
    for (std::size_t s = 0; s < slices_; ++s) {
      const double low = s * slice_, share = std::clamp((depth - low) / slice_, 0.0, 1.0);
      if (share <= 0.0) continue;
      const double height = low + 0.5 * share * slice_;
      for (std::size_t k = 0; k < teeth_.angle.size(); ++k) {
        if (k == 0 && isOutside(plant_, "lost_corner") && height < plant_.outside->place) continue;
        const double phi = angle + teeth_.angle[k] - teeth_.lag * height;
        const double sin = std::sin(phi), cos = std::cos(phi);
        const Point tip{axis.x + teeth_.radius[k] * sin, axis.y + teeth_.radius[k] * cos};
        const double chip = fronts_[s].pass(k, axis, tip);
        if (chip <= 0.0 || !inWork(tip, sin, radius)) continue;
        const auto [ft, fr, fa] = law_.force(chip, rate.x * sin + rate.y * cos, height, depth);
        const double length = share * slice_;
        sum.force[0] += (-ft * cos - fr * sin) * length;
        sum.force[1] += (ft * sin - fr * cos) * length;
        sum.force[2] += fa * length;
        sum.torque += ft * length * radius;
      }
    }
    return sum;
  }

 private:
  // The work reaches from R cos(exit) to R cos(entry) across the feed; a full slot has walls on both sides.
  bool inWork(const Point& tip, double sin, double radius) const {
    if (sin < 0.0) return false;
    const bool from_wall = cut_.entry <= 1e-9, to_wall = cut_.exit >= units::PI - 1e-9;
    return (from_wall || tip.y <= radius * std::cos(cut_.entry)) &&
           (to_wall || tip.y >= radius * std::cos(cut_.exit));
  }

  const Plant& plant_;
  Teeth teeth_;
  Law law_;
  Engagement cut_;
  double slice_, depth_ = 0.0, tilt_ = 0.0;
  std::size_t slices_ = 0;
  std::vector<Front> fronts_;
};

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
  /// At the next step's end if the force [N] stays.
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

/// From the force on the sensor to what its channels show.
class Sensor {
 public:
  Sensor(const Plant& plant, const Hidden& hidden, double rpm, double step) : direct_(plant.sensor_direct) {
    std::vector<SensorMode> modes = plant.sensor;
    for (const EffectEntry* e : hidden.all("extra_mode")) {
      const std::size_t a = e->words.at("axis") == "x" ? 0 : e->words.at("axis") == "y" ? 1 : 2;
      SensorMode extra;
      extra.frequency = e->numbers.at("frequency_hz");
      extra.damping_ratio = e->numbers.at("damping_ratio");
      extra.driven[a] = e->numbers.at("gain");
      extra.shown[a] = 1.0;
      modes.push_back(extra);
      direct_[a] -= extra.driven[a];
    }
    const double loaded = 1.0 / std::sqrt(1.0 + hidden("mass_loading", "mass_ratio"));
    const double softened = 1.0 - hidden("speed_dependent_mode", "softening_per_krpm") * rpm / 1000.0;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto main = std::find_if(modes.begin(), modes.end(),
                                     [&](const SensorMode& m) { return m.driven[a] * m.shown[a] > 0.3; });
      if (main != modes.end()) main->frequency *= loaded * softened;
    }
    for (const SensorMode& m : modes) modes_.emplace_back(Oscillator(m.frequency, m.damping_ratio, step), m);
  }

  void step(const std::array<double, 3>& force) {
    force_ = force;
    for (auto& [oscillator, mode] : modes_)
      oscillator.step(mode.driven[0] * force[0] + mode.driven[1] * force[1] + mode.driven[2] * force[2]);
  }
  std::array<double, 3> shown() const {
    std::array<double, 3> sum{};
    for (std::size_t a = 0; a < 3; ++a) {
      sum[a] = direct_[a] * force_[a];
      for (const auto& [oscillator, mode] : modes_) sum[a] += mode.shown[a] * oscillator.value();
    }
    return sum;
  }

 private:
  std::array<double, 3> direct_, force_{};
  std::vector<std::pair<Oscillator, SensorMode>> modes_;
};

/// Spindle's friction and the load meter [V].
class Drive {
 public:
  Drive(const Plant& plant, const Hidden& hidden, const CampaignTest& test, double step)
      : spindle_(*plant.spindle), speed_(test.spindle_speed) {
    friction_ = spindle_.viscous * speed_ + spindle_.coulomb;
    if (hidden.has("stribeck_friction"))
      friction_ +=
          hidden("stribeck_friction", "breakaway_nm") *
          std::exp(-std::pow(units::rpmFromRadPerSec(speed_) / hidden("stribeck_friction", "speed_rpm"), 2));
    if (hidden.has("friction_warmup"))
      friction_ *=
          1.0 + hidden("friction_warmup", "cold_ratio") *
                    std::exp(-test.start_time.value_or(0.0) / hidden("friction_warmup", "time_constant_s"));
    const double bandwidth = hidden.has("load_meter_lag") ? hidden("load_meter_lag", "bandwidth_hz")
                                                          : spindle_.load_meter_bandwidth;
    keep_ = std::exp(-units::TWO_PI * bandwidth * step);
    value_ = steady(0.0);
  }
  void step(double torque) { value_ = keep_ * value_ + (1.0 - keep_) * steady(torque); }
  double value() const { return value_; }

 private:
  double steady(double torque) const { return spindle_.load_meter_gain * (torque + friction_) * speed_; }
  Spindle spindle_;
  double speed_, friction_ = 0.0, keep_ = 0.0, value_ = 0.0;
};

/// What stands on a sensor besides the cut.
std::array<double, 3> disturbance(const Hidden& hidden, double angle, double speed) {
  std::array<double, 3> force{};
  const double unbalance = 1e-6 * hidden("unbalance", "mass_eccentricity_g_mm") * speed * speed;
  const double at = angle + units::radFromDeg(hidden("unbalance", "angle_deg"));
  force[0] += unbalance * std::sin(at);
  force[1] += unbalance * std::cos(at);
  if (speed == 0.0) return force;
  for (const EffectEntry* e : hidden.all("spindle_order")) {
    const char* axes[] = {"x", "y", "z"};
    for (std::size_t a = 0; a < 3; ++a)
      force[a] += e->numbers.at(std::string(axes[a]) + "_n") *
                  std::sin(e->numbers.at("order") * angle +
                           units::radFromDeg(e->numbers.at(std::string(axes[a]) + "_deg")));
  }
  return force;
}

/// Amplifiers, cables and the recorder: from the sensor to the file.
class Chain {
 public:
  Chain(const Plant& plant, const Hidden& hidden, double speed, double step, Random& random)
      : plant_(plant),
        hidden_(hidden),
        speed_(speed),
        step_(step),
        hum_phase_(std::uniform_real_distribution<double>(0, units::TWO_PI)(random)),
        own_phase_(std::uniform_real_distribution<double>(0, units::TWO_PI)(random)) {
    for (const EffectEntry* e : hidden.all("channel_delay")) {
      delay_[channelNumber(e->words.at("channel"))] += 1e-6 * e->numbers.at("delay_us");
      delayed_ = true;
    }
  }

  /// Every step: cross-talk and gains, which delays come after.
  void feed(Channels c) {
    Channels mixed = c;
    const char axes[] = {'x', 'y', 'z'};
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t b = 0; b < 3; ++b) {
        if (a != b) mixed[a] += hidden_("cross_talk", {axes[a], axes[b]}) * c[b];
      }
    }
    for (const EffectEntry* e : hidden_.all("gain_error"))
      mixed[channelNumber(e->words.at("channel"))] *= e->numbers.at("gain");
    late_.push_back(mixed);
    const std::size_t longest =
        static_cast<std::size_t>(*std::max_element(delay_.begin(), delay_.end()) / step_) + 3;
    while (late_.size() > longest) late_.pop_front();
  }

  /// What is written at this instant, without noise. @param angle [rad] of the spindle
  Channels shown(double time, double angle) const {
    Channels c = late_.back();
    if (delayed_) {
      for (std::size_t k = 0; k < c.size(); ++k) c[k] = lateValue(k);
    }
    c[0] += hidden_("charge_drift", "rate_n_per_min") / 60.0 * time;
    c[1] += hidden_("charge_drift", "y_ratio") * hidden_("charge_drift", "rate_n_per_min") / 60.0 * time;
    const double hum = hidden_("mains_hum", "amplitude_n") *
                       std::sin(units::TWO_PI * hidden_("mains_hum", "frequency_hz") * time + hum_phase_);
    c[0] += hum;
    c[1] += hidden_("mains_hum", "y_ratio") * hum;
    c[0] += hidden_("zero_offset", "x_n");
    c[1] += hidden_("zero_offset", "y_n");
    c[2] += hidden_("zero_offset", "z_n");
    if (plant_.outside) addOutside(*plant_.outside, time, angle, c);
    if (hidden_.has("saturation")) {
      const double limit = hidden_("saturation", "limit_n");
      for (std::size_t a = 0; a < 3; ++a) c[a] = std::clamp(c[a], -limit, limit);
    }
    return c;
  }

 private:
  double lateValue(std::size_t k) const {
    const double back = delay_[k] / step_;
    const std::size_t whole = static_cast<std::size_t>(back);
    const double part = back - static_cast<double>(whole);
    const auto at = [&](std::size_t n) { return late_[late_.size() - 1 - std::min(n, late_.size() - 1)][k]; };
    return (1.0 - part) * at(whole) + part * at(whole + 1);
  }

  void addOutside(const Outside& o, double time, double angle, Channels& c) const {
    if (o.channel.empty()) return;
    double& value = c[channelNumber(o.channel)];
    if (o.kind == "tone") value += o.size * std::sin(units::TWO_PI * o.place * time + own_phase_);
    if (o.kind == "half_order" && speed_ > 0.0) value += o.size * std::sin(0.5 * angle + own_phase_);
    if (o.kind == "settling") value += o.size * std::exp(-time / o.place);
    if (o.kind == "curve") value *= 1.0 + o.size * std::abs(value) / 1000.0;
    if (o.kind == "bursts") {
      const double since = std::fmod(time + o.place * own_phase_ / units::TWO_PI, o.place);
      value += o.size * std::exp(-since / 2e-3) * std::sin(units::TWO_PI * 1700.0 * since);
    }
  }

  const Plant& plant_;
  const Hidden& hidden_;
  double speed_, step_, hum_phase_, own_phase_;
  std::array<double, 4> delay_{};
  bool delayed_ = false;
  std::deque<Channels> late_;
};

/// White noise with a share of first-order noise below 300 Hz.
class Noise {
 public:
  Noise(double rms, double colour, double sample_rate)
      : white_(rms * std::sqrt(1.0 - colour)),
        keep_(std::exp(-units::TWO_PI * 300.0 / sample_rate)),
        drive_(rms * std::sqrt(colour * (1.0 - keep_ * keep_))) {}
  double operator()(Random& random) {
    low_ = keep_ * low_ + drive_ * normal_(random);
    return low_ + white_ * normal_(random);
  }

 private:
  double white_, keep_, drive_, low_ = 0.0;
  std::normal_distribution<double> normal_;
};

/// Angle of a spindle whose speed ripples, and how the chip coefficients scatter from turn to turn.
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
  /// [1] straight between the turns' own values
  double unsteadiness(double angle) const {
    const double turns = angle / units::TWO_PI + 1000.0;
    const std::size_t whole = static_cast<std::size_t>(turns);
    const double part = turns - static_cast<double>(whole);
    return (1.0 - part) * scatter_[whole % scatter_.size()] + part * scatter_[(whole + 1) % scatter_.size()];
  }

 private:
  double speed_, phase_, ripple_, ripple_speed_, ripple_phase_;
  std::array<double, 499> scatter_;
};

// A blow of a hammer: fast rise, slower fall, 0.8 ms.
double blow(double peak, double since) {
  const double share = since / 0.8e-3;
  return share <= 0.0 || share >= 1.0 ? 0.0 : peak * 6.75 * share * (1.0 - share) * (1.0 - share);
}

void requireKnown(const Plant& plant) {
  const std::vector<std::string> known{"runout",         "edge_forces",       "size_effect",
                                       "tool_wear",      "cutting_speed",     "uneven_pitch",
                                       "helix",          "tool_flexibility",  "process_damping",
                                       "extra_mode",     "mass_loading",      "speed_dependent_mode",
                                       "cross_talk",     "charge_drift",      "mains_hum",
                                       "unbalance",      "channel_delay",     "gain_error",
                                       "saturation",     "stribeck_friction", "friction_warmup",
                                       "load_meter_lag", "depth_tilt",        "feed_error",
                                       "tooth_radius",   "thermal_growth",    "chip_coefficients",
                                       "edge_buildup",   "spindle_order",     "zero_offset"};
  for (const EffectEntry& e : plant.effects) {
    if (std::find(known.begin(), known.end(), e.name) == known.end())
      throw Error("plant: effect '" + e.name + "' is unknown");
  }
}

}  // namespace

const std::vector<std::string>& outsideKinds() {
  static const std::vector<std::string> KINDS{"tone", "settling",         "half_order", "bursts",     "curve",
                                              "kink", "softer_with_time", "hard_skin",  "lost_corner"};
  return KINDS;
}

Plant plantOf(const MachineModel& model) {
  Plant p;
  p.tool = model.needTool("mill");
  p.cutting = model.needCutting("mill");
  for (const Mode& m : model.tool_tip.x.modes) p.tip[0].push_back({m.frequency, m.damping_ratio, m.gain});
  for (const Mode& m : model.tool_tip.y.modes) p.tip[1].push_back({m.frequency, m.damping_ratio, m.gain});
  for (std::size_t a = 0; a < 3; ++a) {
    p.sensor_direct[a] = model.force_sensor.axis[a].direct;
    for (const Mode& m : model.force_sensor.axis[a].modes) {
      SensorMode mode;
      mode.frequency = m.frequency;
      mode.damping_ratio = m.damping_ratio;
      mode.driven[a] = m.gain;
      mode.shown[a] = 1.0;
      p.sensor.push_back(mode);
    }
  }
  if (model.force_sensor.noise_rms) p.noise_rms = *model.force_sensor.noise_rms;
  p.spindle = model.spindle;
  p.effects = model.effects;
  return p;
}

std::size_t samplesOf(const CampaignTest& test) {
  const double seconds = test.kind == TestKind::tap   ? 0.12
                         : test.kind == TestKind::air ? 0.15
                         : test.spindle_speed < 200.0 ? 0.3
                                                      : 0.2;
  return static_cast<std::size_t>(seconds * test.sample_rate);
}

Record run(const Plant& plant, const CampaignTest& test, const RunOptions& options, Random& random) {
  requireKnown(plant);
  const Hidden hidden(plant);
  const double sample = 1.0 / test.sample_rate, step = sample / options.steps;
  const bool tap = test.kind == TestKind::tap, cut = test.kind == TestKind::cut;
  std::uniform_real_distribution<double> turn(0.0, units::TWO_PI);
  const Turning turning(test.spindle_speed, options.phase ? *options.phase : turn(random), plant.unsteadiness,
                        random);
  Sensor sensor(plant, hidden, units::rpmFromRadPerSec(test.spindle_speed), step);
  Tip tip(plant, hidden, step);
  Chain chain(plant, hidden, test.spindle_speed, step, random);
  std::optional<Drive> drive;
  if (plant.spindle && !tap) drive.emplace(plant, hidden, test, step);
  std::optional<Cutting> cutting;
  const double engage = test.engage_time.value_or(0.0);
  double feed = 0.0;
  std::array<double, 3> force{};
  if (cut) {
    cutting.emplace(plant, hidden, test, options.slice, test.spindle_speed * step);
    feed = test.engagement->feed_per_tooth * plant.tool.teeth * test.spindle_speed / units::TWO_PI *
           (hidden.has("feed_error") ? hidden("feed_error", "ratio") : 1.0);
    // The work as earlier revolutions of a tool at rest left it; its axis has come from behind.
    const double before = 10.0 * units::TWO_PI / test.spindle_speed;
    for (double t = engage - before; t < engage - 0.5 * step; t += step)
      cutting->step(turning.angle(t), {feed * (t - engage + before), 0.0}, {}, 0.0, 0.0, 0.0);
  }
  const double came =
      cut ? 10.0 * units::TWO_PI / test.spindle_speed * feed : 0.0;  // [m] of the axis at engagement
  const double peak = std::uniform_real_distribution<double>(150.0, 300.0)(random);
  const std::size_t struck = test.direction == "x" ? 0 : test.direction == "y" ? 1 : 2;
  std::array<Noise, 3> noise{Noise(plant.noise_rms[0], plant.unsteadiness.noise_colour, test.sample_rate),
                             Noise(plant.noise_rms[1], plant.unsteadiness.noise_colour, test.sample_rate),
                             Noise(plant.noise_rms[2], plant.unsteadiness.noise_colour, test.sample_rate)};
  std::normal_distribution<double> normal;
  const double loud = options.noise ? 1.0 : 0.0;

  const std::size_t samples = samplesOf(test);
  std::vector<double> angles, hammer, load, tip_x, tip_y;
  std::array<std::vector<double>, 3> shown_force;
  Record record;
  for (std::size_t i = 0; i < samples; ++i) {
    for (int s = 0; s < options.steps; ++s) {
      const double t = (static_cast<double>(i) + static_cast<double>(s) / options.steps) * sample;
      const double angle = tap ? 0.0 : turning.angle(t);
      Cutting::Result chip;
      if (cutting && t >= engage - 0.5 * step) {
        const Point at = tip.next(), rate = tip.nextRate();
        chip = cutting->step(angle, {came + feed * (t - engage) + at.x, at.y}, rate,
                             turning.unsteadiness(angle), t - engage, feed * (t - engage));
      }
      force = chip.force;
      tip.step(force);
      std::array<double, 3> on_sensor = force;
      const auto other = disturbance(hidden, angle, test.spindle_speed);
      for (std::size_t a = 0; a < 3; ++a) on_sensor[a] += other[a];
      if (tap) on_sensor[struck] += blow(peak, t - 5e-3);
      sensor.step(on_sensor);
      if (drive) drive->step(chip.torque);
      const auto f = sensor.shown();
      chain.feed({f[0], f[1], f[2], drive ? drive->value() : 0.0});
      if (s > 0) continue;
      const Channels c = chain.shown(t, angle);
      record.time.push_back(t);
      angles.push_back(std::fmod(angle + 8.0 * units::TWO_PI, units::TWO_PI));
      for (std::size_t a = 0; a < 3; ++a) shown_force[a].push_back(c[a] + loud * noise[a](random));
      hammer.push_back((tap ? blow(peak, t - 5e-3) : 0.0) + loud * 0.2 * normal(random));
      if (drive) {
        const double volt = c[LOAD] + loud * plant.load_meter_noise * normal(random),
                     bit = plant.spindle->load_meter_resolution;
        load.push_back(options.noise ? bit * std::round(volt / bit) : volt);
      }
      if (options.show_tip) {
        const Point at = tip.now();
        tip_x.push_back(at.x + loud * plant.tip_noise * normal(random));
        tip_y.push_back(at.y + loud * plant.tip_noise * normal(random));
      }
    }
  }
  if (!tap && options.show_angle) record.add("spindle_angle") = angles;
  record.add("fx") = shown_force[0];
  record.add("fy") = shown_force[1];
  record.add("fz") = shown_force[2];
  if (tap) record.add("hammer") = hammer;
  if (drive) record.add("load_meter") = load;
  if (options.show_tip && !tap) {
    record.add("tool_x") = tip_x;
    record.add("tool_y") = tip_y;
  }
  return record;
}

}  // namespace smartmill::plant
