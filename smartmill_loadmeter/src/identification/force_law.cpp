#include "smartmill_loadmeter/identification/force_law.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "smartmill_core/cutting/rigid_cut.h"
#include "smartmill_core/error.h"
#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/calibration/fit.h"

namespace smartmill::loadmeter {

namespace {

using units::TWO_PI;

constexpr double REFERENCE_CHIP = 1e-4;      // [m]
constexpr std::size_t ANGLES = 48;           // bins of a mean revolution
constexpr double LARGEST_OFFSET = 6e-5;      // [m]
constexpr double LARGEST_UNBALANCE = 500.0;  // [N]
constexpr double FIT_TOLERANCE = 1e-7;

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
      // The edge extends from the tip back by the spread.
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
    throw Error(
        "force against chip thickness: expected angles with one tooth in cut over its whole depth, found "
        "none");
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
  if (n < 10) throw Error("force law: " + std::to_string(n) + " points, expected 10 or more");
  double sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    sx += chip[i], sy += force[i], sxx += chip[i] * chip[i], sxy += chip[i] * force[i];
  }
  const double count = static_cast<double>(n), determinant = count * sxx - sx * sx;
  if (!(determinant > 1e-12 * count * sxx)) throw Error("force law: all points have the same chip thickness");
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
      const FitResult candidate = fitLeastSquares(residuals, n, start);
      if (best.value.empty() || candidate.squares < best.squares) best = candidate;
      if (kind != ForceLawKind::shifted_linear) break;
    }
    std::copy(best.value.begin(), best.value.end(), law.value.begin());
    const double variance = best.squares / (count - static_cast<double>(start.size()));
    for (std::size_t i = 0; i < start.size(); ++i)
      law.std_dev[i] = std::sqrt(variance * best.covarianceOf(i, i));
    law.bic = bayesianInformationCriterion(best.squares, n, start.size(), false);
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

