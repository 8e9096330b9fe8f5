#include "smartmill_loadmeter/identification/force_law.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/calibration/fit.h"
#include "smartmill_loadmeter/identification/runout.h"

namespace smartmill::loadmeter {

namespace {

using units::PI;
using units::TWO_PI;

constexpr double REFERENCE_CHIP = 1e-4;  // [m]
constexpr double THINNEST_CHIP = 1e-7;   // [m] the power of a size effect has no limit at zero
constexpr std::size_t ANGLES = 48;       // of a mean revolution
constexpr int SLICES = 8;
constexpr double LARGEST_OFFSET = 6e-5;      // [m]
constexpr double LARGEST_UNBALANCE = 500.0;  // [N]
constexpr double FIT_TOLERANCE = 1e-7;

double wrapped(double angle) {
  return angle - TWO_PI * std::floor(angle / TWO_PI);
}

}  // namespace

std::vector<ForcePoint> forcePoints(const std::vector<double>& fx, const std::vector<double>& fy,
                                    const std::vector<double>& spindle_angle, const ToolGeometry& tool,
                                    const Engagement& engagement) {
  const double spread = tool.lag() * engagement.axial_depth;  // [rad] of an edge
  std::vector<ForcePoint> points;
  for (std::size_t i = 0; i < fx.size(); ++i) {
    int in_cut = 0, whole = 0;
    double phi = 0.0;
    for (int t = 0; t < tool.teeth; ++t) {
      const double tip = wrapped(spindle_angle[i] + tool.toothAngle(t));
      // The edge reaches from the tip back by the spread.
      const bool touches = (tip > engagement.entry && tip - spread < engagement.exit) ||
                           (tip + TWO_PI > engagement.entry && tip + TWO_PI - spread < engagement.exit);
      if (!touches) continue;
      ++in_cut;
      if (tip - spread >= engagement.entry && tip <= engagement.exit) {
        ++whole;
        phi = tip - 0.5 * spread;
      }
    }
    if (in_cut != 1 || whole != 1) continue;
    const double s = std::sin(phi), c = std::cos(phi);
    // Inverse of Fx = -Ft c - Fr s, Fy = Ft s - Fr c.
    ForcePoint p;
    p.chip = engagement.feed_per_tooth * s;
    p.tangential = (-fx[i] * c + fy[i] * s) / engagement.axial_depth;
    p.radial = (-fx[i] * s - fy[i] * c) / engagement.axial_depth;
    points.push_back(p);
  }
  if (points.empty()) {
    throw Error("force against chip thickness: at no time does one tooth cut alone over its whole depth");
  }
  return points;
}

const char* nameOf(ForceLawKind kind) {
  return kind == ForceLawKind::linear           ? "linear"
         : kind == ForceLawKind::shifted_linear ? "shifted linear"
                                                : "power";
}

double ForceLaw::at(double chip) const {
  if (kind == ForceLawKind::power) return value[0] * std::pow(std::max(chip, 0.0) / REFERENCE_CHIP, value[1]);
  const double line = value[0] * chip + value[1];
  if (kind == ForceLawKind::linear || chip >= value[2]) return line;
  return chip / value[2] * (value[0] * value[2] + value[1]);
}

std::vector<ForceLaw> fitForceLaws(const std::vector<double>& chip, const std::vector<double>& force) {
  const std::size_t n = chip.size();
  if (n < 10) throw Error("force law: " + std::to_string(n) + " points, 10 are due");
  double sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    sx += chip[i], sy += force[i], sxx += chip[i] * chip[i], sxy += chip[i] * force[i];
  }
  const double count = static_cast<double>(n), determinant = count * sxx - sx * sx;
  if (!(determinant > 1e-12 * count * sxx)) throw Error("force law: one chip thickness only");
  const double slope = (count * sxy - sx * sy) / determinant, level = (sy - slope * sx) / count;
  const auto [low, high] = std::minmax_element(chip.begin(), chip.end());
  const double size = std::max(std::abs(slope) * *high, std::abs(level)) + 1e-9;
  std::vector<ForceLaw> laws;
  for (const ForceLawKind kind : {ForceLawKind::linear, ForceLawKind::shifted_linear, ForceLawKind::power}) {
    ForceLaw law;
    law.kind = kind;
    std::vector<FitParameter> start;
    const double wide = 100.0 * size;
    if (kind == ForceLawKind::power) {
      start = {{slope * REFERENCE_CHIP + level, -wide, wide, size}, {0.7, -0.5, 3.0, 0.3}};
    } else {
      start = {{slope, -wide / *high, wide / *high, size / *high}, {level, -wide, wide, size}};
      if (kind == ForceLawKind::shifted_linear) {
        start.push_back({0.3 * *high, std::max(*low, 1e-3 * *high), *high, 0.3 * *high});
      }
    }
    const auto residuals = [&](const std::vector<double>& v, double* out) {
      ForceLaw l = law;
      std::copy(v.begin(), v.end(), l.value.begin());
      for (std::size_t i = 0; i < n; ++i) *out++ = (l.at(chip[i]) - force[i]) / size;
    };
    FitResult best;
    for (const double knee : {0.1, 0.3, 0.6}) {
      if (kind == ForceLawKind::shifted_linear) start[2].start = knee * *high;
      const FitResult tried = fit(residuals, n, start);
      if (best.value.empty() || tried.squares < best.squares) best = tried;
      if (kind != ForceLawKind::shifted_linear) break;
    }
    std::copy(best.value.begin(), best.value.end(), law.value.begin());
    const double variance = best.squares / (count - static_cast<double>(start.size()));
    for (std::size_t i = 0; i < start.size(); ++i)
      law.std_dev[i] = std::sqrt(variance * best.covarianceOf(i, i));
    law.bic = informationCriterion(best.squares, n, start.size(), false);
    law.rms = size * std::sqrt(best.squares / count);
    laws.push_back(law);
  }
  std::stable_sort(laws.begin(), laws.end(),
                   [](const ForceLaw& a, const ForceLaw& b) { return a.bic < b.bic; });
  return laws;
}

