#include "smartmill_core/cutting/rigid_cut.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/cutting/contact.h"
#include "smartmill_core/math/sine_cosine.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

using units::TWO_PI;

constexpr std::size_t NODES = TURN_NODES;  // linear between them errs by 1e-6 of the integrand
constexpr double NODE_ANGLE = TURN_NODE_ANGLE;
constexpr int MOST_JOINS = 3;  // of tables with the factors of one moment
constexpr std::size_t MOST_TEETH = 20;
constexpr double LEAST_CHIP = 1e-15;  // [m] at the ends of a contact, which still rub

ContactArc arcOf(const Engagement& engagement) {
  return {engagement.entry, std::min(engagement.exit, TWO_PI), engagement.axial_depth};
}

CuttingForce forceOf(const double* sum, double radius) {
  return {sum[0], sum[1], sum[2], sum[3] * radius};
}

}  // namespace

RigidCut::RigidCut(const ToolGeometry& tool, const CuttingLaw& law, std::vector<double> radius_offset)
    : tool_((validate(tool), tool)), rule_(tool, std::move(radius_offset)), law_(law), lag_(tool.lag()) {
}

RigidCut::RigidCut(const ToolGeometry& tool, const CuttingLaw& law, const Engagement& engagement,
                   std::vector<double> radius_offset)
    : RigidCut(tool, law, std::move(radius_offset)) {
  validate(engagement);
  engage({arcOf(engagement)}, {{engagement.feed_per_tooth * tool.teeth / TWO_PI, 0.0}});
}

// Chip and edge part of a chip, the factors of both left out: they act later.
void RigidCut::add(double weight, double thickness, const SineCosine& at, Row& row) const {
  const CuttingCoefficients& k = law_.coefficients;
  const double chip = std::max(thickness, LEAST_CHIP);
  const double h = effectiveChip(law_, chip), e = edgeShare(law_, chip);
  EdgeForce of_chip, of_edge;
  of_chip.add(weight, k.ktc * h, k.krc * h, k.kac * h, at.sine, at.cosine);
  of_edge.add(weight, k.kte * e, k.kre * e, k.kae * e, at.sine, at.cosine);
  const Row part{of_chip.fx, of_chip.fy, of_chip.fz, of_chip.ft,
                 of_edge.fx, of_edge.fy, of_edge.fz, of_edge.ft};
  for (std::size_t i = 0; i < row.size(); ++i) row[i] += part[i];
}

std::vector<RigidCut::Row> RigidCut::integrals(std::vector<ChipShape> shapes) const {
  std::vector<Row> table(NODES + 1, Row{});
  forEachContact(shapes.data(), shapes.size(), 0.0, TWO_PI, [&](const ChipShape& shape, const Stretch& over) {
    const auto first = static_cast<std::size_t>(over.low() / NODE_ANGLE);
    for (std::size_t n = first; n < NODES && static_cast<double>(n) * NODE_ANGLE < over.high(); ++n) {
      const double from = std::max(over.low(), static_cast<double>(n) * NODE_ANGLE);
      const double to = std::min(over.high(), static_cast<double>(n + 1) * NODE_ANGLE);
      if (to <= from) continue;
      gauss(Stretch::between(from, to), [&](double weight, double s, double c) {
        add(weight, shape.at(s, c), {s, c}, table[n + 1]);
      });
    }
  });
  for (std::size_t n = 1; n <= NODES; ++n) {
    for (std::size_t k = 0; k < table[n].size(); ++k) table[n][k] += table[n - 1][k];
  }
  return table;
}

// A pass older than a revolution lies behind what the same tooth left a revolution later, wherever there is a
// chip.
void RigidCut::shape() {
  tables_.clear();
  joined_now_ = false;
  shapes_.assign(rule_.alike() ? 1 : static_cast<std::size_t>(rule_.teeth()), {});
  for (std::size_t j = 0; j < shapes_.size(); ++j) {
    for (int n = 1; n <= rule_.teeth(); ++n)
      shapes_[j].push_back(rule_.steadyShape(static_cast<int>(j), n, feed_));
  }
}

void RigidCut::tabulate() {
  if (!tables_.empty()) return;
  for (const std::vector<ChipShape>& shapes : shapes_) tables_.push_back(integrals(shapes));
}

void RigidCut::engage(const std::vector<ContactArc>& arcs, const std::array<double, 2>& feed) {
  for (const ContactArc& a : arcs) validate(a);
  arcs_ = arcs;
  if (feed == feed_ && !shapes_.empty()) return;
  feed_ = feed;
  shape();
}

void RigidCut::setDepths(const std::vector<double>& depths) {
  for (std::size_t a = 0; a < arcs_.size(); ++a) arcs_[a].depth = depths.at(a);
}

