#include "smartmill_sim/twin/milling_process.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

constexpr std::size_t LEAST_HISTORY = 4096, MOST_HISTORY = 131072;  // steps; powers of two
constexpr double SAME_TURN = 1e-10;                                 // [rad]
constexpr double SETTLED_STEPS = 3.0;  // steps of a regime before it counts as steady

std::size_t ring(long step, std::size_t size) {
  return static_cast<std::size_t>(step) & (size - 1);
}

}  // namespace

std::array<double, 2> feedOf(const ToolMotion& motion) {
  if (!(motion.speed > 0.0)) throw Error("milling: the spindle is at rest");
  return {{motion.velocity[0] / motion.speed, motion.velocity[1] / motion.speed}};
}

MillingProcess::MillingProcess(const ToolGeometry& tool, const CuttingLaw& law, double time_step,
                               std::vector<double> radius_offset, double path_share)
    : tool_((validate(tool), tool)),
      rule_(tool, std::move(radius_offset)),
      law_(law),
      time_step_(time_step),
      lag_(tool.lag()),
      path_share_(path_share),
      passes_(static_cast<std::size_t>(tool.teeth)) {
}

void MillingProcess::engage(const std::vector<ContactArc>& arcs, const ToolMotion& now) {
  for (const ContactArc& a : arcs) validate(a);
  if (!arcs.empty()) {
    feed_ = feedOf(now);
    for (int j = 0; j < rule_.teeth(); ++j) {
      if (rule_.turn(j, 1) < 2.0 * now.speed * time_step_)
        throw Error("milling: a tooth period is shorter than two steps");
    }
    if (arcs_.empty()) clear(now);
  }
  arcs_ = arcs;
}

void MillingProcess::clear(const ToolMotion& now) {
  displacement_.assign(LEAST_HISTORY, {{0.0, 0.0}});
  centre_.assign(LEAST_HISTORY, {{0.0, 0.0}});
  rotation_.assign(LEAST_HISTORY, 0.0);
  count_ = 0;
  rotation_now_ = 0.0;
  longest_delay_ = 0;
  largest_deflection_ = largest_change_ = {{0.0, 0.0}};
  regime_ = 0;
  regime_start_ = 0.0;
  now_ = now;
  first_feed_ = feed_;
  delays_.clear();
  for (std::vector<Pass>& passes : passes_) passes.clear();
}

void MillingProcess::setDepths(const std::vector<double>& depths) {
  for (std::size_t a = 0; a < arcs_.size(); ++a) arcs_[a].depth = depths.at(a);
}

// Advances angle, feed and regime to the present motion.
void MillingProcess::advance(const ToolMotion& now) {
  if (count_ > 0) rotation_now_ += wrapped(now.angle - now_.angle);
  if (now.speed != now_.speed || now.velocity != now_.velocity) {
    ++regime_;
    regime_start_ = rotation_now_;
    feed_ = feedOf(now);
  }
  now_ = now;
}

// Whether speed and feed have been constant over an angle [rad]; before the history they were constant.
bool MillingProcess::isSteadyOver(double turn) const {
  return regime_ == 0 || rotation_now_ - regime_start_ > turn + SETTLED_STEPS * now_.speed * time_step_;
}

/// Interpolation point so many steps ago: cubic through the four steps around it.
MillingProcess::HistoryPoint MillingProcess::historyPointAt(double steps) {
  steps = std::max(2.0, steps);
  const auto whole_steps = static_cast<std::size_t>(steps);
  const double f = steps - static_cast<double>(whole_steps), g = f - 1.0, h = f - 2.0, across = (f + 1.0) * f;
  return {
      steps, whole_steps, {{across * g / 6.0, -across * h / 2.0, (f + 1.0) * g * h / 2.0, -f * g * h / 6.0}}};
}

/// Derivatives of these weights per step farther back.
std::array<double, 4> MillingProcess::weightSlopes(const HistoryPoint& at) {
  const double f = at.ago - static_cast<double>(at.steps), square = 3.0 * f * f;
  return {{(square - 1.0) / 6.0, (2.0 + 2.0 * f - square) / 2.0, (square - 4.0 * f - 1.0) / 2.0,
           (6.0 * f - square - 2.0) / 6.0}};
}

