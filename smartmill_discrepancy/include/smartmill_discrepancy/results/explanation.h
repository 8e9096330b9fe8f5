#pragma once

#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/explain/inspection_check.h"
#include "smartmill_discrepancy/results/candidate_result.h"
#include "smartmill_discrepancy/results/finding.h"
#include "smartmill_discrepancy/results/test_outcome.h"

namespace smartmill::discrepancy {

enum class Verdict {
  no_disagreement,  ///< the gap before is at the noise
  explained,
  partly_explained,
  unknown_effect,
  recalibrated,  ///< nothing is missing, but nominal values differ from the stated ones
};

/// As in report.json.
const char* nameOf(Verdict verdict);

/// A parameter of an effect with its standard deviation.
struct FoundParameter {
  std::string key;  ///< as in the model file
  double value = 0.0;
  double std_dev = 0.0;
  double modulo = 0.0;  ///< [deg] of an angle that is known up to multiples of it; 0: it is known

  /// The value as far as it is known: an angle from 0 to the modulus.
  double known() const { return modulo > 0.0 ? value - modulo * std::floor(value / modulo) : value; }
};

/// An effect fitted in place of another one.
struct Rival {
  std::string name;
  double delta_bic = 0.0;                  ///< BIC gain against the model without either
  std::vector<FoundParameter> parameters;  ///< without standard deviations
  double heldout_gap = 0.0;                ///< of the model with it; 0: no held-out tests
};

/// A nominal value that the records determine differently than the model states.
struct RecalibratedValue {
  std::string name;         ///< key in the model file, "cutting.ktc_n_per_mm2"
  double before = 0.0;      ///< [unit of the key] stated
  double after = 0.0;       ///< [unit of the key]
  double std_dev = 0.0;     ///< [unit of the key] of the value after
  double deviations = 0.0;  ///< [1] change of its logarithm over the stated relative uncertainty
};

struct FoundEffect {
  std::string name, variant;
  std::map<std::string, std::string> words;
  std::vector<FoundParameter> parameters;
  double delta_bic = 0.0;  ///< BIC gain against the model without it
  /// [1] share of the held-out squares above the noise that it removes
  double heldout_gap_reduction = 0.0;
  /// [1] probability that it reduces the gap of tests outside the fit, compared with no effect and with each
  /// alternative (ValidationResult) except those of not_separable that predict the same in every test
  double confidence = 0.0;
  double presence = 0.0;            ///< [1] the same compared with no effect only
  double heldout_without = 0.0;     ///< gap of the model refitted without it; 0: no held-out tests
  std::vector<Rival> alternatives;  ///< other effects instead of it
};

/// Rejected effect of the catalogue that is closest to the residual.
struct Resemblance {
  std::string name, variant, reason;
};

/// Gap of one channel of one test before and after.
struct TestGap {
  std::string test, channel;
  bool heldout = false;
  double before = 0.0, after = 0.0;
  double std_dev = 0.0;  ///< of a gap at the noise floor
};

/// One channel over all cuts: shares of the variance that the models explain and that is synchronous with the
/// spindle.
struct ChannelShare {
  std::string channel;
  double explained_before = 0.0,
         explained_after = 0.0;             ///< [1] of the variance; below 0: worse than the mean
  std::optional<double> explained_heldout;  ///< [1] after, held-out cuts only
  std::optional<double> synchronous_share;  ///< [1] of the variance; absent for short cuts
  double floor = 0.0;                       ///< [unit of the channel] RMS of the asynchronous part
  double floor_gap = 0.0;  ///< [1] floor over noise: the gap of the best model of steady cuts
};

/// One channel of one test over the spindle angle: binned mean of the revolutions.
struct RevolutionCurve {
  std::string test, channel;
  std::vector<double> angle_deg, measured, nominal, improved;  ///< [deg], [unit of the channel]
};

/// [Hz] Highest frequency of spectra in pictures: forces of milling are below.
constexpr double HIGHEST_PICTURED = 4000.0;

/// Amplitude spectrum of the residual before and after.
struct SpectrumCurve {
  std::string test, channel;
  double order_hz = 0.0;                            ///< frequency of order 1; 0 at standstill
  std::vector<double> frequency_hz, before, after;  ///< [Hz], [unit of the channel]
};

/// A chattering cut, compared by one-step prediction.
struct ChatteringCut {
  std::string test;
  double frequency = 0.0, amplitude = 0.0;  ///< [Hz], [N] of the chatter
  /// [1] RMS of the prediction error over the channel's standard deviation, the largest of fx, fy, tool_x and
  /// tool_y
  double before = 0.0, after = 0.0;
};

/// A test of the campaign.
struct ReportedTest {
  CampaignTest test;
  double duration = 0.0;  ///< [s] of its record
  bool heldout = false;
  bool left_out = false;  ///< it chatters and is not compared
};

struct GapPair {
  double fit = 0.0, heldout = 0.0;
};

/// An effect of the catalogue that the tests of a campaign cannot show.
struct Untestable {
  std::string effect, reason;
};

/// Result of explain (formats.md section 3).
struct Explanation {
  Verdict verdict = Verdict::no_disagreement;
  std::vector<Finding> where, unexplained;
  std::vector<FoundEffect> effects;
  std::vector<RecalibratedValue> recalibrated;  ///< of this verdict; most deviations first
  std::vector<Resemblance> resembles;
  std::vector<std::vector<std::string>> not_separable;
  std::optional<std::string> suggested_test;
  std::optional<CampaignTest> suggested_cut;  ///< suggested_test for programs
  std::optional<TestOutcome> outcome;         ///< predictions of suggested_cut
  GapPair before, after;
  std::optional<GapPair> named_only;  ///< gap without the empirical effects, if there are any
  std::string sentence;               ///< summary for the machinist; may be empty
  std::vector<TestGap> gaps;
  std::vector<ChannelShare> channels;
  std::vector<CandidateResult> candidates;
  std::vector<std::string> notes;
  std::vector<std::string> stream_shifts;  ///< corrected, one line each
  std::vector<Untestable> untestable;
  InspectionCheck inspection;             ///< with --inspection
  std::vector<ChatteringCut> chattering;  ///< used in the fit
  std::vector<RevolutionCurve> revolutions;
  std::vector<SpectrumCurve> spectra;
  std::vector<ReportedTest> tests;
  std::map<std::string, double> noise;  ///< RMS of each channel [unit of the channel]
  MachineModel nominal;                 ///< the supplied model
  MachineModel model;                   ///< the corrected model, as written
  std::vector<RecalibratedValue>
      calibrated;                      ///< all free values of the corrected model, most deviations first
  std::size_t testable = 0;            ///< effects of the catalogue that the records can show
  bool interrupted = false;            ///< cancelled: effects found until then
  std::optional<double> spent_budget;  ///< [s] time budget that ended a stage: effects found until then
  std::vector<std::string> not_tried;  ///< effects of the catalogue that either has left untried
  double seconds = 0.0;
};

/// Whether two names are equal, or not separable by the tests of this explanation.
bool standsFor(const Explanation& explanation, const std::string& named, const std::string& other);

}  // namespace smartmill::discrepancy