namespace {

/// Mean revolution of one cut.
struct Revolution {
  Engagement engagement;
  std::array<std::array<double, ANGLES>, 3> force{};  // [N]
};

// Without a tachometer the speed is the one at which the revolutions resemble each other most: a spindle that
// slips by 0.2 % smears a record of a hundred revolutions.
double turnsPerSample(const std::vector<double>& force, std::size_t first, double nominal) {
  const auto likeness = [&](double per_sample) {
    std::array<double, ANGLES> sum{}, count{};
    for (std::size_t i = first; i < force.size(); ++i) {
      const double turn = static_cast<double>(i - first) * per_sample;
      const std::size_t bin =
          static_cast<std::size_t>((turn - std::floor(turn)) * static_cast<double>(ANGLES));
      sum[std::min(bin, ANGLES - 1)] += force[i];
      count[std::min(bin, ANGLES - 1)] += 1.0;
    }
    double energy = 0.0;
    for (std::size_t b = 0; b < ANGLES; ++b) energy += count[b] > 0.0 ? sum[b] * sum[b] / count[b] : 0.0;
    return energy;
  };
  const double turns = static_cast<double>(force.size() - first) * nominal;
  double best = nominal, most = likeness(nominal);
  // A tenth of a revolution at the end of the record is seen; then finer about the best.
  for (double step = 0.1 / turns, span = 0.01; step > 1e-3 / turns; span = 2.0 * step, step *= 0.25) {
    const double middle = best;
    for (double off = -span; off <= span; off += step) {
      const double tried = likeness(middle * (1.0 + off));
      if (tried > most) most = tried, best = middle * (1.0 + off);
    }
  }
  return best;
}

Revolution revolutionOf(const CampaignTest& test, const Record& record) {
  Revolution r;
  r.engagement = *test.engagement;
  std::array<double, ANGLES> count{};
  const std::array<const char*, 3> names{"fx", "fy", "fz"};
  const std::size_t first =
      test.engage_time ? static_cast<std::size_t>(*test.engage_time * test.sample_rate) : 0;
  const bool angle = record.has("spindle_angle");
  const double nominal = test.spindle_speed / TWO_PI / test.sample_rate;
  const double per_sample = angle ? nominal : turnsPerSample(record.column("fy"), first, nominal);
  const double turns = std::floor(static_cast<double>(record.size() - first) * per_sample);
  if (turns < 1.0) throw Error(record.file + ": less than one revolution in cut");
  for (std::size_t i = first; i < record.size(); ++i) {
    const double turn = static_cast<double>(i - first) * per_sample;
    if (turn >= turns) break;
    const double at = angle ? wrapped(record.column("spindle_angle")[i]) / TWO_PI : turn - std::floor(turn);
    const std::size_t bin = std::min(ANGLES - 1, static_cast<std::size_t>(at * static_cast<double>(ANGLES)));
    count[bin] += 1.0;
    for (std::size_t a = 0; a < 3; ++a) r.force[a][bin] += record.column(names[a])[i];
  }
  for (std::size_t bin = 0; bin < ANGLES; ++bin) {
    if (count[bin] == 0.0) throw Error(record.file + ": too few samples a revolution (48 are due)");
    for (std::size_t a = 0; a < 3; ++a) r.force[a][bin] /= count[bin];
  }
  return r;
}

/// Forces at the middles of the bins by quantities per coefficient; size effect and runout nonlinear.
void forces(const ToolGeometry& tool, const Engagement& e, const CuttingCoefficients& k, double exponent,
            double offset, double offset_angle, double phase,
            std::array<std::array<double, ANGLES>, 3>* out) {
  const double dz = e.axial_depth / SLICES;
  std::vector<double> radius, tooth;
  for (int t = 0; t < tool.teeth; ++t) tooth.push_back(tool.toothAngle(t));
  for (int t = 0; t < tool.teeth; ++t) radius.push_back(offset * std::cos(offset_angle - tool.toothAngle(t)));
  for (std::size_t i = 0; i < ANGLES; ++i) {
    const double spindle = TWO_PI * (static_cast<double>(i) + 0.5) / static_cast<double>(ANGLES) + phase;
    CuttingForce sum;
    for (int t = 0; t < tool.teeth; ++t) {
      for (int s = 0; s < SLICES; ++s) {
        const double phi =
            wrapped(spindle + tooth[static_cast<std::size_t>(t)] - tool.lag() * (s + 0.5) * dz);
        if (phi < e.entry || phi > e.exit) continue;
        const double h = chipThickness(tool, e.feed_per_tooth, std::sin(phi), radius, t);
        if (h <= 0.0) continue;
        const double chip =
            exponent == 0.0 ? h : h * std::pow(std::max(h, THINNEST_CHIP) / REFERENCE_CHIP, -exponent);
        const CuttingForce f = toolForce((k.ktc * chip + k.kte) * dz, (k.krc * chip + k.kre) * dz,
                                         (k.kac * chip + k.kae) * dz, phi, tool.radius());
        sum.fx += f.fx, sum.fy += f.fy, sum.fz += f.fz;
      }
    }
    (*out)[0][i] = sum.fx, (*out)[1][i] = sum.fy, (*out)[2][i] = sum.fz;
  }
}

/// Rotating force on the tool: x sin(a), y cos(a) with a the angle of its direction (effects.md, unbalance).
void addRotating(double towards, double square, double phase,
                 std::array<std::array<double, ANGLES>, 3>* out) {
  if (towards == 0.0 && square == 0.0) return;
  for (std::size_t i = 0; i < ANGLES; ++i) {
    const double a = TWO_PI * (static_cast<double>(i) + 0.5) / static_cast<double>(ANGLES) + phase;
    (*out)[0][i] += towards * std::sin(a) + square * std::cos(a);
    (*out)[1][i] += towards * std::cos(a) - square * std::sin(a);
  }
}

/// Mean and the cosine and sine parts of the first orders, RMS-weighted: what a sensor that rings higher up
/// shows undistorted. @return numbers written.
std::size_t lowOrders(const std::array<std::array<double, ANGLES>, 3>& force, int orders, double* out) {
  const double n = static_cast<double>(ANGLES);
  static const auto CIRCLE = [] {
    std::array<std::array<double, ANGLES>, 2> circle{};
    for (std::size_t i = 0; i < ANGLES; ++i) {
      const double at = TWO_PI * static_cast<double>(i) / static_cast<double>(ANGLES);
      circle[0][i] = std::cos(at);
      circle[1][i] = std::sin(at);
    }
    return circle;
  }();
  std::size_t written = 0;
  for (const auto& axis : force) {
    double sum = 0.0;
    for (const double f : axis) sum += f;
    out[written++] = sum / n;
    for (int k = 1; k <= orders; ++k) {
      double c = 0.0, s = 0.0;
      for (std::size_t i = 0; i < ANGLES; ++i) {
        const std::size_t at = i * static_cast<std::size_t>(k) % ANGLES;
        c += axis[i] * CIRCLE[0][at], s += axis[i] * CIRCLE[1][at];
      }
      out[written++] = std::sqrt(2.0) * c / n;
      out[written++] = std::sqrt(2.0) * s / n;
    }
  }
  return written;
}

}  // namespace