/// Finds the interpolation point of a delay in a history of changing speed or feed.
void MillingProcess::searchHistory(Delay& delay) {
  const double target = rotation_now_ - delay.turn;
  const long available = std::min(count_, static_cast<long>(rotation_.size()));
  const auto rotationAt = [&](long ago) {
    return ago == 0 ? rotation_now_ : rotation_[ring(count_ - ago, rotation_.size())];
  };
  if (available == 0 || target < rotationAt(available)) {
    // Before the history the tool moved as at its beginning.
    const std::array<double, 2> oldest =
        available == 0 ? now_.centre : centre_[ring(count_ - available, centre_.size())];
    const double before = (available == 0 ? rotation_now_ : rotationAt(available)) - target;
    for (std::size_t i = 0; i < 2; ++i) delay.fed[i] = now_.centre[i] - oldest[i] + first_feed_[i] * before;
    delay.point =
        historyPointAt(static_cast<double>(available) + std::max(3.0, before / (now_.speed * time_step_)));
    return;
  }
  auto ago = static_cast<long>(delay.turn / (now_.speed * time_step_));
  if (delay.point.steps > 0) ago = static_cast<long>(delay.point.steps) + 1;
  ago = std::clamp(ago, 1L, available);
  while (rotationAt(ago) > target) ++ago;
  while (ago > 1 && rotationAt(ago - 1) <= target) --ago;
  const double at = rotationAt(ago), next = rotationAt(ago - 1);
  delay.point = historyPointAt(static_cast<double>(ago) - (next > at ? (target - at) / (next - at) : 0.0));
  delay.fed = now_.centre;
  for (std::size_t k = 0; k < 4; ++k) {
    const long step = count_ - static_cast<long>(delay.point.steps) - 2 + static_cast<long>(k);
    const std::array<double, 2>& centre = centre_[ring(std::max(step, count_ - available), centre_.size())];
    for (std::size_t i = 0; i < 2; ++i) delay.fed[i] -= delay.point.weights[k] * centre[i];
  }
}

// Displacements around an interpolation point; none before the history.
template <class Step>
void MillingProcess::forEachStep(const HistoryPoint& at, Step&& step) const {
  const std::size_t size = displacement_.size();
  const long available = std::min(count_, static_cast<long>(size)), first = static_cast<long>(at.steps) + 2;
  for (std::size_t k = 0; k < 4; ++k) {
    const long ago = first - static_cast<long>(k);
    if (ago <= available) step(k, displacement_[ring(count_ - ago, size)]);
  }
}

MillingProcess::Delay& MillingProcess::updateDelay(Delay& delay) {
  delay.updated_at = count_;
  const bool steady = isSteadyOver(delay.turn);
  if (!steady) {
    searchHistory(delay);
    delay.valid_regime = -1;
  } else if (delay.valid_regime != regime_) {
    delay.point = historyPointAt(delay.turn / (now_.speed * time_step_));
    delay.fed = {{feed_[0] * delay.turn, feed_[1] * delay.turn}};
    delay.valid_regime = regime_;
  }
  const auto available = static_cast<std::size_t>(std::min(count_, static_cast<long>(displacement_.size())));
  delay.displacement = {{0.0, 0.0}};
  forEachStep(delay.point, [&](std::size_t k, const std::array<double, 2>& u) {
    for (std::size_t i = 0; i < 2; ++i) delay.displacement[i] += delay.point.weights[k] * u[i];
  });
  delay.within_history = delay.point.steps <= available;
  longest_delay_ = std::max(longest_delay_, delay.point.steps);
  return delay;
}

