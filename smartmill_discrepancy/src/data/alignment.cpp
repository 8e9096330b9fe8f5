#include "smartmill_discrepancy/data/alignment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

struct AlignmentFreedomOptions {
  /// [samples] The force may start at once or over a fraction of a sample.
  double entry_std = 0.1, entry_step = 0.02;
  /// [rad] The prior only limits a step; the step is far below a sample.
  double angle_std = 1.0, angle_step = 1e-4;
};

const AlignmentFreedomOptions LIMITS;

using units::TWO_PI;

// Estimate of the phase of a record without spindle angle.
struct PhaseEstimateOptions {
  double speed_share = 0.01;  ///< [1] search range of the stated speed
  int phases = 240;           ///< tried per tooth; the best is refined by the fits
  int tooth_lines = 4;        ///< of the forces that are compared
};

// Rotation of the model that aligns a record.
struct RotationOptions {
  double min_gain = 25.0;        ///< squares over noise for a significant phase: five standard deviations
  double min_simulated = 0.05;   ///< [1] of the squares of the lines between the tooth passing lines
  int all_phases = 1440;         ///< tried in a revolution: 0.25 deg
  int nearby_phases = 40;        ///< tried in the halves of a record
  double nearby = 0.25;          ///< [1] of a period of the highest order: range in the halves
  double min_revolutions = 4.0;  ///< of a record with a speed error
  int max_orders = 60;           ///< more lines hardly change the phase
};

std::complex<double> lineAt(const std::vector<double>& values, std::size_t from, std::size_t to,
                            double step) {
  std::complex<double> sum = 0.0, rotation = std::polar(1.0, -step),
                       at = std::polar(1.0, -step * static_cast<double>(from));
  for (std::size_t i = from; i < to; ++i) {
    sum += values[i] * at;
    at *= rotation;
  }
  return sum / static_cast<double>(to - from);
}

void setAngle(TestData& t, double phase) {
  std::vector<double>& angle = t.record.add("spindle_angle");
  angle.resize(t.record.size());
  for (std::size_t i = 0; i < angle.size(); ++i) {
    const double a =
        std::fmod(phase + t.test.spindle_speed * static_cast<double>(i) / t.test.sample_rate, TWO_PI);
    angle[i] = a < 0.0 ? a + TWO_PI : a;
  }
}

// First sample in cut; 0 for an air cut.
std::size_t beginOf(const TestData& t) {
  return t.first_cut < t.record.size() ? t.first_cut : 0;
}

/// Lines of a record and of a model at orders of the spindle, forces over their noise.
struct OrderLines {
  std::vector<std::complex<double>> measured, simulated;  // lowest order first, one channel after the other
  int orders = 0;                                         // per channel
  int spacing = 1;                                        // the lowest order and the distance between orders

  int orderOf(std::size_t line) const { return (static_cast<int>(line) % orders + 1) * spacing; }

  /// Half the reduction of squares if the model is rotated by a phase [rad].
  double match(double phase) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < measured.size(); ++i)
      sum += std::real(std::conj(simulated[i] * std::polar(1.0, orderOf(i) * phase)) * measured[i]);
    return sum;
  }

  /// Best phase within a range [rad] on both sides of a given one.
  double best(double from, double range, int points) const {
    double at = from, largest = -1e300;
    const double step = 2.0 * range / points;
    for (int p = 0; p <= points; ++p) {
      const double phase = from - range + step * p, m = match(phase);
      if (m > largest) {
        largest = m;
        at = phase;
      }
    }
    const double a = match(at - step), c = match(at + step), curve = 2.0 * largest - a - c;
    return curve > 0.0 ? at + 0.5 * step * (c - a) / curve : at;
  }
};

// Every order of the spindle (spacing 1) or the tooth passing orders, up to the bandwidth of the sampling.
OrderLines linesOf(const Dataset& data, const TestData& t, const Record& model, std::size_t from,
                   std::size_t to, int spacing, int most) {
  const double step = spacing * t.test.spindle_speed / t.test.sample_rate;
  OrderLines lines;
  lines.spacing = spacing;
  lines.orders = std::min(most, static_cast<int>(0.9 * units::PI / step));
  for (const std::string& channel : FORCES) {
    if (!t.record.has(channel) || data.noise.count(channel) == 0) continue;
    const double noise = data.noise.at(channel);
    for (int k = 1; k <= lines.orders; ++k) {
      lines.measured.push_back(lineAt(t.record.column(channel), from, to, k * step) / noise);
      lines.simulated.push_back(lineAt(model.column(channel), from, to, k * step) / noise);
    }
  }
  return lines;
}

double firstAngle(const TestData& t) {
  return t.record.column("spindle_angle").front();
}

double halfSpan(const TestData& t) {
  return 0.5 * static_cast<double>(t.record.size()) / t.test.sample_rate;
}

