#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
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

class Effect;

/// Where in a machine an effect acts, in the order of action.
enum class EffectStage {
  geometry,       ///< of the tool: radii, pitch, helix
  motion,         ///< of the tool in the work: feed, depth
  cutting_law,    ///< from chip to force
  structure,      ///< modes of the tool tip
  sensor,         ///< modes of the force sensor
  sensor_force,   ///< force on the sensor in addition to cutting
  drive,          ///< spindle friction and load meter
  sensor_output,  ///< measured channels before their delays
  delay,          ///< delay of one channel
  signal          ///< measured channels after their delays, before the noise
};
const char* stageName(EffectStage stage);

/// Whether a stage lies between the force on the sensor and its channels.
bool isBehindSensor(EffectStage stage);

/// Type of a key's value.
enum class EffectValue {
  number,
  word,
  list,    ///< of numbers, one per tooth
  series,  ///< of numbers, of any length
  table,   ///< a series that describes one shape: no fit changes its numbers, no report lists them
  modes    ///< of the tool tip, as in the section tool_tip
};

/// What a campaign must contain for an effect to be tried in it.
enum class EffectNeed {
  cuts,
  several_teeth,
  forces,        ///< fx, fy or fz
  plane_forces,  ///< fx or fy
  load_meter,
  flexible_tool,
  sensor_modes,
  start_time,  ///< of every test that the effect acts in: start_time_s
  cut_time,    ///< of every cut: cut_time_before_s
  axis_motion  ///< position or velocity of a machine axis
};

/// Uniform distribution of realistic values: low..high around `about`, on one side or on both.
struct EffectDraw {
  double low = 0.0, high = 0.0;
  double about = 0.0;
  bool both_sides = false;
};

/// One key of an effect, as in files (shop units).
struct EffectParameter {
  std::string key;
  std::string unit;  ///< "1" without one
  EffectValue value = EffectValue::number;
  Range range = {};
  bool optional = false;                ///< absent means 0 (modes: none)
  std::vector<std::string> words = {};  ///< allowed words
  std::vector<double> choices = {};     ///< allowed numbers; empty: the range
  std::optional<double> sum = {};       ///< required sum of a list
  double period = 0.0;                  ///< of an angle; 0: not periodic
  bool on_spindle = false;              ///< angle of something that turns with the spindle, from tooth 1
  EffectDraw draw = {};
  std::size_t words_drawn = 0;  ///< only this many words, from the first, are drawn; 0: all
  std::string name = {};        ///< its quantity in the words of a shop; empty: that of the key

  /// Its quantity without the unit: the name, or "time constant" of time_constant_s.
  std::string quantity() const;
  /// Whether files may contain this number.
  bool allows(double number) const;
  /// The condition of allows(), for example "> 0" or "50 or 60".
  std::string rangeText() const;
  /// number - other; of an angle the shorter difference.
  double difference(double number, double other) const;
  /// Scale of relative errors: the number itself; of an angle one radian.
  double scale(double number) const;

  EffectParameter drawn(double low, double high) const;
  EffectParameter drawnOnBothSides(double low, double high, double about = 0.0) const;
  EffectParameter drawnFromFirst(std::size_t count) const;
  EffectParameter named(const std::string& quantity) const;
};

/// Properties of a campaign that are known before any fit.
struct EffectScope {
  const MachineModel& nominal;
  std::set<std::string> channels;   ///< measured and simulated
  std::set<std::string> axes = {};  ///< x, y, z whose motion is recorded
  bool cuts = false;
  bool start_times = false, cut_times = false;         ///< stated wherever they matter
  double largest_force = 0.0;                          ///< [N] of the records
  double first_cut = 400.0;                            ///< [s] > 0, smallest positive start time of a cut
  double largest_chip = 100e-6, largest_depth = 2e-3;  ///< [m] of the cuts
};

/// Declaration of an effect: one physical cause that a nominal model may lack. It is made by the effect's own
/// file (src/effects/NAME.cpp) and read by the reader and the writer of model files, the twin, the search for
/// missing effects, benches and docs/effects.md.
struct EffectKind {
  using Random = std::mt19937_64;