void MillingProcess::addPass(int tooth) {
  std::vector<Pass>& passes = passes_[static_cast<std::size_t>(tooth)];
  const int n = static_cast<int>(passes.size()) + 1;
  const double turn = rule_.turn(tooth, n);
  std::size_t d = 0;
  while (d < delays_.size() && std::abs(delays_[d].turn - turn) > SAME_TURN) ++d;
  if (d == delays_.size()) {
    delays_.emplace_back();
    delays_.back().turn = turn;
  }
  Pass pass;
  pass.delay = d;
  pass.step = rule_.step(tooth, n) - rule_.step(tooth, 1);
  passes.push_back(pass);
}

void MillingProcess::shapePass(int tooth, int n, Pass& pass) {
  const bool steady = isSteadyOver(delays_[pass.delay].turn);
  if (steady && pass.valid_regime == regime_) return;
  const Pass& first = passes_[static_cast<std::size_t>(tooth)].front();
  const std::array<double, 2> fed_first = delayAt(first.delay).fed;
  pass.rigid = rule_.shape(tooth, n, delayAt(pass.delay).fed, fed_first);
  pass.excess = pass.rigid - first.rigid;
  pass.bend = pass.excess.bend();
  pass.valid_regime = steady ? regime_ : -1;
}

// Bound [m] on how much nearer the exact surface of a pass may be than that of the ChipRule. @param vibrated,
// fed [m] across the ray, since then
double MillingProcess::pathMargin(double vibrated, double fed) const {
  constexpr double MARGIN = 1.25;  // of what the tool moves while its tooth turns on
  const double moved = std::abs(fed + vibrated), share = std::abs(path_share_) / tool_.radius();
  const double by = MARGIN * share * moved;
  return by * (std::abs(feed_[0]) + std::abs(feed_[1])) +
         std::min(by * largest_slope_, 2.0 * std::max(largest_deflection_[0], largest_deflection_[1])) +
         0.5 * share * std::max(fed * fed - moved * moved, 0.0);
}

double MillingProcess::pathMarginAt(const Delay& delay, const AngleInterval& cell) const {
  const auto across = [&](double x, double y) { return x * cell.at.cosine - y * cell.at.sine; };
  return pathMargin(
      across(now_.displacement[0] - delay.displacement[0], now_.displacement[1] - delay.displacement[1]),
      across(delay.fed[0], delay.fed[1]));
}

/// The bound for all vibrations, for a pass `turn` radians ago.
double MillingProcess::largestPathMargin(double turn) const {
  if (path_share_ == 0.0) return 0.0;
  const double fed = turn * (std::abs(feed_[0]) + std::abs(feed_[1])),
               vibrated = 2.0 * std::max(largest_deflection_[0], largest_deflection_[1]);
  return pathMargin(vibrated, fed) + pathMargin(-std::min(vibrated, fed), fed);
}

