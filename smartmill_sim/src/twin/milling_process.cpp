#include "smartmill_sim/twin/milling_process.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
MillingProcess::MillingProcess(const ToolGeometry& tool, const CuttingLaw& law, double time_step,
                               std::vector<double> radius_offset, double path_share)
    : tool_((validate(tool), requireStraightEdge(tool, "to cut as one mill"), tool)),
      rule_(tool, radius_offset),
      radius_offset_(std::move(radius_offset)),
      law_(law),
      time_step_(time_step),
      lag_(tool.lag()),
      path_share_(path_share),
      history_(time_step),
      passes_(static_cast<std::size_t>(tool.teeth)) {
  radius_offset_.resize(passes_.size());  // empty: none
}

void MillingProcess::engage(const std::vector<ContactArc>& arcs, const ToolMotion& now) {
  for (const ContactArc& a : arcs) validate(a);
  if (!arcs.empty()) {
    history_.setFeed(now);
    for (int j = 0; j < rule_.teeth(); ++j) {
      if (rule_.turn(j, 1) < 2.0 * now.speed * time_step_)
        throw Error("milling: a tooth period is shorter than two steps");
    }
    if (arcs_.empty()) {
      history_.clear(now);
      earlier_radii_.clear();
      for (std::vector<Pass>& passes : passes_) passes.clear();
    }
  }
  arcs_ = arcs;
}

void MillingProcess::setDepths(const std::vector<double>& depths) {
  for (std::size_t a = 0; a < arcs_.size(); ++a) arcs_[a].depth = depths.at(a);
}

void MillingProcess::setRadii(std::vector<double> radius_offset) {
  rule_ = ChipRule(tool_, radius_offset);
  std::vector<double> change = std::move(radius_offset);
  change.resize(radius_offset_.size());
  change.swap(radius_offset_);
  if (arcs_.empty()) return;  // the next contact begins with the surfaces of these radii
  const auto teeth = static_cast<std::size_t>(rule_.teeth());
  for (std::size_t j = 0; j < teeth; ++j) change[j] -= radius_offset_[j];
  for (EarlierRadii& earlier : earlier_radii_)
    for (std::size_t j = 0; j < teeth; ++j) earlier.lengthening[j] += change[j];
  // Between the last step and the next one.
  earlier_radii_.push_back({history_.rotation() + 0.5 / history_.stepsPerRadian(), change});
  for (std::vector<Pass>& passes : passes_)
    for (Pass& pass : passes) pass.valid_regime = -1;
}

/// [m] Radius of the tooth n passes ahead when it left its surface, minus its present radius.
double MillingProcess::lengthening(int tooth, int n) const {
  const double then = history_.rotation() - rule_.turn(tooth, n);
  for (const EarlierRadii& earlier : earlier_radii_)
    if (then < earlier.until) return earlier.lengthening[static_cast<std::size_t>(rule_.ahead(tooth, n))];
  return 0.0;
}

/// [m] ChipRule::overhang() over the surfaces of all radii.
double MillingProcess::overhang(int tooth) const {
  if (earlier_radii_.empty()) return rule_.overhang(tooth);
  const double first = radius_offset_[static_cast<std::size_t>(rule_.ahead(tooth, 1))];
  double largest = rule_.overhang(tooth) + first;
  for (const EarlierRadii& earlier : earlier_radii_)
    for (std::size_t j = 0; j < radius_offset_.size(); ++j)
      largest = std::max(largest, radius_offset_[j] + earlier.lengthening[j]);
  return largest - first - lengthening(tooth, 1);
}

/// Drops earlier radii when all passes that are considered are later.
void MillingProcess::forgetRadii() {
  if (earlier_radii_.empty()) return;
  double longest = units::TWO_PI;  // [rad]
  for (const std::vector<Pass>& passes : passes_)
    for (const Pass& pass : passes) longest = std::max(longest, history_.turnOf(pass.delay));
  if (history_.rotation() - earlier_radii_.back().until <= longest) return;
  earlier_radii_.clear();
  for (std::vector<Pass>& passes : passes_)
    for (Pass& pass : passes) pass.valid_regime = -1;
}

/// [m] By which an axial feed has advanced an inclined edge across the tool since a pass. Where a rising edge
/// still cuts, no older pass is nearer for that.
double MillingProcess::axialChip(int tooth, int n) const {
  const double per_angle = lean_ * history_.now().sink / history_.now().speed;
  return per_angle * rule_.turn(tooth, per_angle > 0.0 ? n : 1);
}