// Without a tachometer the speed is estimated as the one with the largest energy of the mean revolution: a
// slip of 0.2 % blurs a record of a hundred revolutions.
double revolutionsPerSample(const std::vector<double>& force, std::size_t first, double nominal) {
  const auto energyAt = [&](double per_sample) {
    std::array<double, ANGLES> sum{}, count{};
    for (std::size_t i = first; i < force.size(); ++i) {
      const double revolutions = static_cast<double>(i - first) * per_sample;
      const std::size_t bin =
          static_cast<std::size_t>((revolutions - std::floor(revolutions)) * static_cast<double>(ANGLES));
      sum[std::min(bin, ANGLES - 1)] += force[i];
      count[std::min(bin, ANGLES - 1)] += 1.0;
    }
    double energy = 0.0;
    for (std::size_t b = 0; b < ANGLES; ++b) energy += count[b] > 0.0 ? sum[b] * sum[b] / count[b] : 0.0;
    return energy;
  };
  const double turns = static_cast<double>(force.size() - first) * nominal;
  double best = nominal, most = energyAt(nominal);
  // Resolves a tenth of a revolution at the end of the record; then refined about the best.
  for (double step = 0.1 / turns, span = 0.01; step > 1e-3 / turns; span = 2.0 * step, step *= 0.25) {
    const double middle = best;
    for (double off = -span; off <= span; off += step) {
      const double candidate = energyAt(middle * (1.0 + off));
      if (candidate > most) most = candidate, best = middle * (1.0 + off);
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
  const double per_sample = angle ? nominal : revolutionsPerSample(record.column("fy"), first, nominal);
  const double turns = std::floor(static_cast<double>(record.size() - first) * per_sample);
  if (turns < 1.0) throw Error(record.file + ": less than one revolution in cut");
  for (std::size_t i = first; i < record.size(); ++i) {
    const double revolutions = static_cast<double>(i - first) * per_sample;
    if (revolutions >= turns) break;
    const double at =
        angle ? wrapped(record.column("spindle_angle")[i]) / TWO_PI : revolutions - std::floor(revolutions);
    const std::size_t bin = std::min(ANGLES - 1, static_cast<std::size_t>(at * static_cast<double>(ANGLES)));
    count[bin] += 1.0;
    for (std::size_t a = 0; a < 3; ++a) r.force[a][bin] += record.column(names[a])[i];
  }
  for (std::size_t bin = 0; bin < ANGLES; ++bin) {
    if (count[bin] == 0.0) throw Error(record.file + ": too few samples per revolution, expected 48 or more");
    for (std::size_t a = 0; a < 3; ++a) r.force[a][bin] /= count[bin];
  }
  return r;
}

/// Forces at the bin centres for given coefficients, size effect and runout.
void forces(const ToolGeometry& tool, const Engagement& e, const CuttingCoefficients& k, double exponent,
            double offset, double offset_angle, double phase,
            std::array<std::array<double, ANGLES>, 3>* out) {
  CuttingLaw law;
  law.coefficients = k;
  law.size_exponent = exponent;
  law.size_reference = REFERENCE_CHIP;
  const RigidCut cut(tool, law, e, runoutRadii(tool, offset, offset_angle));
  for (std::size_t i = 0; i < ANGLES; ++i) {
    const double spindle = TWO_PI * (static_cast<double>(i) + 0.5) / static_cast<double>(ANGLES) + phase;
    const auto [chip, edge] = cut.termsAt(spindle);
    (*out)[0][i] = chip.fx + edge.fx, (*out)[1][i] = chip.fy + edge.fy, (*out)[2][i] = chip.fz + edge.fz;
  }
}

/// Adds a force rotating with the tool: x sin(a), y cos(a) with a the angle of its direction (effects.md,
/// unbalance).
void addRotating(double towards, double square, double phase,
                 std::array<std::array<double, ANGLES>, 3>* out) {
  if (towards == 0.0 && square == 0.0) return;
  for (std::size_t i = 0; i < ANGLES; ++i) {
    const double a = TWO_PI * (static_cast<double>(i) + 0.5) / static_cast<double>(ANGLES) + phase;
    (*out)[0][i] += towards * std::sin(a) + square * std::cos(a);
    (*out)[1][i] += towards * std::cos(a) - square * std::sin(a);
  }
}

/// Mean and cosine and sine components of the first orders, RMS-weighted: not distorted by the resonances of
/// a sensor. @return number of values written.
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

// Terms of a fit in addition to linear edge forces.
struct SlotTerms {
  bool size, runout, unbalance;

  bool within(const SlotTerms& other) const {
    return size <= other.size && runout <= other.runout && unbalance <= other.unbalance;
  }
  std::string name() const {
    return std::string("linear edge forces") + (size ? ", size effect" : "") + (runout ? ", runout" : "") +
           (unbalance ? ", unbalance" : "");
  }
  std::size_t unknowns() const { return 6 + (size ? 1 : 0) + (runout ? 2 : 0) + (unbalance ? 2 : 0); }
};

// Fits one campaign's mean revolutions, each fit starting from the values of one with fewer terms.
class SlotFitter {
 public:
  SlotFitter(const Campaign& campaign, const MachineModel& model)
      : tool_(model.needTool("fit forces over a revolution")) {
    for (const CampaignTest& test : campaign.tests) {
      if (test.kind != TestKind::cut) continue;
      const Record record = readRecord(campaign, test, model);
      angle_ = angle_ && record.has("spindle_angle");
      cuts_.push_back(revolutionOf(test, record));
    }
    if (cuts_.size() < 2) throw Error(campaign.folder + ": expected two or more cuts");
    mean_ = identifyFromForceRecords(campaign, model, Means::revolutions).value;
    orders_ = tool_.teeth + 1;
    numbers_ = 3 * (1 + 2 * static_cast<std::size_t>(orders_));
    for (const Revolution& cut : cuts_) {
      measured_.emplace_back(numbers_);
      lowOrders(cut.force, orders_, measured_.back().data());
    }
    phases_.assign(cuts_.size(), 0.0);
    if (!angle_) searchPhases();
  }

  SlotFitResult add(const SlotTerms& terms) {
    std::vector<FitParameter> start = startOf(terms);
    FitResult best = solveFromStarts(terms, start);
    if (!angle_ && (terms.runout || terms.unbalance)) best = searchPitchShifts(start, best);
    // The phases without runout are the start of the fits with it.
    if (!angle_) phases_.assign(best.value.begin() + PHASES, best.value.end());
    solved_.emplace_back(terms, best.value);
    return resultOf(terms, best);
  }

 private:
  enum Unknown : std::size_t { SIZE = 6, OFFSET_X, OFFSET_Y, UNBALANCE_X, UNBALANCE_Y, PHASES };
  std::size_t count() const { return numbers_ * cuts_.size(); }

  void residuals(const std::vector<double>& v, double* out) const {
    const CuttingCoefficients k{v[0], v[1], v[2], v[3], v[4], v[5]};
    std::array<std::array<double, ANGLES>, 3> f{};
    for (std::size_t c = 0; c < cuts_.size(); ++c) {
      const double phase = angle_ ? 0.0 : v[PHASES + c];
      forces(tool_, cuts_[c].engagement, k, v[SIZE], std::hypot(v[OFFSET_X], v[OFFSET_Y]),
             std::atan2(v[OFFSET_Y], v[OFFSET_X]), phase, &f);
      addRotating(v[UNBALANCE_X], v[UNBALANCE_Y], phase, &f);
      lowOrders(f, orders_, out);
      for (std::size_t i = 0; i < numbers_; ++i) *out++ -= measured_[c][i];
    }
  }

  double squaresAt(const std::vector<double>& value) const {
    std::vector<double> residual(count());
    residuals(value, residual.data());
    return std::inner_product(residual.begin(), residual.end(), residual.begin(), 0.0);
  }

  FitResult solve(const std::vector<FitParameter>& start) const {
    return fitLeastSquares([this](const std::vector<double>& v, double* out) { residuals(v, out); }, count(),
                           start, FIT_TOLERANCE);
  }

  // Finds the phase of each cut from the coefficients of the mean forces.
  void searchPhases() {
    std::array<std::array<double, ANGLES>, 3> f{};
    std::vector<double> residual(numbers_);
    for (std::size_t c = 0; c < cuts_.size(); ++c) {
      double best = std::numeric_limits<double>::infinity();
      for (std::size_t p = 0; p < 2 * ANGLES; ++p) {
        const double phase = TWO_PI * static_cast<double>(p) / (2.0 * ANGLES);
        forces(tool_, cuts_[c].engagement, mean_, 0.0, 0.0, 0.0, phase, &f);
        lowOrders(f, orders_, residual.data());
        double squares = 0.0;
        for (std::size_t i = 0; i < numbers_; ++i) squares += std::pow(residual[i] - measured_[c][i], 2);
        if (squares < best) best = squares, phases_[c] = phase;
      }
    }
  }

  // Starts from the fit with the most terms among those without additional ones.
  std::vector<FitParameter> startOf(const SlotTerms& terms) const {
    const std::vector<double>* parent = nullptr;
    for (const auto& [has, value] : solved_) {
      if (has.within(terms)) parent = &value;
    }
    const auto from = [&](std::size_t i, double otherwise) {
      return parent && (*parent)[i] != 0.0 ? (*parent)[i] : otherwise;
    };
    std::vector<FitParameter> start;
    for (std::size_t i = 0; i < SIZE; ++i) {
      const CuttingKey& key = cuttingKeys()[i];
      const double unit = key.unit * (key.unit == units::N_PER_MM2 ? 300.0 : 20.0);
      start.push_back({from(i, mean_.*key.coefficient), -30.0 * unit, 30.0 * unit, unit});
    }
    start.push_back(
        {terms.size ? from(SIZE, 0.1) : 0.0, terms.size ? -0.3 : 0.0, terms.size ? 0.95 : 0.0, 0.2});
    // Two components, along and perpendicular to tooth 1; fixed to 0 without the term.
    const auto pair = [&](bool in, std::size_t first, double otherwise, double far, double scale) {
      for (const std::size_t i : {first, first + 1}) {
        start.push_back({in ? from(i, otherwise) : 0.0, in ? -far : 0.0, in ? far : 0.0, scale});
      }
    };
    pair(terms.runout, OFFSET_X, 0.0, LARGEST_OFFSET, 1e-5);
    pair(terms.unbalance, UNBALANCE_X, 20.0, LARGEST_UNBALANCE, 30.0);
    for (const double phase : phases_) {
      start.push_back({phase, angle_ ? 0.0 : phase - 0.5, angle_ ? 0.0 : phase + 0.5, 0.1});
    }
    return start;
  }

  // The first fit with an offset starts from two directions.
  FitResult solveFromStarts(const SlotTerms& terms, std::vector<FitParameter>& start) const {
    const bool search = terms.runout && start[OFFSET_X].start == 0.0 && start[OFFSET_Y].start == 0.0;
    if (!search) return solve(start);
    FitResult best;
    for (const double direction : {0.5, 2.6}) {
      start[OFFSET_X].start = 1e-5 * std::cos(direction);
      start[OFFSET_Y].start = 1e-5 * std::sin(direction);
      const FitResult candidate = solve(start);
      if (best.value.empty() || candidate.squares < best.squares) best = candidate;
    }
    return best;
  }

  // With equal teeth only rotating terms show which of them is tooth 1: the phase of each cut is ambiguous by
  // pitches.
  FitResult searchPitchShifts(std::vector<FitParameter> start, FitResult best) const {
    for (;;) {
      std::vector<double> value = best.value;
      bool moved = false;
      for (std::size_t c = 1; c < cuts_.size(); ++c) {
        const double own = value[PHASES + c];
        double least = squaresAt(value), chosen = own;
        for (int shift = 1; shift < tool_.teeth; ++shift) {
          value[PHASES + c] = own + TWO_PI * shift / tool_.teeth;
          const double squares = squaresAt(value);
          if (squares < least * (1.0 - 1e-9)) least = squares, chosen = value[PHASES + c], moved = true;
        }
        value[PHASES + c] = chosen;
      }
      if (!moved) return best;
      for (std::size_t i = 0; i < value.size(); ++i) {
        start[i].start = value[i];
        if (i >= PHASES) start[i].low = value[i] - 0.5, start[i].high = value[i] + 0.5;
      }
      const FitResult candidate = solve(start);
      if (candidate.squares >= best.squares) return best;
      best = candidate;
    }
  }

  SlotFitResult resultOf(const SlotTerms& terms, const FitResult& best) const {
    SlotFitResult result;
    result.name = terms.name();
    const std::size_t unknowns = terms.unknowns() + (angle_ ? 0 : cuts_.size());
    const double variance = best.squares / (static_cast<double>(count()) - static_cast<double>(unknowns));
    for (std::size_t i = 0; i < SIZE; ++i) {
      result.value.*cuttingKeys()[i].coefficient = best.value[i];
      result.std_dev.*cuttingKeys()[i].coefficient = std::sqrt(variance * best.covarianceOf(i, i));
    }
    result.size_exponent = best.value[SIZE];
    result.size_exponent_std = std::sqrt(variance * best.covarianceOf(SIZE, SIZE));
    const double x = best.value[OFFSET_X], y = best.value[OFFSET_Y];
    result.offset = std::hypot(x, y);
    result.offset_angle = std::atan2(y, x);
    if (result.offset > 0.0) {
      const double own = x * x * best.covarianceOf(OFFSET_X, OFFSET_X) +
                         2.0 * x * y * best.covarianceOf(OFFSET_X, OFFSET_Y) +
                         y * y * best.covarianceOf(OFFSET_Y, OFFSET_Y);
      result.offset_std = std::sqrt(variance * own) / result.offset;
    }
    for (std::size_t c = 0; c < cuts_.size(); ++c) {
      result.phase.push_back(angle_ ? 0.0 : wrapped(best.value[PHASES + c]));
    }
    result.unbalance = std::hypot(best.value[UNBALANCE_X], best.value[UNBALANCE_Y]);
    result.bic = bayesianInformationCriterion(best.squares, count(), unknowns, false);
    result.rms = std::sqrt(best.squares / static_cast<double>(3 * cuts_.size()));
    return result;
  }

  const ToolGeometry tool_;
  std::vector<Revolution> cuts_;
  bool angle_ = true;
  CuttingCoefficients mean_;
  int orders_ = 0;
  std::size_t numbers_ = 0;  // fitted values of one cut
  std::vector<std::vector<double>> measured_;
  std::vector<double> phases_;
  std::vector<std::pair<SlotTerms, std::vector<double>>> solved_;
};

}  // namespace

std::vector<SlotFitResult> fitSlots(const Campaign& campaign, const MachineModel& model) {
  SlotFitter fitter(campaign, model);
  std::vector<SlotFitResult> found;
  for (const SlotTerms& terms :
       {SlotTerms{false, false, false}, SlotTerms{false, false, true}, SlotTerms{false, true, false},
        SlotTerms{true, false, false}, SlotTerms{false, true, true}, SlotTerms{true, true, false},
        SlotTerms{true, true, true}}) {
    found.push_back(fitter.add(terms));
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const SlotFitResult& a, const SlotFitResult& b) { return a.bic < b.bic; });
  return found;
}

std::vector<ForcePoint> revolutionPoints(const Campaign& campaign, const MachineModel& model,
                                         const SlotFitResult& fit) {
  const ToolGeometry& tool = model.needTool("transform forces into the frame of the edge");
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
