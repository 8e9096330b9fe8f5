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

constexpr std::size_t NODES = REVOLUTION_NODES;  // linear interpolation has an error of 1e-6 of the integrand
constexpr double NODE_ANGLE = REVOLUTION_NODE_ANGLE;
constexpr std::size_t MOST_TEETH = 20;
constexpr double LEAST_CHIP = 1e-15;  // [m] at the ends of a contact, where edge forces still act

void validateStraight(const ToolGeometry& tool) {
  validate(tool);
  requireStraightEdge(tool, "to tabulate its force over a revolution");
}

// sums += share (b - a)
void addDifference(const EdgeSums& a, const EdgeSums& b, double share, EdgeSums& sums) {
  sums.chip_sine += share * (b.chip_sine - a.chip_sine);
  sums.chip_cosine += share * (b.chip_cosine - a.chip_cosine);
  sums.chip += share * (b.chip - a.chip);
  sums.edge_sine += share * (b.edge_sine - a.edge_sine);
  sums.edge_cosine += share * (b.edge_cosine - a.edge_cosine);
  sums.edge += share * (b.edge - a.edge);
}

}  // namespace

RigidCut::RigidCut(const ToolGeometry& tool, const CuttingLaw& law, std::vector<double> radius_offset,
                   double path_share)
    : tool_((validateStraight(tool), tool)),
      rule_(tool, std::move(radius_offset)),
      law_(law),
      lag_(tool.lag()),
      path_share_(path_share) {
}

RigidCut::RigidCut(const ToolGeometry& tool, const CuttingLaw& law, const Engagement& engagement,
                   std::vector<double> radius_offset, double feed_direction)
    : RigidCut(tool, law, std::move(radius_offset)) {
  validate(engagement);
  const double feed = engagement.feed_per_tooth * tool.teeth / TWO_PI;
  engage(contactArcs(engagement, feed_direction),
         {{feed * std::cos(feed_direction), feed * std::sin(feed_direction)}});
}

void RigidCut::add(double weight, double thickness, const SineCosine& at, EdgeSums& sums) const {
  const double chip = std::max(thickness, LEAST_CHIP);
  const double h = weight * effectiveChip(law_, chip), e = weight * edgeShare(law_, chip);
  sums.chip_sine += h * at.sine;
  sums.chip_cosine += h * at.cosine;
  sums.chip += h;
  sums.edge_sine += e * at.sine;
  sums.edge_cosine += e * at.cosine;
  sums.edge += e;
}

std::vector<EdgeSums> RigidCut::integrals(std::vector<ChipShape> shapes) const {
  std::vector<EdgeSums> table(NODES + 1);
  forEachContact(
      shapes.data(), shapes.size(), 0.0, TWO_PI, [&](const ChipShape& shape, const AngleInterval& over) {
        const auto first = static_cast<std::size_t>(over.low() / NODE_ANGLE);
        for (std::size_t n = first; n < NODES && static_cast<double>(n) * NODE_ANGLE < over.high(); ++n) {
          const double from = std::max(over.low(), static_cast<double>(n) * NODE_ANGLE);
          const double to = std::min(over.high(), static_cast<double>(n + 1) * NODE_ANGLE);
          if (to <= from) continue;
          gauss(AngleInterval::between(from, to), [&](double weight, double s, double c) {
            add(weight, shape.at(s, c), {s, c}, table[n + 1]);
          });
        }
      });
  for (std::size_t n = 1; n <= NODES; ++n) addDifference({}, table[n - 1], 1.0, table[n]);
  return table;
}