void MillingProcess::addPass(int tooth) {
  std::vector<Pass>& passes = passes_[static_cast<std::size_t>(tooth)];
  const int n = static_cast<int>(passes.size()) + 1;
  Pass pass;
  pass.delay = history_.delayOf(rule_.turn(tooth, n));
  passes.push_back(pass);
}

void MillingProcess::shapePass(int tooth, int n, Pass& pass) {
  const double longer = lengthening(tooth, n);
  const bool steady = earlier_radii_.empty() && history_.isSteadyOver(history_.turnOf(pass.delay));
  if (steady && pass.valid_regime == history_.regime()) return;
  const Pass& first = passes_[static_cast<std::size_t>(tooth)].front();
  const std::array<double, 2> fed_first = history_.at(first.delay).fed;
  pass.step = rule_.step(tooth, n) - rule_.step(tooth, 1) + lengthening(tooth, 1) - longer;
  pass.rigid = rule_.shape(tooth, n, history_.at(pass.delay).fed, fed_first);
  pass.rigid.level += axialChip(tooth, n) - longer;
  pass.excess = pass.rigid - first.rigid;
  pass.bend = pass.excess.bend();
  pass.valid_regime = steady ? history_.regime() : -1;
}

// Bound [m] on how much nearer the exact surface of a pass may be than that of the ChipRule. @param vibrated,
// fed [m] across the ray, since then
double MillingProcess::pathMargin(double vibrated, double fed) const {
  constexpr double MARGIN = 1.25;  // of what the tool moves while its tooth turns on
  const double moved = std::abs(fed + vibrated), share = std::abs(path_share_) / tool_.radius();
  const double by = MARGIN * share * moved;
  return by * (std::abs(history_.feed()[0]) + std::abs(history_.feed()[1])) +
         std::min(by * history_.largestSlope(), 2.0 * history_.largestDeflection()) +
         0.5 * share * std::max(fed * fed - moved * moved, 0.0);
}

double MillingProcess::pathMarginAt(const ToolHistory::Delay& delay, const AngleInterval& cell) const {
  const auto across = [&](double x, double y) { return x * cell.at.cosine - y * cell.at.sine; };
  return pathMargin(across(history_.now().displacement[0] - delay.displacement[0],
                           history_.now().displacement[1] - delay.displacement[1]),
                    across(delay.fed[0], delay.fed[1]));
}

/// The bound for all vibrations, for a pass `turn` radians ago.
double MillingProcess::largestPathMargin(double turn) const {
  if (path_share_ == 0.0) return 0.0;
  const double fed = turn * (std::abs(history_.feed()[0]) + std::abs(history_.feed()[1])),
               vibrated = 2.0 * history_.largestDeflection();
  return pathMargin(vibrated, fed) + pathMargin(-std::min(vibrated, fed), fed);
}

// The surface on the ray at phi was cut by a tooth at psi = phi + D.t / R, with the motion D of the axis
// since then and t across the ray; its distance is R - D(psi).e - (D.t)^2 / (2 R). One Newton step from the
// solution of the last contact.
void MillingProcess::correctForPath(const ToolHistory::Delay& delay, const ToolHistory::Delay& first,
                                    const AngleInterval& cell, Pass& pass, ChipShape* shape) const {
  constexpr double MOST = 0.25;         // [rad] bound on the angle
  constexpr double LEAST_SLOPE = 0.25;  // [1] bound on the slope of the equation
  const double radius = tool_.radius(), steps = history_.stepsPerRadian();  // [m], [1/rad]
  const double share = path_share_ / radius;
  const auto across = [&](double x, double y) { return x * cell.at.cosine - y * cell.at.sine; };
  const ToolHistory::Point at = ToolHistory::Point::at(delay.point.ago - pass.offset * steps);
  const std::array<double, 4> slopes = at.weightSlopes();
  std::array<double, 2> then{}, rate{};  // [m], [m] per step farther back
  history_.forEachStep(at, [&](std::size_t k, const std::array<double, 2>& u) {
    for (std::size_t i = 0; i < 2; ++i) {
      then[i] += at.weights[k] * u[i];
      rate[i] += slopes[k] * u[i];
    }
  });
  const double x = delay.fed[0] + history_.now().displacement[0],
               y = delay.fed[1] + history_.now().displacement[1];
  const double slope_x = steps * rate[0] - history_.feed()[0], slope_y = steps * rate[1] - history_.feed()[1];
  const double slope = across(slope_x, slope_y);
  const double across_before =
      across(x - history_.feed()[0] * pass.offset - then[0], y - history_.feed()[1] * pass.offset - then[1]);
  const double move = (share * across_before - pass.offset) / std::max(1.0 - share * slope, LEAST_SLOPE);
  const double by = std::clamp(pass.offset + move, -MOST, MOST), moved = by - pass.offset;
  const double across_after = across_before + slope * moved;
  const double of_rule = across(delay.fed[0], delay.fed[1]), of_first = across(first.fed[0], first.fed[1]);
  shape->sine += delay.displacement[0] - then[0] - history_.feed()[0] * pass.offset + slope_x * moved;
  shape->cosine += delay.displacement[1] - then[1] - history_.feed()[1] * pass.offset + slope_y * moved;
  // The ChipRule takes the curvature of older passes relative to the first.
  shape->level += 0.5 * share * (across_after * across_after - of_rule * of_rule + of_first * of_first);
  pass.offset = by;
}

