#pragma once

#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <vector>

#include "smartmill_core/cutting/force_curve.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

/// Independent time-domain simulation of milling with the surface left by previous teeth: the chip thickness
/// is not negative and teeth leave the cut. Modes along single axes; edges in slices, angles on the grid of
/// the steps.
class TimeDomain {
 public:
  /// @param x, y receptances of the tool tip @param feed [m] per tooth @param may_leave false: the chip
  /// thickness may be negative, as in linear theory
  TimeDomain(const RegenerativeSystem& system, const ModalModel& x, const ModalModel& y, double speed,
             double depth, double feed, int steps_per_revolution = 720, bool may_leave = true,
             int least_slices = 1)
      : may_leave_(may_leave),
        system_(system),
        steps_(steps_per_revolution),
        feed_(feed),
        x_(x, speed / units::TWO_PI * steps_per_revolution, Hold::first_order),
        y_(y, speed / units::TWO_PI * steps_per_revolution, Hold::first_order) {
    const double per_step = units::TWO_PI / steps_;
    const double lag = system.helix > 0.0 ? std::tan(system.helix) / (0.5 * system.diameter) : 0.0;
    const int slices =
        std::max(least_slices,
                 lag > 0.0 ? std::max(4, static_cast<int>(std::ceil(lag * depth / (2.0 * per_step)))) : 1);
    slice_depth_ = depth / slices;
    for (int s = 0; s < slices; ++s)
      lag_.push_back(static_cast<int>(std::lround(lag * depth * (s + 0.5) / slices / per_step)));
    double angle = 0.0;
    for (int k = 0; k < system.teeth; ++k) {
      tooth_.push_back(static_cast<int>(std::lround(angle / per_step)));
      angle += system.pitchOf(k);
    }
    surface_.assign(static_cast<std::size_t>(slices), std::vector<Mark>(static_cast<std::size_t>(steps_)));
    // Surface of previous teeth without vibration.
    for (auto& slice : surface_)
      for (int i = 0; i < steps_; ++i)
        slice[static_cast<std::size_t>(i)] = {-feed_ * std::sin(units::TWO_PI * i / steps_), -feed_};
  }

  /// Radial offset of each tooth [m], outwards.
  void setRunout(std::vector<double> runout) { runout_ = std::move(runout); }

  /// Radius offset of tooth k at a height: amplitude sin(2 pi (height / wavelength + k / teeth)) [m].
  /// Requires slices much thinner than the wavelength.
  void setSerration(double amplitude, double wavelength) {
    const std::size_t slices = surface_.size();
    serration_.assign(slices, std::vector<double>(tooth_.size(), 0.0));
    for (std::size_t s = 0; s < slices; ++s)
      for (std::size_t k = 0; k < tooth_.size(); ++k)
        serration_[s][k] =
            amplitude *
            std::sin(units::TWO_PI * ((static_cast<double>(s) + 0.5) * slice_depth_ / wavelength +
                                      static_cast<double>(k) / static_cast<double>(tooth_.size())));
  }

  /// Nonlinear force law in place of kt and kr.
  void setLaw(ForceCurves law) { law_ = std::move(law); }

  /// Disturbance force after the ramp. @param size [1] 1: 5 % of the force at the feed per tooth
  void setDisturbance(double size) { disturbance_ = size; }

  /// One step of the spindle. @return displacement x, y [m], caused by force().
  std::array<double, 2> step() {
    // Predictor and corrector for the displacement, then the final step.
    const std::array<double, 2> guess{{x_.peek(force_[0]), y_.peek(force_[1])}};
    force_ = cut(guess, false);
    const std::array<double, 2> better{{x_.peek(force_[0]), y_.peek(force_[1])}};
    force_ = cut(better, true);
    ++count_;
    return {{x_.step(force_[0]), y_.step(force_[1])}};
  }

  const std::array<double, 2>& force() const { return force_; }  ///< [N] on the tool

 private:
  static constexpr double RAMP = 30.0;  // [revolutions] of the depth

