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

/// A cut of the session and what was seen of it.
struct RecordedCut {
  CuttingCondition condition;
  double ends = NOT_A_NUMBER;  ///< [s] stamp of the condition after it; NaN: none came
  double steady_from = NOT_A_NUMBER,
         steady_to = NOT_A_NUMBER;  ///< [s] at speed on the steady path; NaN: never
  std::vector<session::ChatterWindow> windows;
  ForceTrack raw, compensated, truth;  ///< while it ran
};

/// Everything that the report needs of a recorded session.
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

/// A cut that checks the chart.
struct CutCheck {
  std::string name;
  double spindle_speed = 0.0, axial_depth = 0.0;                       ///< [rad/s], [m]
  double limit = NOT_A_NUMBER, true_limit = NOT_A_NUMBER;              ///< [m]
  session::CutVerdict::Kind due = session::CutVerdict::Kind::unknown;  ///< what the chart says
  session::CutVerdict verdict;                                         ///< what the detector said
  double nonperiodic = NOT_A_NUMBER;  ///< [1] share of the true force that does not repeat every revolution
  bool met() const { return verdict.kind == due; }
};

struct Section {
  std::string title;
  std::vector<Figure> figures;
};

/// Stability limit computed from the truth that a simulator has recorded.
struct TrueStability {
  std::optional<StabilityChart> chart;  ///< empty: no truth recorded, or not computed
  std::vector<double> limits;           ///< [m] at the speed of each recorded cut; NaN or empty: not known
  std::string failure;  ///< why it was not computed although the truth is known; empty: it was
};

struct Report {
  std::vector<Section> sections;
  std::vector<CutCheck> cuts;
  std::vector<std::string> notes;
  std::vector<std::string> unchecked;  ///< what a session that failed did not measure: each one target
  std::size_t targets() const;         ///< figures with a verdict or not checked, cuts, what is unchecked
  std::size_t met() const;             ///< of these
};

/// The samples that a cut is judged by: in its steady stretch, there in all three recordings, compensation
/// settled. Empty (first == second) when there are none.
std::pair<std::uint64_t, std::uint64_t> judgedSamples(const RecordedCut& cut, double settle_revolutions);

/// Steps that failed, with the reason; then what the recording lacks for them. Empty when no step failed.
/// @param session JSON text that the session wrote @throws Error when it is not JSON
std::vector<std::string> notMeasured(const SessionRecording& recording, const std::string& session);

Report makeReport(const SessionRecording& recording, const TrueStability& truth);

/// Tables for people, in markdown with aligned columns.
std::string markdown(const Report& report);
/// The same for programs. @param session JSON text that the session wrote; empty: none
std::string json(const Report& report, const std::string& session);

}  // namespace smartmill::report