/// Collects the passes that may bound a tooth's chip over a cell of its edge: from the last one back until no
/// older pass can be nearer.
/// @param certain receives whether a single pass is in contact all along @return whether there may be contact
bool MillingProcess::collectShapes(int tooth, const AngleInterval& cell, bool& certain) {
  shapes_.clear();
  const std::size_t last = passOf(tooth, 1).delay;
  const std::array<double, 2> then = history_.at(last).displacement;
  double off = 0.0;  // [m] deviation of the last pass from the ChipRule
  const auto chip = [&](Pass& pass) {
    const ToolHistory::Delay& at = history_.at(pass.delay);
    ChipShape shape = pass.rigid;
    shape.sine += history_.now().displacement[0] - at.displacement[0];
    shape.cosine += history_.now().displacement[1] - at.displacement[1];
    if (path_share_ == 0.0) return shape;
    const double by_rule = shape.at(cell.at.sine, cell.at.cosine);
    correctForPath(at, history_.at(last), cell, pass, &shape);
    off = shape.at(cell.at.sine, cell.at.cosine) - by_rule;
    return shape;
  };
  const ChipShape first = chip(passOf(tooth, 1));
  const double off_first = off;
  const ChipBounds of_first = bounds(first, cell);
  if (of_first.high <= 0.0) return false;
  certain = of_first.low > 0.0;
  shapes_.push_back(first);
  // [m] bound on how much nearer vibration may bring an older surface than the last one: (u_1 - u_n).e.
  const double reach = history_.largestDeflection() - (then[0] * cell.at.sine + then[1] * cell.at.cosine) +
                       cell.half * (std::abs(then[0]) + std::abs(then[1]));
  const double end = reach + overhang(tooth);
  int unknown = 0;
  for (int n = 2; unknown < rule_.teeth(); ++n) {
    Pass& pass = passOf(tooth, n);
    const double lowest_excess = bounds(pass.excess, pass.bend, cell).low;
    if (lowest_excess - pass.step > end + largestPathMargin(history_.turnOf(pass.delay)) + off_first) break;
    const ToolHistory::Delay& delay = history_.at(pass.delay);
    const double margin = path_share_ == 0.0 ? 0.0 : pathMarginAt(delay, cell) + off_first;
    // Passes before the history have no vibration: each is farther than that of the next revolution.
    unknown = delay.within_history ? 0 : unknown + 1;
    if (lowest_excess > reach + margin) continue;
    const double x = then[0] - delay.displacement[0], y = then[1] - delay.displacement[1];
    ChipShape over_first = pass.excess;
    over_first.sine += x;
    over_first.cosine += y;
    if (bounds(over_first, pass.bend + std::abs(x) + std::abs(y), cell).low >= margin) continue;
    shapes_.push_back(chip(pass));
    if (path_share_ != 0.0 && bounds(shapes_.back() - first, cell).low >= 0.0) {
      shapes_.pop_back();
      continue;
    }
    if (bounds(shapes_.back(), cell).high <= 0.0) return false;
  }
  certain = certain && shapes_.size() == 1;
  return true;
}

