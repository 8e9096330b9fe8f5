#include "smartmill_launch/report/session_report.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::report {
namespace {

using session::CutVerdict;

// Targets [percent]: Ktc (Dunwoody reached 11), tool modes, speeds of pockets, range of the compensated
// force, and minimum error of the raw force at the resonance of the sensor.
constexpr double KTC_TARGET = 3.0, FREQUENCY_TARGET = 0.5, STIFFNESS_TARGET = 5.0, POCKET_TARGET = 1.0;
constexpr double RANGE_TARGET = 5.0, RAW_TARGET = 30.0;
constexpr double LEAST_RANGE = 0.2;      // [1] of the largest axis; axes below have no target
constexpr double POCKET_FACTOR = 1.3;    // [1] over the adjacent minima
constexpr double POCKET_CEILING = 20.0;  // [1] of the absolute limit
constexpr int MOST_POCKETS = 4;
constexpr int WINDOW_REVOLUTIONS = 16;
constexpr const char* AXES = "xyz";
constexpr const char* RESONANCE = "resonance";

template <class Item>
const Item* find(const std::vector<Item>& items, const std::string& point, const std::string& direction) {
  for (const Item& item : items) {
    if (item.point == point && item.direction == direction) return &item;
  }
  return nullptr;
}

Section coefficientSection(const SessionRecording& recording) {
  Section section{"Cutting coefficients", {}};
  if (!recording.coefficients) return section;
  const CoefficientSet& set = *recording.coefficients;
  const CuttingCoefficients truth =
      recording.true_coefficients ? recording.true_coefficients->value : NOT_IDENTIFIED;
  section.figures.push_back({"Ktc",
                             "N/mm2",
                             set.value.ktc / units::N_PER_MM2,
                             set.std_dev.ktc / units::N_PER_MM2,
                             truth.ktc / units::N_PER_MM2,
                             {KTC_TARGET, false}});
  section.figures.push_back({"Kte",
                             "N/mm",
                             set.value.kte / units::N_PER_MM,
                             set.std_dev.kte / units::N_PER_MM,
                             truth.kte / units::N_PER_MM,
                             {}});
  return section;
}

void addMode(Section& section, const std::string& name, const Mode* measured, const Mode* truth, bool tool) {
  Mode none;
  none.frequency = none.damping_ratio = none.gain = NOT_A_NUMBER;
  const Mode& m = measured ? *measured : none;
  const Mode& t = truth ? *truth : none;
  section.figures.push_back({name + " frequency", "Hz", m.frequency, m.frequency_std, t.frequency,
                             tool ? Target{FREQUENCY_TARGET, false} : Target{}});
  section.figures.push_back({name + " damping",
                             "%",
                             100.0 * m.damping_ratio,
                             100.0 * m.damping_ratio_std,
                             100.0 * t.damping_ratio,
                             {}});
  if (tool) {
    const auto [stiffness, std_dev] = stiffnessOf(m);
    section.figures.push_back({name + " stiffness",
                               "N/um",
                               stiffness / units::N_PER_UM,
                               std_dev / units::N_PER_UM,
                               stiffnessOf(t).first / units::N_PER_UM,
                               {STIFFNESS_TARGET, false}});
  } else {
    section.figures.push_back({name + " gain", "1", m.gain, m.gain_std, t.gain, {}});
  }
}

Section modeSection(const SessionRecording& recording, const std::string& point) {
  const bool tool = point == POINT_TOOL_TIP;
  Section section{tool ? "Tool-tip modes" : "Force-sensor modes", {}};
  for (const char* axis = AXES; *axis; ++axis) {
    const MeasuredModes* measured = recording.modal(false, point, {*axis});
    const MeasuredModes* truth = recording.modal(true, point, {*axis});
    if (!measured) continue;
    const std::vector<Mode> true_modes = truth ? truth->model.modes : std::vector<Mode>{};
    const auto match = matchModes(measured->model.modes, true_modes);
    std::vector<bool> found(true_modes.size(), false);
    const std::string prefix = std::string(1, *axis) + " mode ";
    for (std::size_t i = 0; i < match.size(); ++i) {
      if (match[i]) found[*match[i]] = true;
      addMode(section, prefix + std::to_string(i + 1), &measured->model.modes[i],
              match[i] ? &true_modes[*match[i]] : nullptr, tool);
    }
    for (std::size_t j = 0; j < true_modes.size(); ++j) {
      if (!found[j])
        addMode(section, std::string(1, *axis) + " mode not found", nullptr, &true_modes[j], tool);
    }
  }
  return section;
}

/// Length of measured minus true over that of true, on the measured lines in the band.
std::string frfNote(const MeasuredFrf& measured, const MeasuredFrf* truth) {
  constexpr double LOW = 200.0, HIGH = 3500.0;  // [Hz] band of the hammer's fits
  constexpr double COHERENT = 0.9;              // [1] lines below are dominated by noise
  const FrequencyResponse band = measured.frf.band(LOW, HIGH);
  double error = 0.0, all = 0.0;
  std::vector<double> coherence;
  for (std::size_t i = 0; i < band.size(); ++i) {
    if (i < band.coherence.size() && std::isfinite(band.coherence[i])) {
      coherence.push_back(band.coherence[i]);
      if (band.coherence[i] < COHERENT) continue;
    }
    if (!truth || band.frequency[i] < truth->frf.frequency.front() ||
        band.frequency[i] > truth->frf.frequency.back()) {
      continue;
    }
    const std::complex<double> value = truth->frf.at(band.frequency[i]);
    error += std::norm(band.value[i] - value);
    all += std::norm(value);
  }
  std::string note = "FRF of the tool in " + measured.direction + formatted(", %.0f..%.0f Hz: ", LOW, HIGH) +
                     std::to_string(measured.frf.averages) + " hits";
  if (!coherence.empty()) note += formatted(", median coherence %.4f", median(coherence));
  if (all > 0.0)
    note += formatted(", measured minus true is %.2f %% of true where the coherence exceeds 0.9",
                      100.0 * std::sqrt(error / all));
  return note;
}

Section chartSection(const SessionRecording& recording, const TrueStability& true_stability,
                     const std::vector<CutCheck>& cuts) {
  const std::optional<StabilityChart>& true_chart = true_stability.chart;
  Section section{"Stability chart", {}};
  if (!recording.chart) return section;
  const StabilityChart& chart = *recording.chart;
  for (const CutCheck& cut : cuts) {
    section.figures.push_back(
        {"limit at" + formatted(" %.0f rpm", units::rpmFromRadPerSec(cut.spindle_speed)),
         "mm",
         cut.limit / units::MM,
         NOT_A_NUMBER,
         cut.true_limit / units::MM,
         {}});
  }
  section.figures.push_back({"limit at any speed",
                             "mm",
                             chart.absolute_depth_limit / units::MM,
                             NOT_A_NUMBER,
                             true_chart ? true_chart->absolute_depth_limit / units::MM : NOT_A_NUMBER,
                             {}});
  const auto pocketsOf = [](const StabilityChart& curve) {
    const double least = *std::min_element(curve.limit.depth.begin(), curve.limit.depth.end());
    return pockets(curve.limit.spindle_speed, curve.limit.depth, POCKET_FACTOR, POCKET_CEILING * least);
  };
  if (chart.limit.depth.empty()) return section;
  const std::vector<Pocket> measured = pocketsOf(chart);
  const std::vector<Pocket> truth = true_chart ? pocketsOf(*true_chart) : std::vector<Pocket>{};
  int listed_pockets = 0;
  for (auto pocket = measured.rbegin(); pocket != measured.rend() && listed_pockets < MOST_POCKETS;
       ++pocket) {
    double nearest = NOT_A_NUMBER;
    for (const Pocket& other : truth) {
      if (std::isnan(nearest) ||
          std::abs(other.spindle_speed - pocket->spindle_speed) < std::abs(nearest - pocket->spindle_speed)) {
        nearest = other.spindle_speed;
      }
    }
    section.figures.push_back({"pocket " + std::to_string(++listed_pockets),
                               "rpm",
                               units::rpmFromRadPerSec(pocket->spindle_speed),
                               NOT_A_NUMBER,
                               units::rpmFromRadPerSec(nearest),
                               {POCKET_TARGET, false},
                               !true_stability.failure.empty()});
  }
  return section;
}

Section forceSection(const RecordedCut& cut, std::vector<std::string>& notes) {
  Section section{
      "Range of the force, 10th to 90th percentile, tooth passing frequency at the sensor's resonance", {}};
  const auto [from, to] = evaluatedSamples(cut, SETTLE_REVOLUTIONS);
  if (from == to) {
    notes.push_back("cut " + cut.condition.name + ": no steady samples with settled compensation");
    return section;
  }
  std::array<double, 3> truth{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    truth[axis] = cut.truth.empty() ? NOT_A_NUMBER : middleRange(cut.truth.axis(axis, from, to));
  }
  const double largest = *std::max_element(truth.begin(), truth.end());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::string name = std::string(1, AXES[axis]);
    Figure raw{name + " raw", "N", middleRange(cut.raw.axis(axis, from, to)), NOT_A_NUMBER, truth[axis], {}};
    Figure compensated{name + " compensated", "N",         middleRange(cut.compensated.axis(axis, from, to)),
                       NOT_A_NUMBER,          truth[axis], {}};
    // With a small force the range is that of the sensor noise.
    if (truth[axis] >= LEAST_RANGE * largest) {
      compensated.target = {RANGE_TARGET, false};
      raw.target = {RAW_TARGET, true};
    }
    section.figures.push_back(raw);
    section.figures.push_back(compensated);
  }
  const double revolutions = static_cast<double>(to - from) / cut.compensated.sampleRate() *
                             cut.condition.spindle_speed / units::TWO_PI;
  notes.push_back("force at " + formatted("%.0f rpm over %.0f revolutions",
                                          units::rpmFromRadPerSec(cut.condition.spindle_speed), revolutions));
  return section;
}