std::vector<SlotFit> fitSlots(const Campaign& campaign, const MachineModel& model) {
  const ToolGeometry& tool = model.needTool("fit forces over a revolution");
  std::vector<Revolution> cuts;
  bool angle = true;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::cut) continue;
    const Record record = readRecord(campaign, test, model);
    angle = angle && record.has("spindle_angle");
    cuts.push_back(revolutionOf(test, record));
  }
  if (cuts.size() < 2) throw Error(campaign.folder + ": two cuts are due");
  const CuttingCoefficients mean = identifyFromForceRecords(campaign, model, Means::revolutions).value;
  const int orders = tool.teeth + 1;
  const std::size_t numbers = 3 * (1 + 2 * static_cast<std::size_t>(orders)), count = numbers * cuts.size();
  std::vector<std::vector<double>> measured;
  for (const Revolution& cut : cuts) {
    measured.emplace_back(numbers);
    lowOrders(cut.force, orders, measured.back().data());
  }

  std::vector<SlotFit> found;
  // Phases found without runout start the fits with it.
  std::vector<double> phases(cuts.size(), 0.0);
  struct Variant {
    bool size, runout, unbalance;
  };
  std::vector<std::pair<Variant, std::vector<double>>> solved;
  for (const auto& [size, runout, unbalance] :
       {Variant{false, false, false}, Variant{false, false, true}, Variant{false, true, false},
        Variant{true, false, false}, Variant{false, true, true}, Variant{true, true, false},
        Variant{true, true, true}}) {
    // From the values of the richest fit that has no more terms.
    const std::vector<double>* parent = nullptr;
    for (const auto& [has, value] : solved) {
      if (has.size <= size && has.runout <= runout && has.unbalance <= unbalance) parent = &value;
    }
    const auto from = [&](std::size_t i, double otherwise) {
      return parent && (*parent)[i] != 0.0 ? (*parent)[i] : otherwise;
    };
    std::vector<FitParameter> start;
    for (std::size_t i = 0; i < 6; ++i) {
      const CuttingKey& key = cuttingKeys()[i];
      const double unit = key.unit * (key.unit == units::N_PER_MM2 ? 300.0 : 20.0);
      start.push_back({from(i, mean.*key.coefficient), -30.0 * unit, 30.0 * unit, unit});
    }
    start.push_back({size ? from(6, 0.1) : 0.0, size ? -0.3 : 0.0, size ? 0.95 : 0.0, 0.2});
    // Offset as two components towards tooth 1 and square to it.
    const double far = runout ? LARGEST_OFFSET : 0.0;
    const double offset_x = from(7, 0.0), offset_y = from(8, 0.0);
    start.push_back({runout ? offset_x : 0.0, -far, far, 1e-5});
    start.push_back({runout ? offset_y : 0.0, -far, far, 1e-5});
    // Force that turns with the tool, in the same two directions.
    const double heavy = unbalance ? LARGEST_UNBALANCE : 0.0;
    start.push_back({unbalance ? from(9, 20.0) : 0.0, -heavy, heavy, 30.0});
    start.push_back({unbalance ? from(10, 20.0) : 0.0, -heavy, heavy, 30.0});
    const std::size_t phase_at = start.size();
    const auto residuals = [&](const std::vector<double>& v, double* out) {
      const CuttingCoefficients k{v[0], v[1], v[2], v[3], v[4], v[5]};
      std::array<std::array<double, ANGLES>, 3> f{};
      for (std::size_t c = 0; c < cuts.size(); ++c) {
        forces(tool, cuts[c].engagement, k, v[6], std::hypot(v[7], v[8]), std::atan2(v[8], v[7]),
               angle ? 0.0 : v[phase_at + c], &f);
        addRotating(v[9], v[10], angle ? 0.0 : v[phase_at + c], &f);
        lowOrders(f, orders, out);
        for (std::size_t i = 0; i < numbers; ++i) *out++ -= measured[c][i];
      }
    };
    if (!angle && !parent) {
      // Phase by search, each cut for itself.
      std::array<std::array<double, ANGLES>, 3> f{};
      for (std::size_t c = 0; c < cuts.size(); ++c) {
        double best = 1e300;
        for (std::size_t p = 0; p < 2 * ANGLES; ++p) {
          const double phase = TWO_PI * static_cast<double>(p) / (2.0 * ANGLES);
          forces(tool, cuts[c].engagement, mean, 0.0, 0.0, 0.0, phase, &f);
          std::vector<double> rest(numbers);
          lowOrders(f, orders, rest.data());
          double squares = 0.0;
          for (std::size_t i = 0; i < numbers; ++i) squares += std::pow(rest[i] - measured[c][i], 2);
          if (squares < best) best = squares, phases[c] = phase;
        }
      }
    }
    for (std::size_t c = 0; c < cuts.size(); ++c) {
      start.push_back({phases[c], angle ? 0.0 : phases[c] - 0.5, angle ? 0.0 : phases[c] + 0.5, 0.1});
    }
    FitResult best;
    for (const double direction : {0.5, 2.6}) {
      const bool search = runout && offset_x == 0.0 && offset_y == 0.0;
      if (search) {
        start[7].start = 1e-5 * std::cos(direction);
        start[8].start = 1e-5 * std::sin(direction);
      }
      const FitResult tried = fit(residuals, count, start, FIT_TOLERANCE);
      if (best.value.empty() || tried.squares < best.squares) best = tried;
      if (!search) break;
    }
    // Equal teeth: which of them is tooth 1 in a cut shows only by what turns. Each cut may be off by a
    // pitch.
    for (bool moved = !angle && (runout || unbalance); moved;) {
      moved = false;
      std::vector<double> rest(count), value = best.value;
      const auto squaresAt = [&] {
        residuals(value, rest.data());
        double sum = 0.0;
        for (const double r : rest) sum += r * r;
        return sum;
      };
      for (std::size_t c = 1; c < cuts.size(); ++c) {
        const double own = value[phase_at + c];
        double least = squaresAt(), chosen = own;
        for (int shift = 1; shift < tool.teeth; ++shift) {
          value[phase_at + c] = own + TWO_PI * shift / tool.teeth;
          const double squares = squaresAt();
          if (squares < least * (1.0 - 1e-9)) least = squares, chosen = value[phase_at + c], moved = true;
        }
        value[phase_at + c] = chosen;
      }
      if (!moved) break;
      std::vector<FitParameter> other = start;
      for (std::size_t i = 0; i < value.size(); ++i) {
        other[i].start = value[i];
        if (i >= phase_at) other[i].low = value[i] - 0.5, other[i].high = value[i] + 0.5;
      }
      const FitResult tried = fit(residuals, count, other, FIT_TOLERANCE);
      if (tried.squares >= best.squares) break;
      best = tried;
      start = other;
    }
    if (!angle) {
      for (std::size_t c = 0; c < cuts.size(); ++c) phases[c] = best.value[phase_at + c];
    }
    solved.push_back({{size, runout, unbalance}, best.value});
    SlotFit result;
    result.name = std::string("linear edge forces") + (size ? ", size effect" : "") +
                  (runout ? ", runout" : "") + (unbalance ? ", unbalance" : "");
    const std::size_t unknowns =
        6 + (size ? 1 : 0) + (runout ? 2 : 0) + (unbalance ? 2 : 0) + (angle ? 0 : cuts.size());
    const double variance = best.squares / (static_cast<double>(count) - static_cast<double>(unknowns));
    for (std::size_t i = 0; i < 6; ++i) {
      result.value.*cuttingKeys()[i].coefficient = best.value[i];
      result.std_dev.*cuttingKeys()[i].coefficient = std::sqrt(variance * best.covarianceOf(i, i));
    }
    result.size_exponent = best.value[6];
    result.size_exponent_std = std::sqrt(variance * best.covarianceOf(6, 6));
    const double x = best.value[7], y = best.value[8];
    result.offset = std::hypot(x, y);
    result.offset_angle = std::atan2(y, x);
    if (result.offset > 0.0) {
      const double own = x * x * best.covarianceOf(7, 7) + 2.0 * x * y * best.covarianceOf(7, 8) +
                         y * y * best.covarianceOf(8, 8);
      result.offset_std = std::sqrt(variance * own) / result.offset;
    }
    for (std::size_t c = 0; c < cuts.size(); ++c) {
      result.phase.push_back(angle ? 0.0 : wrapped(best.value[phase_at + c]));
    }
    result.unbalance = std::hypot(best.value[9], best.value[10]);
    result.bic = informationCriterion(best.squares, count, unknowns, false);
    result.rms = std::sqrt(best.squares / static_cast<double>(3 * cuts.size()));
    found.push_back(result);
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const SlotFit& a, const SlotFit& b) { return a.bic < b.bic; });
  return found;
}

std::vector<ForcePoint> revolutionPoints(const Campaign& campaign, const MachineModel& model,
                                         const SlotFit& fit) {
  const ToolGeometry& tool = model.needTool("turn forces into the frame of the edge");
  std::vector<ForcePoint> points;
  std::size_t cut = 0;
  for (const CampaignTest& test : campaign.tests) {
    if (test.kind != TestKind::cut) continue;
    const Revolution r = revolutionOf(test, readRecord(campaign, test, model));
    std::vector<double> fx, fy, angle;
    for (std::size_t i = 0; i < ANGLES; ++i) {
      fx.push_back(r.force[0][i]);
      fy.push_back(r.force[1][i]);
      angle.push_back(TWO_PI * (static_cast<double>(i) + 0.5) / static_cast<double>(ANGLES) +
                      fit.phase.at(cut));
    }
    const std::vector<ForcePoint> own = forcePoints(fx, fy, angle, tool, r.engagement);
    points.insert(points.end(), own.begin(), own.end());
    ++cut;
  }
  return points;
}

}  // namespace smartmill::loadmeter