// Squares over noise of the residual of the forces.
double residualSquares(const Dataset& data, const TestData& t, const Record& simulated) {
  double squares = 0.0;
  for (const std::string& channel : FORCES) {
    if (!t.record.has(channel) || data.noise.count(channel) == 0) continue;
    const std::vector<double>&a = t.record.column(channel), &b = simulated.column(channel);
    for (std::size_t i = 0; i < a.size(); ++i) squares += std::pow((a[i] - b[i]) / data.noise.at(channel), 2);
  }
  return squares;
}

}  // namespace

double rotationOf(const std::vector<double>& angle) {
  double rotated = 0.0;
  for (std::size_t i = 1; i < angle.size(); ++i) rotated += std::remainder(angle[i] - angle[i - 1], TWO_PI);
  return rotated;
}

double refinedSpeed(const TestData& test, int teeth, double share) {
  const double nominal = test.test.spindle_speed / test.test.sample_rate;  // [rad/sample]
  const auto power = [&](double speed) {
    double sum = 0.0;
    for (const std::string& channel : FORCES) {
      if (!test.record.has(channel)) continue;
      for (int k = 1; k <= 3; ++k) {
        if (k * teeth * speed > 0.9 * units::PI) break;
        sum += std::norm(
            lineAt(test.record.column(channel), test.first_cut, test.record.size(), k * teeth * speed));
      }
    }
    return sum;
  };
  const double resolution =
      TWO_PI / static_cast<double>(test.record.size() - test.first_cut) / (3 * teeth) / 8.0;
  double best = nominal, largest = -1.0;
  for (double s = nominal * (1.0 - share); s <= nominal * (1.0 + share); s += resolution) {
    const double p = power(s);
    if (p > largest) {
      largest = p;
      best = s;
    }
  }
  const double a = power(best - resolution), c = power(best + resolution), curve = 2.0 * largest - a - c;
  if (curve > 0.0) best += 0.5 * resolution * (c - a) / curve;
  return best * test.test.sample_rate;
}

namespace {

using ForceLine = std::array<std::complex<double>, 3>;

// Estimates speed and, within one tooth period, phase of a cut. @return a note
std::string estimatePhase(const Dataset& data, TestData& t) {
  const PhaseEstimateOptions limits;
  const int teeth = data.nominal.tool->teeth;
  t.test.spindle_speed = refinedSpeed(t, teeth, limits.speed_share);
  sim::SimulationOptions options;
  options.noise = false;
  options.substeps = COARSE_SUBSTEPS;
  // Rotating the model changes only the phase of its tooth passing lines.
  setAngle(t, 0.0);
  const Record model = sim::simulateTest(data.nominal, t.test, t.record, options);
  const OrderLines lines = linesOf(data, t, model, t.first_cut, t.record.size(), teeth, limits.tooth_lines);
  double best = 0.0, largest = -1e300;
  for (int p = 0; p < limits.phases; ++p) {
    const double phase = TWO_PI / teeth * p / limits.phases, match = lines.match(phase);
    if (match > largest) {
      largest = match;
      best = phase;
    }
  }
  setAngle(t, best);
  return formatted("%s: no spindle angle; speed %.2f rpm and phase %.1f deg estimated from the forces",
                   t.test.name.c_str(), units::rpmFromRadPerSec(t.test.spindle_speed),
                   units::degFromRad(best));
}

// First-order line relative to the spindle angle.
ForceLine onceARevolution(const TestData& t) {
  ForceLine line{};
  const double phase = t.record.column("spindle_angle").front();
  for (std::size_t a = 0; a < 3; ++a) {
    if (t.record.has(FORCES[a]))
      line[a] = lineAt(t.record.column(FORCES[a]), beginOf(t), t.record.size(),
                       t.test.spindle_speed / t.test.sample_rate) *
                std::polar(1.0, -phase);
  }
  return line;
}

// Number of equal fractions of a revolution that aligns a line best with another.
int bestFraction(const ForceLine& line, const ForceLine& reference, int parts) {
  int best = 0;
  double largest = -1e300;
  for (int k = 0; k < parts; ++k) {
    double match = 0.0;
    for (std::size_t a = 0; a < 3; ++a)
      match += std::real(std::conj(reference[a]) * line[a] * std::polar(1.0, -TWO_PI * k / parts));
    if (match > largest) {
      largest = match;
      best = k;
    }
  }
  return best;
}

// Aligns all records with the one that has the strongest first-order line.
void alignTogether(const Dataset& data, const std::vector<TestData*>& estimated) {
  const auto strength = [](const ForceLine& l) {
    return std::norm(l[0]) + std::norm(l[1]) + std::norm(l[2]);
  };
  ForceLine reference{};
  for (const TestData* t : estimated) {
    const ForceLine line = onceARevolution(*t);
    if (strength(line) > strength(reference)) reference = line;
  }
  for (TestData* t : estimated) {
    // The cutting force leaves the tooth unknown; the angle of an air cut is unknown.
    const int parts = t->test.kind == TestKind::cut && data.nominal.tool ? data.nominal.tool->teeth : 360;
    const int best = bestFraction(onceARevolution(*t), reference, parts);
    if (best != 0) setAngle(*t, t->record.column("spindle_angle").front() + TWO_PI * best / parts);
  }
}

}  // namespace