CutCheck checkOf(const SessionRecording& recording, const RecordedCut& cut, double true_limit) {
  CutCheck check;
  check.name = cut.condition.name;
  check.spindle_speed = cut.condition.spindle_speed;
  check.axial_depth = cut.condition.engagement.axial_depth;
  check.true_limit = true_limit;
  check.verdict = session::cutVerdict(cut.windows);
  if (recording.chart) {
    check.limit =
        interpolate(recording.chart->limit.spindle_speed, recording.chart->limit.depth, check.spindle_speed);
    check.predicted = check.axial_depth < check.limit ? CutVerdict::Kind::stable : CutVerdict::Kind::chatter;
  }
  if (!cut.truth.empty() && std::isfinite(cut.steady_from)) {
    const auto [from, to] =
        cut.truth.covered(cut.truth.indexAt(cut.steady_from), cut.truth.indexAt(cut.steady_to));
    check.nonperiodic =
        nonperiodicShare(cut.truth.axis(0, from, to),
                         cut.truth.sampleRate() * units::TWO_PI / check.spindle_speed, WINDOW_REVOLUTIONS);
  }
  return check;
}

}  // namespace

const MeasuredFrf* SessionRecording::frf(bool true_one, const std::string& point,
                                         const std::string& direction) const {
  return find(true_one ? true_frfs : frfs, point, direction);
}

