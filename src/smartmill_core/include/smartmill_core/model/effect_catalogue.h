#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/model/effect_form.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/model/strict_yaml.h"

namespace smartmill {

/// Where in a machine an effect acts, in the order in which the stages pass.
enum class EffectStage {
  geometry,       ///< of the tool: radii, pitch, helix
  motion,         ///< where the tool is in the work: feed, depth
  cutting_law,    ///< from chip to force
  structure,      ///< modes of the tool tip
  sensor,         ///< modes of the force sensor
  sensor_force,   ///< force on the sensor besides cutting
  drive,          ///< spindle friction and load meter
  sensor_output,  ///< measured channels, before they are late
  delay,          ///< lateness of one channel
  signal          ///< measured channels at last, before the noise
};
const char* stageName(EffectStage stage);

/// Between the force on the sensor and what its channels show.
bool isBehindSensor(EffectStage stage);

/// What stands behind a key of an effect.
enum class EffectValue {
  number,
  word,
  list,    ///< of numbers, one a tooth
  series,  ///< of numbers, as many as the file has
  table,   ///< a series that is one shape: no fit moves its numbers, no report lists them
  modes    ///< of the tool tip, as in the section tool_tip
};

/// What a campaign must hold for an effect to be looked for in it.
enum class EffectNeed {
  cuts,
  several_teeth,
  forces,        ///< fx, fy or fz
  plane_forces,  ///< fx or fy
  load_meter,
  flexible_tool,
  sensor_modes,
  start_time,  ///< of every test it touches: start_time_s
  cut_time     ///< of every cut: cut_time_before_s
};

/// Values that a workshop might meet: even in low..high beside about, on one side or on both.
struct EffectDraw {
  double low = 0.0, high = 0.0;
  double about = 0.0;
  bool both_sides = false;
};

/// One key of an effect, as files write it (shop units).
struct EffectParameter {
  std::string key;
  std::string unit;  ///< "1" without one
  EffectValue value = EffectValue::number;
  Range range = {};
  bool optional = false;                ///< absent is 0 (modes: none)
  std::vector<std::string> words = {};  ///< allowed words
  std::vector<double> choices = {};     ///< allowed numbers, empty: the range
  std::optional<double> sum = {};       ///< of a list, where it must be this
  double period = 0.0;                  ///< of an angle: what turns by it is the same again; 0: none
  EffectDraw draw = {};
  std::size_t words_drawn = 0;  ///< so many of the words, from the first; 0: all

  /// Whether files may say this number.
  bool allows(double number) const;
  /// What allows() asks for, e.g. "> 0"; "50 or 60".
  std::string rangeText() const;
  /// number - other, of an angle the short way round.
  double difference(double number, double other) const;
  /// Against which an error of a number is small: the number itself, of an angle one radian.
  double scale(double number) const;

  EffectParameter drawn(double low, double high) const;
  EffectParameter drawnOnBothSides(double low, double high, double about = 0.0) const;
  EffectParameter drawnFromFirst(std::size_t count) const;
};

/// What is known of a campaign before anything is fitted.
struct EffectScope {
  const MachineModel& nominal;
  std::set<std::string> channels;  ///< measured and simulated
  bool cuts = false;
  bool start_times = false, cut_times = false;  ///< stated wherever they count
  double largest_force = 0.0;                   ///< [N] of the records
  double first_cut = 400.0;  ///< [s] > 0, least start time of a cut that does not start at 0
  double largest_chip = 100e-6, largest_depth = 2e-3;  ///< [m] of the cuts
};

/// One cause that a nominal model may lack. Everything that speaks of it reads this declaration: the strict
/// reader and the writer of model files, the twin (whose class of this name acts), the search for missing
/// effects, benches, docs/effects.md.
struct EffectKind {
  using Random = std::mt19937_64;

  std::string name;
  EffectStage stage;
  std::string says;    ///< what it does, in one line
  std::string source;  ///< where the law stands
  std::vector<EffectParameter> parameters;
  std::vector<EffectNeed> needs;
  /// Ways in which it may be present where needs are met: coordinates of a fit, bounds, priors, starting
  /// points. By formsOf().
  std::function<std::vector<EffectForm>(const EffectScope&)> forms;
  /// Draws what the keys' own draws do not: lists, modes, what depends on the machine.
  std::function<void(const MachineModel&, Random&, EffectEntry&)> draw = {};
  /// [BIC] that the effect must explain beyond what another one does: of two that no record tells apart the
  /// commoner one is named.
  double handicap = 0.0;
  /// Of an effect built from what the catalogue leaves: files and reports call it `empirical` and tell it by
  /// stage and form. Empty: it has a name.
  std::string form_stage = {}, form = {};

  bool empirical() const { return !form.empty(); }
  bool has(EffectNeed need) const;
};

/// Channels that a measuring chain may show, as columns of a record are named.
const std::vector<std::string>& measuredChannels();

/// The catalogue: every effect that a model's `effects:` and a report may name, in the order in which they
/// act.
const std::vector<EffectKind>& effectCatalogue();

/// Causes without a name: forms in which an effect may be built from what the catalogue leaves. None of them
/// stands in the catalogue; their own names ("empirical:" and the form) are used inside only.
const std::vector<EffectKind>& empiricalCatalogue();

/// What files and reports call every one of them.
constexpr const char* EMPIRICAL = "empirical";

/// nullptr when there is none of this stage and form.
const EffectKind* findEmpirical(const std::string& stage, const std::string& form);

/// nullptr when there is no such effect, with or without a name.
const EffectKind* findEffect(const std::string& name);

/// nullptr when the effect has no such key.
const EffectParameter* findParameter(const EffectKind& kind, const std::string& key);

/// The key behind a name that numbersOf() gives: itself, a list's, that of the modes.
/// @throws Error when the effect has no such key.
const EffectParameter& parameterOf(const EffectKind& kind, const std::string& name);

/// Why a campaign cannot speak of an effect: nothing when it can; an empty text when nothing of the kind was
/// measured.
std::optional<std::string> lackingFor(const EffectKind& kind, const EffectScope& scope);

/// The forms of an effect with its name in them, whether its needs are met or not.
std::vector<EffectForm> formsOf(const EffectKind& kind, const EffectScope& scope);

/// An entry of a model's effects: from values by key (shop units, as in the file).
/// @throws Error on an unknown name or key, a missing key, a value out of range.
EffectEntry effectEntry(const std::string& name, const std::map<std::string, double>& numbers,
                        const std::map<std::string, std::string>& words = {},
                        const std::map<std::string, std::vector<double>>& lists = {});

/// An effect of the catalogue with values that a workshop might meet. @throws Error on an unknown name.
EffectEntry drawEffect(const std::string& name, const MachineModel& machine, EffectKind::Random& random);

/// Name of one item of a list: pitch_deg[0].
std::string itemOf(const std::string& key, std::size_t item);

/// Numbers of an entry with the names a report uses: offset_um; pitch_deg[0]; x[0].frequency_hz. Without
/// tables.
std::vector<std::pair<std::string, double>> numbersOf(const EffectEntry& entry);

/// A document (Markdown) with the catalogue as a table for people between the lines that begin with
/// "<!-- effects" and "<!-- end of effects". @throws Error on a document without these lines.
std::string withEffectTable(const std::string& document);

}  // namespace smartmill