void RigidCut::setLaw(const CuttingLaw& law) {
  const CuttingCoefficients &a = law.coefficients, &b = law_.coefficients;
  const bool same = a.ktc == b.ktc && a.krc == b.krc && a.kac == b.kac && a.kte == b.kte && a.kre == b.kre &&
                    a.kae == b.kae && law.edge_chip == law_.edge_chip &&
                    law.size_exponent == law_.size_exponent && law.size_reference == law_.size_reference &&
                    law.course == law_.course;
  if (law.chip_factor != law_.chip_factor || law.edge_factor != law_.edge_factor) {
    joined_now_ = false;
    ++factor_changes_;
  }
  law_ = law;
  if (same) return;
  tables_.clear();
  joined_now_ = false;
}

void RigidCut::join() {
  joined_.resize(tables_.size());
  for (std::size_t t = 0; t < tables_.size(); ++t) {
    joined_[t].resize(tables_[t].size());
    for (std::size_t n = 0; n < tables_[t].size(); ++n) joined_[t][n] = joined(tables_[t][n]);
  }
  joined_now_ = true;
}

RigidCut::Sum RigidCut::joined(const Row& row) const {
  Sum sum;
  for (std::size_t k = 0; k < 4; ++k) sum[k] = law_.chip_factor * row[k] + law_.edge_factor * row[k + 4];
  return sum;
}

double RigidCut::chip(int tooth, double phi) const {
  const double s = std::sin(phi), c = std::cos(phi);
  double least = 1e300;
  for (const ChipShape& shape : shapes_.at(tableOf(tooth))) least = std::min(least, shape.at(s, c));
  return least;
}

namespace {

/// The integral of a table over the immersion angles from..to, times a height.
template <class Row>
void addBetween(const std::vector<Row>& rows, double from, double to, double height, Row& sum) {
  const double pa = from * (1.0 / NODE_ANGLE), pb = to * (1.0 / NODE_ANGLE);
  const auto ia = std::min(static_cast<std::size_t>(pa), NODES - 1);
  const auto ib = std::min(static_cast<std::size_t>(pb), NODES - 1);
  const double sa = pa - static_cast<double>(ia), sb = pb - static_cast<double>(ib);
  for (std::size_t k = 0; k < sum.size(); ++k) {
    sum[k] += height * (rows[ib][k] + sb * (rows[ib + 1][k] - rows[ib][k]) - rows[ia][k] -
                        sa * (rows[ia + 1][k] - rows[ia][k]));
  }
}

}  // namespace

void RigidCut::addStraight(const EdgePart& part, Row& sum) const {
  const double thickness = chip(part.tooth, part.to);
  if (thickness > 0.0) add(part.height, thickness, {std::sin(part.to), std::cos(part.to)}, sum);
}

CuttingForce RigidCut::at(double angle) {
  // Factors that change all the time (wear) are not worth a table; a straight edge needs none.
  const bool wanted = factor_changes_ <= MOST_JOINS && lag_ > 0.0 && !arcs_.empty();
  if (lag_ > 0.0) tabulate();
  if (!joined_now_ && wanted) join();
  Sum sum{};
  Row row{};
  forEachEdgePart(arcs_, lag_, rule_.toothAngle(), angle, [&](const EdgePart& part) {
    if (part.straight) {
      addStraight(part, row);
    } else if (joined_now_) {
      addBetween(joined_[tableOf(part.tooth)], part.from, part.to, part.height, sum);
    } else {
      addBetween(tables_[tableOf(part.tooth)], part.from, part.to, part.height, row);
    }
  });
  const Sum rest = joined(row);
  for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += rest[k];
  return forceOf(sum.data(), tool_.radius());
}

void RigidCut::integrate(const std::vector<ChipShape>& shapes, double from, double to, double height,
                         Row& sum) const {
  std::array<ChipShape, MOST_TEETH> own;
  std::copy(shapes.begin(), shapes.end(), own.begin());
  forEachContact(own.data(), shapes.size(), from, to, [&](const ChipShape& shape, const Stretch& over) {
    gauss(over, [&](double weight, double s, double c) {
      add(height * weight, shape.at(s, c), {s, c}, sum);
    });
  });
}

std::array<CuttingForce, 2> RigidCut::partsAt(double angle) const {
  Row row{};
  forEachEdgePart(arcs_, lag_, rule_.toothAngle(), angle, [&](const EdgePart& part) {
    if (part.straight) {
      addStraight(part, row);
    } else {
      integrate(shapes_[tableOf(part.tooth)], part.from, part.to, part.height, row);
    }
  });
  return {forceOf(row.data(), tool_.radius()), forceOf(row.data() + 4, tool_.radius())};
}

std::array<CuttingForce, 2> RigidCut::meanParts() const {
  Row row{};
  for (const ContactArc& arc : arcs_) {
    // One entry of shapes serves all teeth when they are alike.
    const double share = arc.depth / TWO_PI * (rule_.alike() ? rule_.teeth() : 1);
    for (const std::vector<ChipShape>& shapes : shapes_) integrate(shapes, arc.entry, arc.exit, share, row);
  }
  return {forceOf(row.data(), tool_.radius()), forceOf(row.data() + 4, tool_.radius())};
}

}  // namespace smartmill