/// Adds the sums over a segment of an edge in contact with one shape, integrated over the immersion angle.
void MillingProcess::add(const ChipShape& shape, const AngleInterval& over, double height, CutSums& sums) {
  constexpr double LEAST_CHIP = 1e-15;  // [m] at the ends of a contact, where the edge still rubs
  gauss(over, [&](double weight, double s, double c) {
    const double chip = std::max(shape.at(s, c), LEAST_CHIP), w = height * weight;
    const double h = w * effectiveChip(law_, chip), e = w * edgeShare(law_, chip);
    sums.edges.chip_sine += h * s;
    sums.edges.chip_cosine += h * c;
    sums.edges.chip += h;
    sums.edges.edge_sine += e * s;
    sums.edges.edge_cosine += e * c;
    sums.edges.edge += e;
    if (law_.damping == 0.0) return;
    rubbing_moments_.sine2 += w * s * s;
    rubbing_moments_.sine_cosine += w * s * c;
    rubbing_moments_.cosine2 += w * c * c;
    rubbing_moments_.sine += w * s;
    rubbing_moments_.cosine += w * c;
  });
}

/// Adds the sums of one edge over one of its cells.
void MillingProcess::cut(int tooth, const AngleInterval& cell, double height, CutSums& sums) {
  bool certain = false;
  if (!collectShapes(tooth, cell, certain)) return;
  if (certain) {
    add(shapes_[0], cell, height, sums);
  } else {
    leastPositive(shapes_.data(), shapes_.size(), cell,
                  [&](const ChipShape& shape, const AngleInterval& over) { add(shape, over, height, sums); });
  }
}

CutSums MillingProcess::sumsAt(const ToolMotion& now) {
  CutSums sums;
  if (arcs_.empty()) return sums;
  history_.advance(now);
  forgetRadii();
  rubbing_moments_ = {};
  forEachEdgeSegment(arcs_, lag_, rule_.toothAngle(), now.angle, [&](const EdgeSegment& part) {
    if (only_tooth_ >= 0 && part.tooth != only_tooth_) return;
    // A straight edge is at one angle: a small interval gives the same result.
    const double from = part.straight ? part.to : part.from,
                 to = part.straight ? part.to + LEAST_LAG : part.to;
    const double height = part.straight ? part.height / LEAST_LAG : part.height;
    forEachCell(from, to, [&](const AngleInterval& cell) { cut(part.tooth, cell, height, sums); });
  });
  if (law_.damping != 0.0) sums.rubbing = rubbing(now.rate, now.speed);
  return sums;
}

RubbingSums MillingProcess::rubbing(const std::array<double, 2>& rate, double speed) const {
  const double x = rate[0] / (speed * tool_.radius()), y = rate[1] / (speed * tool_.radius());
  return {x * rubbing_moments_.sine2 + y * rubbing_moments_.sine_cosine,
          x * rubbing_moments_.sine_cosine + y * rubbing_moments_.cosine2,
          x * rubbing_moments_.sine + y * rubbing_moments_.cosine};
}

CuttingForce MillingProcess::force(const CutSums& sums) const {
  const CuttingCoefficients& k = law_.coefficients;
  const EdgeSums& at = sums.edges;
  const RubbingSums& rub = sums.rubbing;
  const double chip = law_.chip_factor, edge = law_.edge_factor;
  const auto of = [&](double chips, double edges, double rubs) {
    const double damping = law_.damping * rubs;
    return std::array<double, 3>{
        {chip * k.ktc * chips + edge * k.kte * edges + TANGENTIAL_DAMPING * damping,
         chip * k.krc * chips + edge * k.kre * edges + law_.damping_radial * damping,
         chip * k.kac * chips + edge * k.kae * edges + law_.damping_axial * damping}};
  };
  // Tangential, radial and axial, as in EdgeForce::add().
  const std::array<double, 3> sine = of(at.chip_sine, at.edge_sine, rub.sine),
                              cosine = of(at.chip_cosine, at.edge_cosine, rub.cosine),
                              plain = of(at.chip, at.edge, rub.plain);
  return {-cosine[0] - sine[1], sine[0] - cosine[1], plain[2], plain[0] * tool_.radius()};
}

void MillingProcess::endStep(const std::array<double, 2>& displacement) {
  if (!arcs_.empty()) history_.endStep(displacement, path_share_ != 0.0);
}

}  // namespace smartmill::sim