// Wherever there is a chip, a pass older than a revolution is farther away than the surface that the same
// tooth left one revolution later.
void RigidCut::shape() {
  tables_.clear();
  shapes_.assign(rule_.alike() ? 1 : static_cast<std::size_t>(rule_.teeth()), {});
  for (std::size_t j = 0; j < shapes_.size(); ++j) {
    for (int n = 1; n <= rule_.teeth(); ++n)
      shapes_[j].push_back(rule_.steadyShape(static_cast<int>(j), n, feed_, path_share_));
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
  if (law.edge_chip != law_.edge_chip || law.size_exponent != law_.size_exponent ||
      law.size_reference != law_.size_reference || law.chip_curve != law_.chip_curve)
    tables_.clear();
  law_ = law;
}

double RigidCut::chip(int tooth, double phi) const {
  const double s = std::sin(phi), c = std::cos(phi);
  double least = 1e300;
  for (const ChipShape& shape : shapes_.at(tableOf(tooth))) least = std::min(least, shape.at(s, c));
  return least;
}

namespace {

/// The integral of a table over the immersion angles from..to, times a height.
void addBetween(const std::vector<EdgeSums>& rows, double from, double to, double height, EdgeSums& sums) {
  const double pa = from * (1.0 / NODE_ANGLE), pb = to * (1.0 / NODE_ANGLE);
  const auto ia = std::min(static_cast<std::size_t>(pa), NODES - 1);
  const auto ib = std::min(static_cast<std::size_t>(pb), NODES - 1);
  addDifference(rows[ia], rows[ib], height, sums);
  addDifference(rows[ib], rows[ib + 1], height * (pb - static_cast<double>(ib)), sums);
  addDifference(rows[ia], rows[ia + 1], -height * (pa - static_cast<double>(ia)), sums);
}

}  // namespace

void RigidCut::addStraight(const EdgeSegment& part, EdgeSums& sums) const {
  const double thickness = chip(part.tooth, part.to);
  if (thickness > 0.0) add(part.height, thickness, {std::sin(part.to), std::cos(part.to)}, sums);
}

EdgeSums RigidCut::sumsAt(double angle) {
  EdgeSums sums;
  if (arcs_.empty()) return sums;
  if (lag_ > 0.0) tabulate();
  forEachEdgeSegment(arcs_, lag_, rule_.toothAngle(), angle, [&](const EdgeSegment& part) {
    if (part.straight) {
      addStraight(part, sums);
    } else {
      addBetween(tables_[tableOf(part.tooth)], part.from, part.to, part.height, sums);
    }
  });
  return sums;
}

std::array<CuttingForce, 2> RigidCut::terms(const EdgeSums& s) const {
  const CuttingCoefficients& k = law_.coefficients;
  return {forceOf(s.chip_sine, s.chip_cosine, s.chip, k.ktc, k.krc, k.kac),
          forceOf(s.edge_sine, s.edge_cosine, s.edge, k.kte, k.kre, k.kae)};
}

void RigidCut::integrate(const std::vector<ChipShape>& shapes, double from, double to, double height,
                         EdgeSums& sums) const {
  std::array<ChipShape, MOST_TEETH> own;
  std::copy(shapes.begin(), shapes.end(), own.begin());
  forEachContact(own.data(), shapes.size(), from, to, [&](const ChipShape& shape, const AngleInterval& over) {
    gauss(over, [&](double weight, double s, double c) {
      add(height * weight, shape.at(s, c), {s, c}, sums);
    });
  });
}

std::array<CuttingForce, 2> RigidCut::termsAt(double angle) const {
  EdgeSums sums;
  forEachEdgeSegment(arcs_, lag_, rule_.toothAngle(), angle, [&](const EdgeSegment& part) {
    if (part.straight) {
      addStraight(part, sums);
    } else {
      integrate(shapes_[tableOf(part.tooth)], part.from, part.to, part.height, sums);
    }
  });
  return terms(sums);
}

std::array<CuttingForce, 2> RigidCut::meanTerms() const {
  EdgeSums sums;
  for (const ContactArc& arc : arcs_) {
    // A single entry of shapes is for all teeth.
    const double share = (arc.depth - arc.bottom) / TWO_PI * (rule_.alike() ? rule_.teeth() : 1);
    for (const std::vector<ChipShape>& shapes : shapes_) integrate(shapes, arc.entry, arc.exit, share, sums);
  }
  return terms(sums);
}

}  // namespace smartmill
