#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/cutting/stability_chart.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_launch/report/report_statistics.h"
#include "smartmill_launch/session/session_plan.h"

namespace smartmill::report {

/// A cut of the session and its measurements.
struct RecordedCut {
  CuttingCondition condition;
  double ends = NOT_A_NUMBER;  ///< [s] stamp of the next condition; NaN: none
  double steady_from = NOT_A_NUMBER,
         steady_to = NOT_A_NUMBER;  ///< [s] at speed on the steady path; NaN: never
  std::vector<session::ChatterWindow> windows;
  ForceTrack raw, compensated, truth;  ///< during the cut
};

/// Contents of a recorded session that the report uses.
struct SessionRecording {
  std::vector<MeasuredFrf> frfs, true_frfs;
  std::vector<MeasuredModes> modes, true_modes;
  std::optional<CoefficientSet> coefficients, true_coefficients;
  std::optional<StabilityChart> chart;
  std::vector<RecordedCut> cuts;
  double duration = 0.0;  ///< [s] of the recording

  const MeasuredFrf* frf(bool true_one, const std::string& point, const std::string& direction) const;
  const MeasuredModes* modal(bool true_one, const std::string& point, const std::string& direction) const;
  const RecordedCut* cut(const std::string& name) const;
};

/// A cut that verifies the chart.
struct CutCheck {
  std::string name;
  double spindle_speed = 0.0, axial_depth = 0.0;                             ///< [rad/s], [m]
  double limit = NOT_A_NUMBER, true_limit = NOT_A_NUMBER;                    ///< [m]
  session::CutVerdict::Kind predicted = session::CutVerdict::Kind::unknown;  ///< by the chart
  session::CutVerdict verdict;                                               ///< of the detector
  double nonperiodic =
      NOT_A_NUMBER;  ///< [1] share of the true force that is not synchronous with the spindle
  bool met() const { return verdict.kind == predicted; }
};

struct Section {
  std::string title;
  std::vector<Figure> figures;
};

/// Stability limit computed from the true machine of a simulator's recording.
struct TrueStability {
  std::optional<StabilityChart> chart;  ///< empty: truth not recorded, or limit not computed
  std::vector<double> limits;           ///< [m] at the speed of each recorded cut; NaN or empty: unknown
  std::string failure;  ///< why the limit of a known truth was not computed; empty: no failure
};

struct Report {
  std::vector<Section> sections;
  std::vector<CutCheck> cuts;
  std::vector<std::string> notes;
  std::vector<std::string> unchecked;  ///< results that a failed session lacks: one target each
  std::size_t targets() const;         ///< figures with a verdict or not checked, cuts and unchecked results
  std::size_t met() const;             ///< of these
};

constexpr double SETTLE_REVOLUTIONS = 10.0;  ///< after which the compensation has settled

/// Samples on which a cut is evaluated: during steady cutting, in all recorded forces, compensation settled.
/// Empty (first == second) if there are none.
std::pair<std::uint64_t, std::uint64_t> evaluatedSamples(const RecordedCut& cut, double settle_revolutions);

/// Failed steps with the reason, then the results that the recording lacks. Empty if no step failed.
/// @param session JSON text of the session @throws Error if it is not JSON
std::vector<std::string> notMeasured(const SessionRecording& recording, const std::string& session);

Report makeReport(const SessionRecording& recording, const TrueStability& truth);

/// Tables in Markdown with aligned columns.
std::string markdown(const Report& report);
/// The report as JSON. @param session JSON text of the session, included; empty: none
std::string json(const Report& report, const std::string& session);

/// Length of the test plan with the knowledge of the database, and the stored coefficients next to those with
/// the new tests. @param session JSON summary; empty: no notes
std::vector<std::string> testPlanNotes(const std::string& session);

}  // namespace smartmill::report