  std::array<double, 2> cut(const std::array<double, 2>& u, bool leave) {
    std::array<double, 2> force{{0.0, 0.0}};
    // Disturbance at the end of the ramp, from which a vibration may grow.
    const double turns = static_cast<double>(count_) / steps_ - RAMP;
    if (turns >= 0.0 && turns < 0.02) {
      const double disturbance = 0.05 * disturbance_ * (tangential(feed_) + radial(feed_)) * slice_depth_ *
                                 static_cast<double>(lag_.size());
      force = {{disturbance, disturbance}};
    }
    // Feed motion so far, along x.
    const double fed = feed_ * system_.teeth * static_cast<double>(count_) / steps_;
    for (std::size_t s = 0; s < surface_.size(); ++s) {
      for (std::size_t k = 0; k < tooth_.size(); ++k) {
        const int offset = tooth_[k];
        const long at = ((count_ + offset - lag_[s]) % steps_ + steps_) % steps_;
        const double phi = units::TWO_PI * static_cast<double>(at) / steps_;
        Mark& left = surface_[s][static_cast<std::size_t>(at)];
        if (phi <= system_.entry || phi >= system_.exit) continue;
        const double si = std::sin(phi), co = std::cos(phi);
        const double reach = (u[0] + fed) * si + u[1] * co + (runout_.empty() ? 0.0 : runout_[k]) +
                             (serration_.empty() ? 0.0 : serration_[s][k]);
        // Curvature of the tool: away from the feed direction an older surface is deeper (docs/formats.md).
        const double since = fed - left.fed,
                     last = feed_ * system_.teeth * system_.pitchOf(static_cast<int>(k)) / units::TWO_PI;
        const double round =
            system_.diameter > 0.0 ? (since * since - last * last) * co * co / system_.diameter : 0.0;
        const double chip = reach - left.reach + round;
        if (chip <= 0.0 && may_leave_) continue;
        if (leave) left = {reach, fed};
        // The depth is ramped: a sudden start could excite chatter in the bistable zone.
        const double depth = slice_depth_ * std::min(1.0, static_cast<double>(count_) / (RAMP * steps_));
        const double ft = tangential(chip) * depth, fr = radial(chip) * depth;
        force[0] += -ft * co - fr * si;
        force[1] += ft * si - fr * co;
      }
    }
    return force;
  }

  double tangential(double chip) const { return law_ ? law_->tangential.at(chip) : system_.kt * chip; }
  double radial(double chip) const { return law_ ? law_->radial.at(chip) : system_.kr * chip; }

  /// Surface left by the last tooth that cut here, and the feed motion at that time.
  struct Mark {
    double reach = 0.0, fed = 0.0;  // [m]
  };

  bool may_leave_;
  RegenerativeSystem system_;
  int steps_;
  double feed_, slice_depth_ = 0.0;
  ModalFilter x_, y_;
  std::vector<int> lag_, tooth_;
  std::vector<double> runout_;
  std::optional<ForceCurves> law_;
  double disturbance_ = 1.0;
  std::vector<std::vector<double>> serration_;  // [slice][tooth]
  std::vector<std::vector<Mark>> surface_;
  std::array<double, 2> force_{{0.0, 0.0}};
  long count_ = 0;
};

/// Whether the part of the motion that does not repeat with a period (in steps) grows or persists in the
/// second half of a run.
inline bool chattersInTime(TimeDomain& run, int period, double feed, int revolutions = 180, int steps = 720) {
  std::vector<std::array<double, 2>> before(static_cast<std::size_t>(period));
  constexpr int WINDOW = 25;  // revolutions, longer than the beats of a quasi-periodic motion
  double middle = 0.0, last = 0.0;
  for (int r = 0; r < revolutions; ++r) {
    double change = 0.0;
    for (int i = 0; i < steps; ++i) {
      const auto u = run.step();
      auto& old = before[static_cast<std::size_t>(i % period)];
      change += std::pow(u[0] - old[0], 2) + std::pow(u[1] - old[1], 2);
      old = u;
    }
    if (r >= revolutions / 2 - WINDOW && r < revolutions / 2) middle += change;
    if (r >= revolutions - WINDOW) last += change;
  }
  // RMS below 1e-6 of the feed: decayed; above 5 %: persistent.
  const double samples = static_cast<double>(WINDOW) * steps;
  if (last < samples * std::pow(1e-6 * feed, 2)) return false;
  return last > 0.7 * middle || last > samples * std::pow(0.05 * feed, 2);
}

/// The same with the principal period: tooth period for even pitch, else a revolution.
inline bool chattersInTime(const RegenerativeSystem& system, const ModalModel& x, const ModalModel& y,
                           double speed, double depth, double feed, bool may_leave = true,
                           int revolutions = 180, int steps = 720) {
  TimeDomain run(system, x, y, speed, depth, feed, steps, may_leave);
  return chattersInTime(run, system.evenPitch() ? steps / system.teeth : steps, feed, revolutions, steps);
}

}  // namespace smartmill::stability