// The surface on the ray at phi was cut by a tooth at psi = phi + D.t / R, with the motion D of the axis
// since then and t across the ray; its distance is R - D(psi).e - (D.t)^2 / (2 R). One Newton step from the
// solution of the last contact.
void MillingProcess::correctForPath(const Delay& delay, const Delay& first, const AngleInterval& cell,
                                    Pass& pass, ChipShape* shape) const {
  constexpr double MOST = 0.25;         // [rad] bound on the angle
  constexpr double LEAST_SLOPE = 0.25;  // [1] bound on the slope of the equation
  const double radius = tool_.radius(), steps = 1.0 / (now_.speed * time_step_);  // [m], [1/rad]
  const double share = path_share_ / radius;
  const auto across = [&](double x, double y) { return x * cell.at.cosine - y * cell.at.sine; };
  const HistoryPoint at = historyPointAt(delay.point.ago - pass.offset * steps);
  const std::array<double, 4> slopes = weightSlopes(at);
  std::array<double, 2> then{}, rate{};  // [m], [m] per step farther back
  forEachStep(at, [&](std::size_t k, const std::array<double, 2>& u) {
    for (std::size_t i = 0; i < 2; ++i) {
      then[i] += at.weights[k] * u[i];
      rate[i] += slopes[k] * u[i];
    }
  });
  const double x = delay.fed[0] + now_.displacement[0], y = delay.fed[1] + now_.displacement[1];
  const double slope_x = steps * rate[0] - feed_[0], slope_y = steps * rate[1] - feed_[1];
  const double slope = across(slope_x, slope_y);
  const double across_before =
      across(x - feed_[0] * pass.offset - then[0], y - feed_[1] * pass.offset - then[1]);
  const double move = (share * across_before - pass.offset) / std::max(1.0 - share * slope, LEAST_SLOPE);
  const double by = std::clamp(pass.offset + move, -MOST, MOST), moved = by - pass.offset;
  const double across_after = across_before + slope * moved;
  const double of_rule = across(delay.fed[0], delay.fed[1]), of_first = across(first.fed[0], first.fed[1]);
  shape->sine += delay.displacement[0] - then[0] - feed_[0] * pass.offset + slope_x * moved;
  shape->cosine += delay.displacement[1] - then[1] - feed_[1] * pass.offset + slope_y * moved;
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
  const std::array<double, 2> then = delayAt(last).displacement;
  double off = 0.0;  // [m] deviation of the last pass from the ChipRule
  const auto chip = [&](Pass& pass) {
    const Delay& at = delayAt(pass.delay);
    ChipShape shape = pass.rigid;
    shape.sine += now_.displacement[0] - at.displacement[0];
    shape.cosine += now_.displacement[1] - at.displacement[1];
    if (path_share_ == 0.0) return shape;
    const double by_rule = shape.at(cell.at.sine, cell.at.cosine);
    correctForPath(at, delayAt(last), cell, pass, &shape);
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
  const double reach = std::max(largest_deflection_[0], largest_deflection_[1]) -
                       (then[0] * cell.at.sine + then[1] * cell.at.cosine) +
                       cell.half * (std::abs(then[0]) + std::abs(then[1]));
  const double end = reach + rule_.overhang(tooth);
  int unknown = 0;
  for (int n = 2; unknown < rule_.teeth(); ++n) {
    Pass& pass = passOf(tooth, n);
    const double lowest_excess = bounds(pass.excess, pass.bend, cell).low;
    if (lowest_excess - pass.step > end + largestPathMargin(delays_[pass.delay].turn) + off_first) break;
    const Delay& delay = delayAt(pass.delay);
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
  advance(now);
  if (path_share_ != 0.0)
    largest_slope_ = std::max(largest_change_[0], largest_change_[1]) / (now.speed * time_step_);
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
  if (arcs_.empty()) return;
  const std::size_t at = ring(count_, displacement_.size());
  if (at == 0 && count_ > 0) {
    largest_deflection_ = {{0.0, largest_deflection_[0]}};
    largest_change_ = {{0.0, largest_change_[0]}};
  }
  if (path_share_ != 0.0 && count_ > 0) {
    const std::array<double, 2>& before = displacement_[ring(count_ - 1, displacement_.size())];
    largest_change_[0] =
        std::max(largest_change_[0], std::hypot(displacement[0] - before[0], displacement[1] - before[1]));
  }
  displacement_[at] = displacement;
  centre_[at] = now_.centre;
  rotation_[at] = rotation_now_;
  const double square = displacement[0] * displacement[0] + displacement[1] * displacement[1];
  if (square > largest_deflection_[0] * largest_deflection_[0]) largest_deflection_[0] = std::sqrt(square);
  ++count_;
  const std::size_t size = displacement_.size();
  if (static_cast<std::size_t>(count_) >= size && size < MOST_HISTORY && 2 * longest_delay_ > size)
    growHistory();
}

/// Doubles the length of the full rings.
void MillingProcess::growHistory() {
  const std::size_t size = displacement_.size();
  const auto wider = [&](auto& old) {
    auto next = old;
    next.resize(2 * size);
    for (long step = count_ - static_cast<long>(size); step < count_; ++step)
      next[ring(step, 2 * size)] = old[ring(step, size)];
    old = std::move(next);
  };
  wider(displacement_);
  wider(centre_);
  wider(rotation_);
}

}  // namespace smartmill::sim
