#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "smartmill_core/math/angle.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_core/units.h"
#include "smartmill_hammer/search/flute_search.h"
#include "smartmill_hammer/sequence/hammer_sequence.h"

namespace smartmill::hammer {

/// Gap [m] between sensor and a cutter of N flutes, closed form: zero retreat at a flute, floor of depth
/// between flutes, flanks of different width on the rake and on the relief side.
struct FluteProfile {
  int teeth = 4;
  std::vector<double> tooth_angle;  // [rad] of each tooth against tooth 0
  double depth = 1e-3;              // [m]
  double front = 0.3, back = 0.3;   // [rad] flank widths

  static FluteProfile even(int teeth, double depth, double front, double back) {
    FluteProfile p{teeth, {}, depth, front, back};
    for (int k = 0; k < teeth; ++k) p.tooth_angle.push_back(units::TWO_PI * k / teeth);
    return p;
  }
  /// Retreat [m] of the surface that faces `facing`, spindle at `spindle`, edges lagging by `lag`.
  double retreat(double spindle, double lag, double facing) const {
    double least = depth;
    for (const double t : tooth_angle) {
      const double off = nearAngle(spindle + t - lag - facing, 0.0);
      const double width = off > 0.0 ? front : back;
      least = std::min(least, depth * (1.0 - std::exp(-off * off / (width * width))));
    }
    return least;
  }
};

/// A machine with a hammer station: spindle and axes move at constant speed after a latency, the capacitive
/// sensor is V = gain (g0 / gap - 1), the hammer's force is a half sine, the tool responds by its modes.
class ClosedFormMachine {
 public:
  MachineModel model;
  FluteProfile profile;
  ModalModel tip[2];          // truth: direct receptance at the tip [m/N]
  double mounting = 0.3;      // [rad] of the cutter in the spindle, unknown to the sequence
  double station_turn = 0.0;  // [rad] of the station about z
  double force_noise = 0.2, volt_noise = 0.002;
  double peak = 200.0, contact = 0.4e-3;
  double pivot = 0.25;  // [m] above the tip, about which the tool rotates
  double latency = 0.05;
  double time = 1000.0;
  bool tool_present = true;
  std::function<void(ClosedFormMachine&)> each_block;  // a fault to inject
  bool double_hit = false, no_hammer = false, nan_sample = false, alarm = false, armed = true,
       connected = true;
  std::vector<Command> commands;
  Axes3 position{{0.0, 0.0, 0.15}};
  double spindle = 0.7, spindle_speed = 0.0;
  double closest = 1.0;  // [m] smallest gap so far
  /// [m] standard deviation of a distance moved, which the axes do not display.
  double position_noise = 0.0;
  int strikes = 0;

  explicit ClosedFormMachine(std::uint32_t seed) : random(seed) {
    ToolGeometry tool;
    tool.teeth = 4;
    tool.diameter = 19.05e-3;
    tool.helix = units::radFromDeg(30.0);
    model.tool = tool;
    model.stickout = 51e-3;
    HammerStation h;
    h.offset = 15e-3;
    h.gap_at_zero_volt = 250e-6;
    h.gain_volt = h.range_volt = 10.0;
    h.flute_depth = 1e-3;
    h.position["x"] = {0.3, 0.1, 0.05};
    h.position["y"] = {0.25, 0.2, 0.05};
    model.hammer = h;
    profile = FluteProfile::even(4, 1e-3, 0.25, 0.35);
    tip[0].modes = {{1210.0, 0.031, 1.0 / 28e6}, {2300.0, 0.02, 1.0 / 60e6}};
    tip[1].modes = {{1180.0, 0.029, 1.0 / 31e6}, {2150.0, 0.025, 1.0 / 55e6}};
  }

  void obey(const Command& c) {
    commands.push_back(c);
    const double begin = time + latency;
    switch (c.kind) {
      case Command::Kind::orient:
        orient_from = begin;
        orient_to = c.angle;
        orienting = true;
        break;
      case Command::Kind::jog: {
        Axes3 to = path.empty() ? position : path.back().position;
        to[static_cast<std::size_t>(c.axis[0] - 'x')] += c.distance;
        path.push_back({to, c.feed});
        path_from = begin;
        break;
      }
      case Command::Kind::move:
        for (Waypoint w : c.path) {
          if (w.feed == 0.0) w.feed = 0.5;
          path.push_back(w);
        }
        path_from = begin;
        break;
      case Command::Kind::strike:
        if (!no_hammer) hit_at = begin;
        ++strikes;
        break;
      case Command::Kind::stop:
        path.clear();
        orienting = false;
        spindle_speed = 0.0;
        break;
    }
  }

  bool at(const std::string& direction) const {
    const Axes3 p = alongStation(model.hammer->position.at(direction)), here = alongStation(position);
    const std::size_t d = direction == "x" ? 0 : 1;
    // In front of the sensor, not next to it or above it.
    return tool_present && std::abs(here[1 - d] - p[1 - d]) < 2e-3 && std::abs(here[2] - p[2]) < 0.03 &&
           p[d] - here[d] < 4e-3;
  }

  bool still() const { return path.empty() && !orienting; }

