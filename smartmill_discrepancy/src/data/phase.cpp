#include "smartmill_discrepancy/data/phase.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

using units::TWO_PI;

std::complex<double> lineAt(const std::vector<double>& values, std::size_t from, std::size_t to,
                            double step) {
  std::complex<double> sum = 0.0, turn = std::polar(1.0, -step),
                       at = std::polar(1.0, -step * static_cast<double>(from));
  for (std::size_t i = from; i < to; ++i) {
    sum += values[i] * at;
    at *= turn;
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

// First sample in cut, of an air cut the first.
std::size_t beginOf(const TestData& t) {
  return t.first_cut < t.record.size() ? t.first_cut : 0;
}

/// Lines of a record and of a model at orders of the spindle, forces over their noise.
struct Lines {
  std::vector<std::complex<double>> measured, simulated;  // lowest order first, one channel after the other
  int orders = 0;                                         // a channel
  int spacing = 1;                                        // the lowest order, and from one to the next

  int orderOf(std::size_t line) const { return (static_cast<int>(line) % orders + 1) * spacing; }

  /// How well they agree when the model is turned by a phase [rad]: half of the squares it takes away.
  double match(double phase) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < measured.size(); ++i)
      sum += std::real(std::conj(simulated[i] * std::polar(1.0, orderOf(i) * phase)) * measured[i]);
    return sum;
  }

  /// Best phase near one, within a range [rad] each way.
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

// Every order of the spindle (spacing 1) or those of the tooth passing, as many as the sampling holds.
Lines linesOf(const Dataset& data, const TestData& t, const Record& model, std::size_t from, std::size_t to,
              int spacing, int most) {
  const double step = spacing * t.test.spindle_speed / t.test.sample_rate;
  Lines lines;
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

// Squares over noise that a simulation leaves of a record's forces.
double squaresLeft(const Dataset& data, const TestData& t, const Record& simulated) {
  double squares = 0.0;
  for (const std::string& channel : FORCES) {
    if (!t.record.has(channel) || data.noise.count(channel) == 0) continue;
    const std::vector<double>&a = t.record.column(channel), &b = simulated.column(channel);
    for (std::size_t i = 0; i < a.size(); ++i) squares += std::pow((a[i] - b[i]) / data.noise.at(channel), 2);
  }
  return squares;
}

}  // namespace

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

// Gives a cut its speed and, within one tooth period, its phase. @return a note
std::string estimatePhase(const Dataset& data, TestData& t) {
  constexpr double SPEED_SHARE = 0.01;
  constexpr int PHASES = 240, TOOTH_LINES = 4;
  const int teeth = data.nominal.tool->teeth;
  t.test.spindle_speed = refinedSpeed(t, teeth, SPEED_SHARE);
  sim::SimulationOptions options;
  options.noise = false;
  options.substeps = 2;
  // Of the lines of the tooth passing only the phase turns.
  setAngle(t, 0.0);
  const Record model = sim::simulateTest(data.nominal, t.test, t.record, options);
  const Lines lines = linesOf(data, t, model, t.first_cut, t.record.size(), teeth, TOOTH_LINES);
  double best = 0.0, largest = -1e300;
  for (int p = 0; p < PHASES; ++p) {
    const double phase = TWO_PI / teeth * p / PHASES, match = lines.match(phase);
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

// Line of once a revolution against the spindle angle.
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

// By how many of equal parts of a turn a line agrees best with another.
int bestPart(const ForceLine& line, const ForceLine& reference, int parts) {
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

// Turns all records like the one with the strongest line of once a revolution.
void turnAlike(const Dataset& data, const std::vector<TestData*>& turned) {
  const auto strength = [](const ForceLine& l) {
    return std::norm(l[0]) + std::norm(l[1]) + std::norm(l[2]);
  };
  ForceLine reference{};
  for (const TestData* t : turned) {
    const ForceLine line = onceARevolution(*t);
    if (strength(line) > strength(reference)) reference = line;
  }
  for (TestData* t : turned) {
    // The force of the cut has left the tooth open, an air cut any angle.
    const int parts = t->test.kind == TestKind::cut && data.nominal.tool ? data.nominal.tool->teeth : 360;
    const int best = bestPart(onceARevolution(*t), reference, parts);
    if (best != 0) setAngle(*t, t->record.column("spindle_angle").front() + TWO_PI * best / parts);
  }
}

}  // namespace

std::vector<std::string> estimatePhases(Dataset& data) {
  std::vector<std::string> notes;
  std::vector<TestData*> turned;
  for (TestData& t : data.tests) {
    if (!t.phase_estimated) continue;
    if (t.test.kind == TestKind::cut && data.nominal.tool) {
      notes.push_back(estimatePhase(data, t));
    } else {
      setAngle(t, 0.0);
    }
    turned.push_back(&t);
  }
  if (turned.size() > 1) turnAlike(data, turned);
  return notes;
}

std::vector<TurnFreedom> turnFreedoms(const TestData& test) {
  // Programs and machines let the force come on at once or over some part of a sample.
  constexpr double ENTRY_STD = 0.1, ENTRY_STEP = 0.02;  // [samples]
  constexpr double ANGLE_STD = 1.0, ANGLE_STEP = 1e-4;  // [rad]
  std::vector<TurnFreedom> free;
  if (test.phase_estimated) {
    free.push_back({&Turn::middle, ANGLE_STD, ANGLE_STEP});
    free.push_back({&Turn::end, ANGLE_STD, ANGLE_STEP});
  }
  if (test.test.kind == TestKind::cut && test.test.engage_time && !test.test.running_before)
    free.push_back({&Turn::entry, ENTRY_STD, ENTRY_STEP});
  return free;
}

Turn turnBetween(const TestData& before, const TestData& now) {
  const double end = (now.test.spindle_speed - before.test.spindle_speed) * halfSpan(now);
  return {std::remainder(firstAngle(now) - firstAngle(before) + end, TWO_PI), end,
          now.early_entry - before.early_entry};
}

double turnedPhase(double phase, const Turn& by) {
  return phase + by.middle - by.end;
}

double turnedSpeed(const TestData& test, double speed, const Turn& by) {
  return speed + by.end / halfSpan(test);
}

void turnRecord(TestData& t, const Turn& by) {
  t.early_entry += by.entry;
  if (by.middle == 0.0 && by.end == 0.0) return;
  t.test.spindle_speed = turnedSpeed(t, t.test.spindle_speed, by);
  setAngle(t, turnedPhase(firstAngle(t), by));
}

double turnPhases(Dataset& data, const MachineModel& model, double least) {
  constexpr double LEAST_GAIN = 25.0;   // of squares over noise: less tells no phase
  constexpr double LEAST_SHOWN = 0.05;  // squares of the lines beside those of the tooth passing
  constexpr int ALL_ROUND = 1440, NEAR = 40, MOST_ORDERS = 60;
  double largest = 0.0;
  for (TestData& t : data.tests) {
    if (!t.phase_estimated) continue;
    sim::SimulationOptions options;
    options.noise = false;
    options.substeps = 2;
    options.early_entry = t.early_entry;
    const Record simulated = sim::simulateTest(model, t.test, t.record, options);
    const std::size_t from = beginOf(t), end = t.record.size();
    const auto linesBetween = [&](std::size_t first, std::size_t last) {
      return linesOf(data, t, simulated, first, last, 1, MOST_ORDERS);
    };
    const Lines all = linesBetween(from, end);
    // A model that shows little of what tells the teeth apart must not choose another tooth.
    const int teeth = t.test.kind == TestKind::cut && data.nominal.tool ? data.nominal.tool->teeth : 1;
    double shown = 0.0, seen = 0.0;
    for (std::size_t i = 0; i < all.simulated.size(); ++i) {
      if (teeth > 1 && all.orderOf(i) % teeth == 0) continue;
      shown += std::norm(all.simulated[i]);
      seen += std::norm(all.measured[i]);
    }
    const double reach = shown > LEAST_SHOWN * seen ? units::PI : units::PI / teeth;
    double turn = all.best(0.0, reach, ALL_ROUND);
    const auto samples = static_cast<double>(end - from);
    double size = 0.0;
    for (const auto& line : all.simulated) size += 4.0 * samples * std::norm(line);
    if (size < LEAST_GAIN) continue;
    // What the halves of a record differ by is the speed.
    const double span = samples / t.test.sample_rate;
    double early = turn, late = turn;
    if (t.test.kind == TestKind::cut && span * t.test.spindle_speed > 4.0 * TWO_PI) {
      const std::size_t middle = from + (end - from) / 2;
      const double range = 0.25 * TWO_PI / all.orders;
      early = linesBetween(from, middle).best(turn, range, NEAR);
      late = linesBetween(middle, end).best(turn, range, NEAR);
    }
    const double by =
        std::max(std::abs(std::remainder(early, TWO_PI)), std::abs(std::remainder(late, TWO_PI)));
    if (by < least) continue;
    turn = 0.5 * (early + late);
    const double rate = (late - early) / (0.5 * span);  // [rad/s]
    const double at_start = turn - rate * (0.5 * span + static_cast<double>(from) / t.test.sample_rate);
    const double phase = t.record.column("spindle_angle").front() + at_start;
    const TestData before = t;
    t.test.spindle_speed += rate;
    setAngle(t, phase);
    const Record turned = sim::simulateTest(model, t.test, t.record, options);
    if (!(squaresLeft(data, t, turned) < squaresLeft(data, t, simulated))) {
      t = before;
      continue;
    }
    largest = std::max(largest, by);
  }
  return largest;
}

}  // namespace smartmill::discrepancy