  std::string name = {};
  EffectStage stage = EffectStage::geometry;
  int rank = 0;                  ///< within the stage: lower acts first
  std::string title = {};        ///< the cause in the words of a shop: "tool axis off centre"
  std::string description = {};  ///< one line: its law
  std::string source = {};       ///< publication or cause of the law
  std::string advice = {};       ///< for the machinist: what to do about it
  std::vector<EffectParameter> parameters = {};
  std::vector<EffectNeed> needs = {};
  /// Forms in which the effect may be present where its needs are met: coordinates of a fit, bounds, priors,
  /// starting points. Called through formsOf().
  std::function<std::vector<EffectForm>(const EffectScope&)> forms = {};
  /// Draws what the keys' own distributions do not cover: lists, modes, values that depend on the machine.
  std::function<void(const MachineModel&, Random&, EffectEntry&)> draw = {};
  /// One sentence for the machinist about an entry that was found; empty: none.
  std::function<std::string(const EffectEntry&)> remark = {};
  /// [BIC] gain required in addition to that of a rival: of two effects that no record distinguishes the more
  /// common one is named.
  double bic_penalty = 0.0;
  /// Of an empirical effect, which is built from the residual: files and reports call it `empirical` and
  /// identify it by these two. Empty: the effect is part of the catalogue.
  std::string form_stage = {}, form = {};
  /// Constructs the physics of an entry. Called through makeEffect().
  std::function<std::unique_ptr<Effect>(const EffectEntry&)> make = {};

  bool empirical() const { return !form.empty(); }
  bool has(EffectNeed need) const;
};

/// Channels of a measuring chain, named as columns of a record.
const std::vector<std::string>& measuredChannels();

/// Every effect that a model's `effects:` and a report may name, in the order of action (stage, rank).
const std::vector<EffectKind>& effectCatalogue();

/// Empirical effects, which have no name of their own in files; in the program they are named "empirical:"
/// and the form. In the order of action.
const std::vector<EffectKind>& empiricalCatalogue();

/// Name of every empirical effect in files and reports.
constexpr const char* EMPIRICAL = "empirical";

/// nullptr when there is none of this stage and form.
const EffectKind* findEmpirical(const std::string& stage, const std::string& form);

/// Searches both catalogues; nullptr when there is no such effect.
const EffectKind* findEffect(const std::string& name);

/// nullptr when the effect has no such key.
const EffectParameter* findParameter(const EffectKind& kind, const std::string& key);

/// The key that a name of numbersOf() belongs to.
/// @throws Error when the effect has no such key.
const EffectParameter& parameterOf(const EffectKind& kind, const std::string& name);

/// Why an effect cannot be tried in a campaign: nothing when it can; an empty text when the campaign does not
/// measure the channels concerned.
std::optional<std::string> missingNeed(const EffectKind& kind, const EffectScope& scope);

/// The forms of an effect, labelled with its name, whether its needs are met or not.
std::vector<EffectForm> formsOf(const EffectKind& kind, const EffectScope& scope);

/// An entry of a model's effects, from values by key (shop units, as in the file).
/// @throws Error on an unknown name or key, a missing key, a value out of range.
EffectEntry effectEntry(const std::string& name, const std::map<std::string, double>& numbers,
                        const std::map<std::string, std::string>& words = {},
                        const std::map<std::string, std::vector<double>>& lists = {});

/// An effect of the catalogue with realistic random values. @throws Error on an unknown name.
EffectEntry drawEffect(const std::string& name, const MachineModel& machine, EffectKind::Random& random);

/// Name of one item of a list: pitch_deg[0].
std::string itemOf(const std::string& key, std::size_t item);

/// Numbers of an entry by their names in reports: offset_um; pitch_deg[0]; x[0].frequency_hz. Without tables.
std::vector<std::pair<std::string, double>> numbersOf(const EffectEntry& entry);

/// A Markdown document with the table of the catalogue between the lines that begin with "<!-- effects" and
/// "<!-- end of effects". @throws Error on a document without these lines.
std::string withEffectTable(const std::string& document);

}  // namespace smartmill