  /// The next 10 ms of all streams.
  void block(SampleBlock& samples, SpindleAngle& angle, CncState& state) {
    if (each_block) each_block(*this);
    const HammerStation& h = *model.hammer;
    const std::size_t n = 256;
    const double rate = 25600.0;
    samples = SampleBlock();
    samples.stamp = std::round(time * 1e9) * 1e-9;
    samples.sample_rate = rate;
    samples.first_index = index;
    samples.channels = {"hammer", "gap"};
    samples.units = {"N", "V"};
    const int dir = at("x") ? 0 : at("y") ? 1 : -1;
    std::normal_distribution<double> normal;
    double middle = 0.0, retreat = 0.0;  // [m] parts of the gap; the tool moves between the blocks
    if (dir >= 0) {
      const Axes3& place = h.position.at(dir == 0 ? "x" : "y");
      const double height = place[2] - position[2];
      if (filter_direction != dir || (path.empty() && std::abs(filter_height - height) > 1e-7)) {
        filter_direction = dir;
        filter_height = height;
        filter.clear();
        filter.emplace_back(crossModel(dir, height), rate * SUB, Hold::first_order);
        filter[0].reset();
      }
      const auto d = static_cast<std::size_t>(dir);
      const double facing = (dir == 0 ? 0.5 * units::PI : 0.0) - station_turn;
      middle =
          alongStation(place)[d] + 2.0 * h.gap_at_zero_volt - alongStation(position)[d] - hidden_offset[d];
      retreat = profile.retreat(spindle + mounting, model.tool->lag() * height, facing);
    }
    for (std::size_t i = 0; i < n; ++i) {
      const double t = time + static_cast<double>(i) / rate;
      double away = 0.0;
      if (dir >= 0 && hit_at > 0.0) {
        for (int s = SUB - 1; s >= 0; --s) away = filter[0].step(forceAt(t - s / (rate * SUB)));
      }
      const double force = forceAt(t);
      double volt = -h.range_volt;
      if (dir >= 0) {
        const double gap = middle + away + retreat;
        closest = std::min(closest, gap);
        volt = gap > 0.0 ? h.gain_volt * (h.gap_at_zero_volt / gap - 1.0) : h.range_volt;
      }
      volt = std::clamp(volt + volt_noise * normal(random), -h.range_volt, h.range_volt);
      samples.samples.push_back(force + force_noise * normal(random));
      samples.samples.push_back(nan_sample && i == 7 ? NOT_A_NUMBER : volt);
    }
    nan_sample = false;
    index += n;
    time += n / rate;
    moveOn(n / rate);
    angle = {std::round(time * 1e9) * 1e-9, spindle - units::TWO_PI * std::floor(spindle / units::TWO_PI),
             spindle_speed};
    state = CncState();
    state.stamp = angle.stamp;
    state.connected = connected;
    state.armed = armed;
    state.mode = CncMode::dnc;
    state.alarm = alarm;
    if (alarm) state.alarm_text = "SV0417";
    state.motion = !path.empty();
    state.axes = {"X", "Y", "Z"};
    for (std::size_t i = 0; i < 3; ++i) {
      state.position.push_back(std::round(position[i] * 1e7) * 1e-7);
      state.distance_to_go.push_back(path.empty() ? 0.0 : std::abs(path.front().position[i] - position[i]));
    }
  }

  /// FRF from the hammer to the sensor, the latter at a height [m] above the tip: a rigid tool that rotates
  /// about a point far above.
  ModalModel crossModel(int dir, double height) const {
    const auto share = [&](double h) { return 1.0 - h / pivot; };
    ModalModel m = tip[dir];
    for (Mode& mode : m.modes) mode.gain *= share(height) * share(height + model.hammer->offset);
    return m;
  }

  std::mt19937 random;

 private:
  static constexpr int SUB = 8;

  Axes3 alongStation(const Axes3& v) const {
    const double c = std::cos(station_turn), s = std::sin(station_turn);
    return {c * v[0] + s * v[1], c * v[1] - s * v[0], v[2]};
  }

  double forceAt(double t) const {
    double f = 0.0;
    for (int k = 0; k < (double_hit ? 2 : 1); ++k) {
      const double u = t - hit_at - 3e-3 * k;
      if (hit_at > 0.0 && u > 0.0 && u < contact)
        f += peak * (k ? 0.5 : 1.0) * std::sin(units::PI * u / contact);
    }
    return f;
  }

  void moveOn(double dt) {
    if (orienting && time >= orient_from) {
      const double rest = nearAngle(orient_to, spindle) - spindle, most = 12.0 * dt;
      if (std::abs(rest) <= most) {
        spindle = orient_to;
        spindle_speed = 0.0;
        orienting = false;
      } else {
        spindle += std::copysign(most, rest);
        spindle_speed = 12.0;
      }
    }
    if (path.empty() || time < path_from) return;
    double way = path.front().feed * dt;
    while (!path.empty() && way > 0.0) {
      const Axes3& to = path.front().position;
      double rest = 0.0;
      for (std::size_t i = 0; i < 3; ++i) rest = std::hypot(rest, to[i] - position[i]);
      if (rest <= way) {
        position = to;
        std::normal_distribution<double> normal;
        if (position_noise > 0.0) {
          for (double& u : hidden_offset) u += position_noise * normal(random);
        }
        way -= rest;
        path.pop_front();
      } else {
        for (std::size_t i = 0; i < 3; ++i) position[i] += (to[i] - position[i]) * way / rest;
        way = 0.0;
      }
    }
  }

  std::uint64_t index = 5000;
  std::vector<ModalFilter> filter;
  int filter_direction = -1;
  double filter_height = 0.0;  // [m]
  std::deque<Waypoint> path;
  Axes3 hidden_offset{};  // [m] beyond the displayed position
  double path_from = 0.0, orient_from = 0.0, orient_to = 0.0, hit_at = -1.0;
  bool orienting = false;
};

}  // namespace smartmill::hammer