std::vector<std::string> estimatePhases(Dataset& data) {
  std::vector<std::string> notes;
  std::vector<TestData*> estimated;
  for (TestData& t : data.tests) {
    if (!t.phase_estimated) continue;
    if (t.test.kind == TestKind::cut && data.nominal.tool) {
      notes.push_back(estimatePhase(data, t));
    } else {
      setAngle(t, 0.0);
    }
    estimated.push_back(&t);
  }
  if (estimated.size() > 1) alignTogether(data, estimated);
  return notes;
}

std::vector<AlignmentFreedom> alignmentFreedoms(const TestData& test) {
  std::vector<AlignmentFreedom> free;
  if (test.phase_estimated) {
    free.push_back({&RecordAlignment::phase, LIMITS.angle_std, LIMITS.angle_step});
    free.push_back({&RecordAlignment::drift, LIMITS.angle_std, LIMITS.angle_step});
  }
  if (test.test.kind == TestKind::cut && test.test.engage_time && !test.test.running_before)
    free.push_back({&RecordAlignment::entry, LIMITS.entry_std, LIMITS.entry_step});
  return free;
}

RecordAlignment alignmentBetween(const TestData& before, const TestData& now) {
  const double end = (now.test.spindle_speed - before.test.spindle_speed) * halfSpan(now);
  return {std::remainder(firstAngle(now) - firstAngle(before) + end, TWO_PI), end,
          now.early_entry - before.early_entry};
}

double alignedPhase(double phase, const RecordAlignment& by) {
  return phase + by.phase - by.drift;
}

double alignedSpeed(const TestData& test, double speed, const RecordAlignment& by) {
  return speed + by.drift / halfSpan(test);
}

void alignRecord(TestData& t, const RecordAlignment& by) {
  t.early_entry += by.entry;
  if (by.phase == 0.0 && by.drift == 0.0) return;
  t.test.spindle_speed = alignedSpeed(t, t.test.spindle_speed, by);
  setAngle(t, alignedPhase(firstAngle(t), by));
}

double alignPhases(Dataset& data, const MachineModel& model, double least) {
  const RotationOptions limits;
  double largest = 0.0;
  for (TestData& t : data.tests) {
    if (!t.phase_estimated) continue;
    sim::SimulationOptions options;
    options.noise = false;
    options.substeps = COARSE_SUBSTEPS;
    options.early_entry = t.early_entry;
    const Record simulated = sim::simulateTest(model, t.test, t.record, options);
    const std::size_t from = beginOf(t), end = t.record.size();
    const auto linesBetween = [&](std::size_t first, std::size_t last) {
      return linesOf(data, t, simulated, first, last, 1, limits.max_orders);
    };
    const OrderLines all = linesBetween(from, end);
    // A model without the lines that distinguish the teeth must not select another tooth.
    const int teeth = t.test.kind == TestKind::cut && data.nominal.tool ? data.nominal.tool->teeth : 1;
    double simulated_squares = 0.0, measured_squares = 0.0;
    for (std::size_t i = 0; i < all.simulated.size(); ++i) {
      if (teeth > 1 && all.orderOf(i) % teeth == 0) continue;
      simulated_squares += std::norm(all.simulated[i]);
      measured_squares += std::norm(all.measured[i]);
    }
    const double range_limit =
        simulated_squares > limits.min_simulated * measured_squares ? units::PI : units::PI / teeth;
    double rotation = all.best(0.0, range_limit, limits.all_phases);
    const auto samples = static_cast<double>(end - from);
    double size = 0.0;
    for (const auto& line : all.simulated) size += 4.0 * samples * std::norm(line);
    if (size < limits.min_gain) continue;
    // The phase difference between the halves of a record is the speed error.
    const double span = samples / t.test.sample_rate;
    double early = rotation, late = rotation;
    if (t.test.kind == TestKind::cut && span * t.test.spindle_speed > limits.min_revolutions * TWO_PI) {
      const std::size_t middle = from + (end - from) / 2;
      const double range = limits.nearby * TWO_PI / all.orders;
      early = linesBetween(from, middle).best(rotation, range, limits.nearby_phases);
      late = linesBetween(middle, end).best(rotation, range, limits.nearby_phases);
    }
    const double by =
        std::max(std::abs(std::remainder(early, TWO_PI)), std::abs(std::remainder(late, TWO_PI)));
    if (by < least) continue;
    rotation = 0.5 * (early + late);
    const double rate = (late - early) / (0.5 * span);  // [rad/s]
    const double at_start = rotation - rate * (0.5 * span + static_cast<double>(from) / t.test.sample_rate);
    const double phase = t.record.column("spindle_angle").front() + at_start;
    const TestData before = t;
    t.test.spindle_speed += rate;
    setAngle(t, phase);
    const Record realigned = sim::simulateTest(model, t.test, t.record, options);
    if (!(residualSquares(data, t, realigned) < residualSquares(data, t, simulated))) {
      t = before;
      continue;
    }
    largest = std::max(largest, by);
  }
  return largest;
}

}  // namespace smartmill::discrepancy