const MeasuredModes* SessionRecording::modal(bool true_one, const std::string& point,
                                             const std::string& direction) const {
  return find(true_one ? true_modes : modes, point, direction);
}

const RecordedCut* SessionRecording::cut(const std::string& name) const {
  for (const RecordedCut& cut : cuts) {
    if (cut.condition.name == name) return &cut;
  }
  return nullptr;
}

std::pair<std::uint64_t, std::uint64_t> evaluatedSamples(const RecordedCut& cut, double settle_revolutions) {
  if (!std::isfinite(cut.steady_from) || cut.raw.empty() || cut.compensated.empty()) return {0, 0};
  const double settle = settle_revolutions * units::TWO_PI / cut.condition.spindle_speed;
  if (cut.steady_from + settle >= cut.steady_to) return {0, 0};
  auto range = cut.compensated.covered(cut.compensated.indexAt(cut.steady_from + settle),
                                       cut.compensated.indexAt(cut.steady_to), true);
  range = cut.raw.covered(range.first, range.second);
  return cut.truth.empty() ? range : cut.truth.covered(range.first, range.second);
}

Report makeReport(const SessionRecording& recording, const TrueStability& truth) {
  Report report;
  for (std::size_t i = 0; i < recording.cuts.size(); ++i) {
    const RecordedCut& cut = recording.cuts[i];
    if (cut.condition.name.rfind("verify_", 0) != 0) continue;
    report.cuts.push_back(checkOf(recording, cut, i < truth.limits.size() ? truth.limits[i] : NOT_A_NUMBER));
  }
  report.sections.push_back(coefficientSection(recording));
  report.sections.push_back(modeSection(recording, POINT_TOOL_TIP));
  report.sections.push_back(modeSection(recording, POINT_FORCE_SENSOR));
  report.sections.push_back(chartSection(recording, truth, report.cuts));
  for (const char* axis = AXES; *axis; ++axis) {
    if (const MeasuredFrf* measured = recording.frf(false, POINT_TOOL_TIP, {*axis})) {
      report.notes.push_back(frfNote(*measured, recording.frf(true, POINT_TOOL_TIP, {*axis})));
    }
  }
  if (const RecordedCut* cut = recording.cut(RESONANCE)) {
    report.sections.push_back(forceSection(*cut, report.notes));
  }
  if (!truth.failure.empty()) report.notes.push_back("NOT CHECKED: " + truth.failure);
  report.notes.push_back("recording of" + formatted(" %.0f s", recording.duration));
  report.sections.erase(std::remove_if(report.sections.begin(), report.sections.end(),
                                       [](const Section& section) { return section.figures.empty(); }),
                        report.sections.end());
  return report;
}

std::size_t Report::targets() const {
  std::size_t count = cuts.size() + unchecked.size();
  for (const Section& section : sections) {
    for (const Figure& figure : section.figures) count += figure.met() || figure.unchecked ? 1 : 0;
  }
  return count;
}

std::size_t Report::met() const {
  std::size_t count = 0;
  for (const CutCheck& cut : cuts) count += cut.met() ? 1 : 0;
  for (const Section& section : sections) {
    for (const Figure& figure : section.figures) count += figure.met().value_or(false) ? 1 : 0;
  }
  return count;
}

}  // namespace smartmill::report
