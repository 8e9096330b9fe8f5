#include "smartmill_loadmeter/identification/slot_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "cut_revolution.h"
#include "smartmill_core/cutting/rigid_cut.h"
#include "smartmill_core/error.h"
#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/calibration/fit.h"
#include "smartmill_loadmeter/identification/campaign_identification.h"

namespace smartmill::loadmeter {

namespace {

using units::TWO_PI;
constexpr std::size_t ANGLES = RevolutionForce::ANGLES;

/// Forces at the bin centres for given coefficients, size effect and runout.
void forces(const ToolGeometry& tool, const Engagement& e, const CuttingCoefficients& k, double exponent,
            double offset, double offset_angle, double phase, RevolutionForce* out) {
  CuttingLaw law;
  law.coefficients = k;
  law.size_exponent = exponent;
  const RigidCut cut(tool, law, e, runoutRadii(tool, offset, offset_angle));
  for (std::size_t i = 0; i < ANGLES; ++i) {
    const auto [chip, edge] = cut.termsAt(RevolutionForce::angle(i) + phase);
    out->axis[0][i] = chip.fx + edge.fx;
    out->axis[1][i] = chip.fy + edge.fy;
    out->axis[2][i] = chip.fz + edge.fz;
  }
}

/// Adds a force rotating with the tool: x sin(a), y cos(a) with a the angle of its direction (effects.md,
/// unbalance).
void addRotating(double towards, double square, double phase, RevolutionForce* out) {
  if (towards == 0.0 && square == 0.0) return;
  for (std::size_t i = 0; i < ANGLES; ++i) {
    const double a = RevolutionForce::angle(i) + phase;
    out->axis[0][i] += towards * std::sin(a) + square * std::cos(a);
    out->axis[1][i] += towards * std::cos(a) - square * std::sin(a);
  }
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
  SlotFitter(const Campaign& campaign, const MachineModel& model, const SlotFitOptions& options)
      : options_(options), tool_(model.needTool("fit forces over a revolution")) {
    for (const CampaignTest& test : campaign.tests) {
      if (test.kind != TestKind::cut) continue;
      const Record record = inFeedAxes(readRecord(campaign, test, model), test);
      angle_ = angle_ && record.has("spindle_angle");
      cuts_.push_back(revolutionOf(test, record));
    }
    if (cuts_.size() < 2) throw Error(campaign.folder + ": expected two or more cuts");
    mean_ = identifyFromForceRecords(campaign, model, Means::revolutions).value;
    orders_ = tool_.teeth + 1;
    numbers_ = 3 * (1 + 2 * static_cast<std::size_t>(orders_));
    for (const CutRevolution& cut : cuts_) {
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
    RevolutionForce f;
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
                           start, options_.tolerance);
  }

  // Finds the phase of each cut from the coefficients of the mean forces.
  void searchPhases() {
    RevolutionForce f;
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
    pair(terms.runout, OFFSET_X, 0.0, options_.largest_offset, 1e-5);
    pair(terms.unbalance, UNBALANCE_X, 20.0, options_.largest_unbalance, 30.0);
    for (const double phase : phases_) {
      const double range = options_.phase_range;
      start.push_back({phase, angle_ ? 0.0 : phase - range, angle_ ? 0.0 : phase + range, 0.1});
    }
    return start;
  }

  // The first fit with an offset starts from two directions.
  FitResult solveFromStarts(const SlotTerms& terms, std::vector<FitParameter>& start) const {
    const bool search = terms.runout && start[OFFSET_X].start == 0.0 && start[OFFSET_Y].start == 0.0;
    if (!search) return solve(start);
    FitResult best;
    for (const double direction : options_.directions) {
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
        if (i < PHASES) continue;
        start[i].low = value[i] - options_.phase_range;
        start[i].high = value[i] + options_.phase_range;
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

  SlotFitOptions options_;
  const ToolGeometry tool_;
  std::vector<CutRevolution> cuts_;
  bool angle_ = true;
  CuttingCoefficients mean_;
  int orders_ = 0;
  std::size_t numbers_ = 0;  // fitted values of one cut
  std::vector<std::vector<double>> measured_;
  std::vector<double> phases_;
  std::vector<std::pair<SlotTerms, std::vector<double>>> solved_;
};

}  // namespace

std::vector<SlotFitResult> fitSlots(const Campaign& campaign, const MachineModel& model,
                                    const SlotFitOptions& options) {
  SlotFitter fitter(campaign, model, options);
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
    const CutRevolution r = revolutionOf(test, inFeedAxes(readRecord(campaign, test, model), test));
    std::vector<double> fx, fy, angle;
    for (std::size_t i = 0; i < ANGLES; ++i) {
      fx.push_back(r.force.axis[0][i]);
      fy.push_back(r.force.axis[1][i]);
      angle.push_back(RevolutionForce::angle(i) + fit.phase.at(cut));
    }
    const std::vector<ForcePoint> own = forcePoints(fx, fy, angle, tool, r.engagement);
    points.insert(points.end(), own.begin(), own.end());
    ++cut;
  }
  return points;
}

}  // namespace smartmill::loadmeter
