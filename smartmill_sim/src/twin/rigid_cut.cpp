#include "smartmill_sim/twin/rigid_cut.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/units.h"
#include "trigonometry.h"

namespace smartmill::sim {
namespace {

using units::TWO_PI;

constexpr std::size_t NODES = TURN_NODES;  // linear between them errs by 1e-6 of the integrand
constexpr double NODE_ANGLE = TURN_NODE_ANGLE;
constexpr int MOST_JOINS = 3;         // of tables with the factors of one moment
constexpr double LEAST_CHIP = 1e-15;  // [m] at the ends of a contact, which still rub
constexpr double LEAST_LAG = 1e-6;    // [rad] over the depth; below it the edge is straight

}  // namespace

RigidCut::RigidCut(const ToolGeometry& tool, const CuttingLaw& law, std::vector<double> radius_offset)
    : tool_(tool), law_(law), offset_(std::move(radius_offset)), lag_(tool.lag()) {
  validate(tool);
  checkOffsets(tool, offset_);
  const auto teeth = static_cast<std::size_t>(tool.teeth);
  for (std::size_t j = 0; j < teeth; ++j) tooth_angle_.push_back(tool.toothAngle(static_cast<int>(j)));
  bool alike = true;
  for (std::size_t j = 0; j < teeth; ++j) {
    for (std::size_t step = 1; step <= teeth; ++step) {
      const std::size_t i = (j + step) % teeth;
      // Its own last pass comes a whole turn ahead.
      const double ahead = step == teeth ? TWO_PI : wrapped(tooth_angle_[i] - tooth_angle_[j]);
      gaps_.push_back({{offset_[j] - offset_[i], ahead}});
      const std::array<double, 2>& first = gaps_[step - 1];
      alike = alike && gaps_.back()[0] == first[0] && std::abs(gaps_.back()[1] - first[1]) < 1e-12;
    }
  }
  tables_.resize(alike ? 1 : teeth);
}

double RigidCut::chip(std::size_t tooth, double sine, double cosine) const {
  const double along = feed_[0] * sine + feed_[1] * cosine;
  const std::array<double, 2>* gap = &gaps_[tooth * offset_.size()];
  double least = 1e300;
  for (std::size_t i = 0; i < offset_.size(); ++i) least = std::min(least, gap[i][0] + along * gap[i][1]);
  return least;
}

double RigidCut::chip(int tooth, double angle) const {
  return chip(static_cast<std::size_t>(tooth), std::sin(angle), std::cos(angle));
}

RigidCut::Row RigidCut::elementary(double chip, double sine, double cosine) const {
  if (chip <= 0.0) return {};
  const CuttingCoefficients& k = law_.coefficients;
  double h = chip;
  if (law_.size_exponent != 0.0) h *= std::pow(chip / law_.size_reference, -law_.size_exponent);
  const double ft = k.ktc * h, fr = k.krc * h;
  // The factor of the edge acts later.
  const double edge = law_.edge_chip > 0.0 ? -std::expm1(-chip / law_.edge_chip) : 1.0;
  const double te = k.kte * edge, re = k.kre * edge;
  return {-ft * cosine - fr * sine, ft * sine - fr * cosine, k.kac * h,    ft,
          -te * cosine - re * sine, te * sine - re * cosine, k.kae * edge, te};
}

void RigidCut::tabulate() {
  joined_now_ = false;
  const SineCosine* node = turnTable();
  for (std::size_t j = 0; j < tables_.size(); ++j) {
    std::vector<Row>& table = tables_[j];
    table.resize(NODES + 1);
    table[0] = {};
    double before = chip(j, node[0].sine, node[0].cosine);
    for (std::size_t n = 1; n <= NODES; ++n) {
      const double after = chip(j, node[n].sine, node[n].cosine);
      table[n] = table[n - 1];
      // Simpson over the part of the cell that is in contact, the chip nearly linear in it.
      double from = 0.0, to = 1.0;
      if (before <= 0.0 && after <= 0.0) {
        before = after;
        continue;
      }
      if (before < 0.0) from = before / (before - after);
      if (after < 0.0) to = before / (before - after);
      const double weight = (to - from) * NODE_ANGLE / 6.0;
      for (const double part : {0.0, 0.5, 1.0}) {
        const double share = from + part * (to - from);
        const auto [s, c] = sineCosine((static_cast<double>(n - 1) + share) * NODE_ANGLE);
        const Row row = elementary(std::max(chip(j, s, c), LEAST_CHIP), s, c);
        const double w = part == 0.5 ? 4.0 * weight : weight;
        for (std::size_t k = 0; k < row.size(); ++k) table[n][k] += w * row[k];
      }
      before = after;
    }
  }
}

void RigidCut::engage(const std::vector<ContactArc>& arcs, const ToolMotion& now) {
  for (const ContactArc& a : arcs) validate(a);
  arcs_ = arcs;
  const double turn = now.speed > 0.0 ? 1.0 / now.speed : 0.0;
  const std::array<double, 2> feed{{now.velocity[0] * turn, now.velocity[1] * turn}};
  if (feed != feed_ || tables_[0].empty()) {
    feed_ = feed;
    tabulate();
  }
}

void RigidCut::setDepths(const std::vector<double>& depths) {
  for (std::size_t a = 0; a < arcs_.size(); ++a) arcs_[a].depth = depths.at(a);
}

void RigidCut::setLaw(const CuttingLaw& law) {
  const CuttingCoefficients &a = law.coefficients, &b = law_.coefficients;
  const bool same = a.ktc == b.ktc && a.krc == b.krc && a.kac == b.kac && a.kte == b.kte && a.kre == b.kre &&
                    a.kae == b.kae && law.edge_chip == law_.edge_chip &&
                    law.size_exponent == law_.size_exponent && law.size_reference == law_.size_reference;
  if (law.chip_factor != law_.chip_factor || law.edge_factor != law_.edge_factor) {
    joined_now_ = false;
    ++factor_changes_;
  }
  law_ = law;
  if (!same && !tables_[0].empty()) tabulate();
}

void RigidCut::join() {
  const double c = law_.chip_factor, e = law_.edge_factor;
  joined_.resize(tables_.size());
  for (std::size_t t = 0; t < tables_.size(); ++t) {
    joined_[t].resize(tables_[t].size());
    for (std::size_t n = 0; n < tables_[t].size(); ++n) {
      for (std::size_t k = 0; k < 4; ++k) joined_[t][n][k] = c * tables_[t][n][k] + e * tables_[t][n][k + 4];
    }
  }
  joined_now_ = true;
}

void RigidCut::add(std::size_t table, double from, double to, Sum& sum) const {
  const double pa = from * (1.0 / NODE_ANGLE), pb = to * (1.0 / NODE_ANGLE);
  const auto ia = std::min(static_cast<std::size_t>(pa), NODES - 1);
  const auto ib = std::min(static_cast<std::size_t>(pb), NODES - 1);
  const double sa = pa - static_cast<double>(ia), sb = pb - static_cast<double>(ib);
  const auto between = [&](const auto& rows, std::size_t k) {
    return rows[ib][k] + sb * (rows[ib + 1][k] - rows[ib][k]) - rows[ia][k] -
           sa * (rows[ia + 1][k] - rows[ia][k]);
  };
  if (joined_now_) {
    for (std::size_t k = 0; k < 4; ++k) sum[k] += between(joined_[table], k);
  } else {
    for (std::size_t k = 0; k < 4; ++k)
      sum[k] +=
          law_.chip_factor * between(tables_[table], k) + law_.edge_factor * between(tables_[table], k + 4);
  }
}

CuttingForce RigidCut::at(double angle) {
  // Factors that change all the time (wear) are not worth a table.
  if (!joined_now_ && factor_changes_ <= MOST_JOINS && !arcs_.empty()) join();
  Sum sum{};
  for (const ContactArc& arc : arcs_) {
    const double spread = lag_ * arc.depth;
    Sum part{};
    if (spread < LEAST_LAG) {
      for (std::size_t j = 0; j < offset_.size(); ++j) {
        const double phi = wrapped(angle + tooth_angle_[j]);
        if (phi < arc.entry || phi >= arc.exit) continue;
        const double s = std::sin(phi), c = std::cos(phi);
        const Row row = elementary(chip(j, s, c), s, c);
        for (std::size_t k = 0; k < 4; ++k)
          part[k] += law_.chip_factor * row[k] + law_.edge_factor * row[k + 4];
      }
    } else {
      for (std::size_t j = 0; j < offset_.size(); ++j) {
        // The edge covers low..tip; a whole turn back it may reach into the arc again.
        double tip = wrapped(angle + tooth_angle_[j]);
        for (double low = tip - spread;; tip += TWO_PI, low += TWO_PI) {
          const double from = std::max(low, arc.entry), to = std::min(tip, arc.exit);
          if (to > from) add(tables_.size() == 1 ? 0 : j, from, to, part);
          if (low + TWO_PI >= arc.exit) break;
        }
      }
    }
    const double height = spread < LEAST_LAG ? arc.depth : 1.0 / lag_;  // [m], [m/rad]
    for (std::size_t k = 0; k < 4; ++k) sum[k] += part[k] * height;
  }
  return {sum[0], sum[1], sum[2], sum[3] * tool_.radius()};
}

}  // namespace smartmill::sim
