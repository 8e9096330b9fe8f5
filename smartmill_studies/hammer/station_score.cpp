#include "hammer/station_score.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <complex>
#include <functional>
#include <optional>

#include "hammer/station_draw.h"
#include "hammer/station_machine.h"
#include "smartmill_hammer/analysis/offset_factor.h"

namespace smartmill::hammer {
namespace {

using nlohmann::json;

constexpr double SAME_MODE = 0.015;  // [1] of the frequency
constexpr double SHOWS = 0.05;       // [1] of the largest peak, for a mode to be scored

struct Truth {
  ModalModel tip, measured;  // the same modes
};

double peak(const Mode& mode) {
  return std::abs(mode.gain) / (2.0 * mode.damping_ratio);
}

double largestPeak(const ModalModel& model) {
  double largest = 0.0;
  for (const Mode& mode : model.modes) {
    if (mode.frequency > BAND_LOW && mode.frequency < BAND_HIGH) largest = std::max(largest, peak(mode));
  }
  return largest;
}

/// The fitted mode that matches a true one, unless a stronger true mode is as near to it.
std::optional<std::size_t> shownAs(const Truth& truth, std::size_t k, const std::vector<Mode>& fitted) {
  const Mode& mode = truth.measured.modes[k];
  for (std::size_t j = 0; j < truth.measured.modes.size(); ++j) {
    const Mode& other = truth.measured.modes[j];
    if (std::abs(other.frequency / mode.frequency - 1.0) < SAME_MODE && peak(other) > peak(mode)) return {};
  }
  std::optional<std::size_t> best;
  for (std::size_t i = 0; i < fitted.size(); ++i) {
    const double off = std::abs(fitted[i].frequency / mode.frequency - 1.0);
    if (off < SAME_MODE && (!best || off < std::abs(fitted[*best].frequency / mode.frequency - 1.0)))
      best = i;
  }
  return best;
}

/// The corrected mode of a measured one.
const Mode* atTip(const std::vector<Mode>& tip, const Mode& measured) {
  for (const Mode& m : tip) {
    if (m.frequency == measured.frequency) return &m;
  }
  return nullptr;
}

json modeLines(const Truth& truth, const MeasureFrfResult& result, double factor, json& line) {
  const std::vector<Mode>& fitted = result.measured.modes;
  json modes = json::array();
  const double tip_peak = largestPeak(truth.tip), shown_peak = largestPeak(truth.measured);
  std::vector<bool> used(fitted.size(), false);
  int missed = 0, alone = 0;
  for (std::size_t k = 0; k < truth.tip.modes.size(); ++k) {
    const Mode &tip = truth.tip.modes[k], &measured = truth.measured.modes[k];
    if (tip.frequency < BAND_LOW || tip.frequency > BAND_HIGH) continue;
    const auto found = shownAs(truth, k, fitted);
    if (found) used[*found] = true;
    const bool counts = peak(tip) > SHOWS * tip_peak;
    if (!counts) continue;
    if (!found) {
      // A mode that is invisible at the sensor or within the width of another is no fault of the fit, but is
      // missing at the tip.
      ++(peak(measured) > SHOWS * shown_peak ? missed : alone);
      continue;
    }
    const Mode& fit = fitted[*found];
    const Mode* corrected = atTip(result.modes.model.modes, fit);
    modes.push_back({{"f", tip.frequency},
                     {"zeta", tip.damping_ratio},
                     {"f_error", fit.frequency / tip.frequency - 1.0},
                     {"f_z", (fit.frequency - tip.frequency) / fit.frequency_std},
                     {"zeta_error", fit.damping_ratio / tip.damping_ratio - 1.0},
                     {"zeta_z", (fit.damping_ratio - tip.damping_ratio) / fit.damping_ratio_std},
                     {"gain_z", (fit.gain - measured.gain) / fit.gain_std},
                     {"measured_error", fit.gain / measured.gain - 1.0},
                     {"k_none", tip.gain / fit.gain - 1.0},
                     {"k_tip", corrected ? json(tip.gain / corrected->gain - 1.0) : json()},
                     {"tip_z", corrected ? json((corrected->gain - tip.gain) / corrected->gain_std) : json()},
                     {"tip_std", corrected ? json(corrected->gain_std / corrected->gain) : json()},
                     {"f_std", fit.frequency_std / fit.frequency},
                     {"zeta_std", fit.damping_ratio_std / fit.damping_ratio},
                     {"gain_std", fit.gain_std / fit.gain},
                     {"k_444", tip.gain / (factor * fit.gain) - 1.0},
                     {"weight", peak(measured) / shown_peak}});
  }
  line["missed"] = missed;
  line["unseen"] = alone;
  int spurious = 0;
  for (std::size_t i = 0; i < fitted.size(); ++i) {
    if (!used[i] && fitted[i].frequency > BAND_LOW && fitted[i].frequency < BAND_HIGH) ++spurious;
  }
  line["spurious"] = spurious;
  return modes;
}

/// [1] RMS error of a scaled FRF over the RMS of the truth, and relative error of its least real part, to
/// which the least depth limit of a slot is inversely proportional (figure 4.8); from 100 Hz to the end of
/// the band.
struct FrfError {
  double frf = 0.0, depth = 0.0;
};
FrfError errorOf(const FrequencyResponse& frf, double factor, const ModalModel& truth) {
  double off = 0.0, all = 0.0, softest = 0.0, due = 0.0;
  for (std::size_t i = 0; i < frf.size(); ++i) {
    const double f = frf.frequency[i];
    if (f < 100.0 || f > BAND_HIGH) continue;
    const std::complex<double> is = factor * frf.value[i], should = truth.response(f);
    off += std::norm(is - should);
    all += std::norm(should);
    softest = std::min(softest, is.real());
    due = std::min(due, should.real());
  }
  return {std::sqrt(off / all), due / softest - 1.0};
}

/// [1] RMS over the lines of the band of the error in stated standard deviations, without the common scale of
/// the sensor.
double lineScatter(const FrequencyResponse& frf, const ModalModel& truth) {
  std::complex<double> both;
  double own = 0.0;
  int lines = 0;
  const auto each = [&](const auto& use) {
    for (std::size_t i = 0; i < frf.size(); ++i) {
      const double f = frf.frequency[i];
      if (f > BAND_LOW && f < BAND_HIGH) use(frf.value[i], truth.response(f), std::pow(frf.std_dev[i], 2));
    }
  };
  each([&](std::complex<double> is, std::complex<double> should, double variance) {
    both += std::conj(should) * is / variance;
    own += std::norm(should) / variance;
  });
  const double scale = both.real() / own;
  double sum = 0.0;
  each([&](std::complex<double> is, std::complex<double> should, double variance) {
    sum += std::norm(is - scale * should) / variance;
    ++lines;
  });
  return std::sqrt(sum / lines);
}

void frfLines(const Truth& truth, const MeasureFrfResult& result, double factor, json& line) {
  const FrfError none = errorOf(result.measured_frf, 1.0, truth.tip),
                 thesis = errorOf(result.measured_frf, factor, truth.tip),
                 tip = errorOf(result.frf.frf, 1.0, truth.tip);
  line["frf_none"] = none.frf;
  line["frf_444"] = thesis.frf;
  line["frf_tip"] = tip.frf;
  line["depth_none"] = none.depth;
  line["depth_444"] = thesis.depth;
  line["depth_tip"] = tip.depth;
  line["line_scatter"] = lineScatter(result.measured_frf, truth.measured);
}

/// [1] spindle moves of the search in the thesis (golden section only).
int thesisMoves(const StationStudy& study, int number, const DrawnStation& drawn, HammerParameters parameters,
                const MeasureFrfGoal& goal) {
  parameters.golden_only = 1;
  StationMachine machine(drawn, study.seed + 7919u * static_cast<std::uint64_t>(number));
  HammerSequence sequence(parameters, drawn.believed);
  sequence.handle(goal);
  StationMachine::Streams streams;
  while (true) {
    machine.block(streams);
    sequence.handle(streams.samples);
    sequence.handle(streams.state);
    sequence.handle(streams.angle);
    for (const Command& command : sequence.takeCommands()) machine.obey(command);
    const auto feedback = sequence.takeFeedback();
    if (feedback && feedback->progress >= 0.55 && feedback->progress < 0.9) sequence.cancel(machine.time());
    if (const auto result = sequence.takeResult()) return result->spindle_moves;
  }
}

}  // namespace

namespace {

StationFrfs figuresOf(const Truth& truth, const MeasureFrfResult& result, double factor) {
  const FrequencyResponse& lines = result.measured_frf;
  StationFrfs f{lines, lines, lines, lines, result.frf.frf};
  for (std::size_t i = 0; i < lines.size(); ++i) {
    f.direct.value[i] = truth.tip.response(lines.frequency[i]);
    f.across.value[i] = truth.measured.response(lines.frequency[i]);
    f.thesis.value[i] *= factor;
  }
  return f;
}

}  // namespace

json runStation(const StationStudy& study, int number, StationFrfs* frfs) {
  const auto begun = std::chrono::steady_clock::now();
  const DrawnStation drawn =
      study.opposite ? withSensorOpposite(drawStation(study.seed, number)) : drawStation(study.seed, number);
  const StationTask task = taskOf(drawn, study.hits);
  const HammerParameters& parameters = task.parameters;
  const MeasureFrfGoal& goal = task.goal;
  StationMachine machine(drawn, study.seed + 7919u * static_cast<std::uint64_t>(number));
  double seconds = 0.0;
  const MeasureFrfResult result = measure(machine, parameters, drawn.believed, goal, seconds);

  json line{{"machine", number},
            {"out_of_range", drawn.out_of_range},
            {"code", static_cast<int>(result.code)},
            {"message", result.message},
            {"moves", machine.searchMoves()},
            {"sure", std::isfinite(result.flute_confidence) ? json(result.flute_confidence) : json()},
            {"seconds", seconds},
            {"strikes", machine.strikes()},
            {"closest_um", 1e6 * machine.closest()},
            {"touched", machine.touched()},
            {"struck_retreat", machine.struckRetreat() / drawn.believed.hammer->flute_depth},
            {"insert", drawn.traits.tooth == "insert"},
            {"zeroed", std::abs(machine.restVolt()) < 0.1},
            {"teeth", goal.teeth}};
  line["thesis_moves"] = thesisMoves(study, number, drawn, parameters, goal);
  if (result.code == FrfCode::ok) {
    const std::size_t axis = drawn.direction == "x" ? 0 : 1;
    const sim::HammerStation station(drawn.true_model, drawn.traits, 0.0, 1e-5);
    const sim::ToolStructure structure(drawn.traits, *drawn.believed.tool, *drawn.believed.stickout);
    const Truth truth{structure.between(axis, 0.0, axis, 0.0), station.measured(axis, axis)};
    const double factor = offsetFactor(goal.stickout, drawn.believed.hammer->offset);
    line["sensitivity_std"] = result.sensitivity_std / result.sensitivity;
    line["cross"] = result.cross.frf.size() > 0;
    line["modes"] = modeLines(truth, result, factor, line);
    frfLines(truth, result, factor, line);
    if (frfs) *frfs = figuresOf(truth, result, factor);
  }
  line["cpu"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  return line;
}

namespace {

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  const double at = share * static_cast<double>(values.size() - 1);
  const auto low = static_cast<std::size_t>(at);
  const std::size_t high = std::min(low + 1, values.size() - 1);
  return values[low] + (at - static_cast<double>(low)) * (values[high] - values[low]);
}

/// Median and 95 % quantile of the magnitudes; share of normalised errors within 1.96.
json spread(const std::vector<json>& modes, const char* key) {
  std::vector<double> sizes;
  for (const json& mode : modes) {
    // Undefined for a machine without a limit in the band.
    if (mode[key].is_number() && std::isfinite(mode[key].get<double>()))
      sizes.push_back(std::abs(mode[key].get<double>()));
  }
  return {{"median", quantile(sizes, 0.5)}, {"95", quantile(sizes, 0.95)}, {"count", sizes.size()}};
}

double within(const std::vector<json>& modes, const char* key) {
  int inside = 0, all = 0;
  for (const json& mode : modes) {
    if (!mode[key].is_number()) continue;
    ++all;
    if (std::abs(mode[key].get<double>()) < 1.96) ++inside;
  }
  return all > 0 ? static_cast<double>(inside) / all : 0.0;
}

}  // namespace

json scoreStations(const std::vector<json>& lines) {
  std::vector<json> modes, measured;
  std::vector<double> moves, thesis, seconds, cpu, closest;
  int good = 0, due = 0, reported = 0, away = 0, touched = 0, missed = 0, unseen = 0, spurious = 0,
      gullet = 0;
  for (const json& line : lines) {
    cpu.push_back(line["cpu"]);
    if (line["touched"]) ++touched;
    if (line["out_of_range"]) {
      ++away;
      if (line["code"] == static_cast<int>(FrfCode::no_flute)) ++reported;
      continue;
    }
    ++due;
    closest.push_back(line["closest_um"]);
    if (line["code"] != static_cast<int>(FrfCode::ok)) continue;
    ++good;
    moves.push_back(line["moves"]);
    thesis.push_back(line["thesis_moves"]);
    seconds.push_back(line["seconds"]);
    if (line["struck_retreat"] > 0.3) ++gullet;
    missed += line["missed"].get<int>();
    unseen += line["unseen"].get<int>();
    spurious += line["spurious"].get<int>();
    for (const json& mode : line["modes"]) modes.push_back(mode);
    measured.push_back(line);
  }
  json score{{"machines", lines.size()},  {"due", due},
             {"measured", good},          {"out_of_range", away},
             {"told_so", reported},       {"collisions", touched},
             {"struck_a_gullet", gullet}, {"missed_modes", missed},
             {"modes_unseen", unseen},    {"spurious_modes", spurious},
             {"modes", modes.size()}};
  score["least_gap_um"] = closest.empty() ? 0.0 : *std::min_element(closest.begin(), closest.end());
  for (const auto& [name, values] : {std::pair{"spindle_moves", &moves}, std::pair{"thesis_moves", &thesis},
                                     std::pair{"seconds", &seconds}, std::pair{"cpu_seconds", &cpu}})
    score[name] = {{"median", quantile(*values, 0.5)}, {"95", quantile(*values, 0.95)}};
  for (const char* key : {"f_error", "zeta_error", "measured_error", "k_none", "k_444", "k_tip"})
    score[key] = spread(modes, key);
  for (const char* key :
       {"frf_none", "frf_444", "frf_tip", "depth_none", "depth_444", "depth_tip", "line_scatter"})
    score[key] = spread(measured, key);
  for (const char* key : {"f_z", "zeta_z", "gain_z", "tip_z"}) score["coverage"][key] = within(modes, key);
  return score;
}

}  // namespace smartmill::hammer
