#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "plant/front.h"
#include "plant/hidden.h"
#include "plant/machine.h"
#include "smartmill_core/units.h"

namespace smartmill::plant {

/// Angles and radii of the teeth.
struct Teeth {
  std::vector<double> angle;   // [rad] against tooth 1
  std::vector<double> radius;  // [m]
  double lag = 0.0;            // [rad/m]
};

Teeth teethOf(const Plant& plant, const Hidden& hidden);

/// Force law: forces per edge length from chip thickness.
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

  /// Time-dependent inputs: factor [1] of the chip coefficients, time [s] and path [m] since engagement.
  void setTime(double unsteadiness, double in_cut, double fed) {
    now_ = chip_factor_ * (1.0 + unsteadiness);
    if (isOutside(plant_, "softer_with_time"))
      now_ *= 1.0 + plant_.outside->size * std::exp(-in_cut / plant_.outside->place);
    edge_ = 1.0 + growth_ * (cut_before_ + in_cut);
    const double hardness = hardnessAt(fed);
    now_ *= hardness;
    edge_ *= hardness;
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
  // [1] of the work at a path [m] since engagement.
  double hardnessAt(double fed) const {
    if (!plant_.outside) return 1.0;
    const Outside& o = *plant_.outside;
    if (o.kind == "hard_spot") {
      const double off = (fed - o.place) / o.width;
      return 1.0 + o.size * std::exp(-0.5 * off * off);
    }
    if (o.kind == "hardness_wave") return 1.0 + o.size * std::sin(units::TWO_PI * (fed - o.place) / o.width);
    return o.kind == "hardness_slope" ? std::exp(o.size * fed / units::MM) : 1.0;
  }

  const Plant& plant_;
  CuttingCoefficients c_;
  double growth_, cut_before_, exponent_, reference_, buildup_, damping_;
  double speed_ = 0.0, chip_factor_ = 1.0, now_ = 1.0, edge_ = 1.0;
};

/// A slice of the tool.
struct Slab {
  double low = 0.0, high = 0.0;      // [m] above the tip
  double across = 1.0, along = 0.0;  // of the edge's normal, which points out of the tool and down
  double length = 1.0;               // of edge over height
  double inset = 0.0;                // [m] of the radius
};

/// Slices up to a height; those of a round corner cover equal angles of the normal.
std::vector<Slab> slabsOf(double corner_radius, double height, double thickness);

/// Slices of the tool in the workpiece.
class Cutting {
 public:
  struct Result {
    std::array<double, 3> force{};  // [N] on the tool
    double torque = 0.0;            // [N m]
  };

  Cutting(const Plant& plant, const Hidden& hidden, const CampaignTest& test, double slice, double step_angle)
      : plant_(plant), teeth_(teethOf(plant, hidden)), law_(plant, hidden, test), cut_(*test.engagement) {
    depth_ = cut_.axial_depth;
    if (hidden.has("thermal_growth"))
      depth_ +=
          units::UM * hidden("thermal_growth", "growth_um") *
          (1.0 - std::exp(-test.start_time.value_or(0.0) / hidden("thermal_growth", "time_constant_s")));
    tilt_ = 1e-3 * hidden("depth_tilt", "slope_um_per_mm");
    slabs_ = slabsOf(hidden.has("corner_radius") ? units::MM * hidden("corner_radius", "corner_radius_mm")
                                                 : plant.tool.edge.corner_radius,
                     depth_ + std::abs(tilt_) * 0.02, slice);
    for (const Slab& slab : slabs_)
      fronts_.emplace_back(0.5 * plant.tool.diameter - slab.inset, plant.tool.teeth, step_angle);
  }

  /// One step. @param axis of the tool [m] @param rate [m/s] of its vibration @param fed [m] since engagement
  Result step(double angle, const Point& axis, const Point& rate, double unsteadiness, double in_cut,
              double fed) {
    Result sum;
    const double depth = depth_ + tilt_ * fed, radius = 0.5 * plant_.tool.diameter;
    law_.setTime(unsteadiness, in_cut, fed);
    for (std::size_t s = 0; s < slabs_.size(); ++s) {
      const Slab& slab = slabs_[s];
      const double rise = std::min(depth, slab.high) - slab.low;
      if (rise <= 0.0) continue;
      const double height = slab.low + 0.5 * rise, local = radius - slab.inset;
      for (std::size_t k = 0; k < teeth_.angle.size(); ++k) {
        if (k == 0 && isOutside(plant_, "lost_corner") && height < plant_.outside->place) continue;
        const double phi = angle + teeth_.angle[k] - teeth_.lag * height;
        const double sin = std::sin(phi), cos = std::cos(phi);
        const double reach = teeth_.radius[k] - slab.inset;
        const Point tip{axis.x + reach * sin, axis.y + reach * cos};
        const double chip = fronts_[s].pass(k, axis, tip) * slab.across;
        if (chip <= 0.0 || !inWork(tip, sin, local)) continue;
        const auto [ft, normal, fa] =
            law_.force(chip, (rate.x * sin + rate.y * cos) * slab.across, height, depth);
        // Against the normal of the edge, and perpendicular to it.
        const double fr = normal * slab.across - fa * slab.along, length = rise * slab.length;
        sum.force[0] += (-ft * cos - fr * sin) * length;
        sum.force[1] += (ft * sin - fr * cos) * length;
        sum.force[2] += (normal * slab.along + fa * slab.across) * length;
        sum.torque += ft * length * local;
      }
    }
    return sum;
  }

 private:
  // The workpiece extends from R cos(exit) to R cos(entry) across the feed; a full slot has walls on both
  // sides.
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
  double depth_ = 0.0, tilt_ = 0.0;
  std::vector<Slab> slabs_;
  std::vector<Front> fronts_;
};

}  // namespace smartmill::plant
