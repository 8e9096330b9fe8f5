#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/cutting/cutting_law.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {

using Stage = EffectStage;

/// Channels of the measuring chain: places in measuredChannels().
enum ChannelIndex : std::size_t {
  FX,
  FY,
  FZ,
  LOAD_METER,
  TOOL_X,
  TOOL_Y,
  DISPLACEMENT,
  ACCELERATION,
  CHANNELS
};
using ChannelValues = std::array<double, CHANNELS>;  ///< [N], [N], [N], [V], [m], [m], [m], [m/s2]
/// Name of a channel's column in a record.
const char* channelName(std::size_t channel);
/// @throws Error on an unknown name.
std::size_t channelOf(const std::string& name);

/// A lower part of the cutter's edges that acts besides them.
struct EdgeLayer {
  /// Of its force: what the chip coefficients give, or those of the edge.
  enum class Share { all, chip, edge };

  double weight = 1.0;  ///< [1] of its force
  double height = 0.0;  ///< [m] where it ends: above the tip, or below the work's surface
  bool from_surface = false;
  Share share = Share::all;
  int missing_tooth = -1;  ///< does not cut there, counts from 0; -1: all do
  int only_tooth = -1;     ///< its force alone, the others cut their chips unseen; -1: of all
};

/// Of a channel: above x + (below - above) L(x), L a low pass of first order.
struct Shelf {
  double corner = 0.0;              ///< [Hz]
  double below = 1.0, above = 1.0;  ///< [1]
};

/// A mode through which one force channel shows in another, or beside itself: gain (mode(x) - x) is added
/// then.
struct Resonance {
  std::size_t channel = 0, from = 0;
  Mode mode;  ///< its gain is that of the path
};

/// What the machine is before it starts; effects change it once.
struct TwinSetup {
  MachineModel model;                  ///< without effects
  std::vector<double> radius_offset;   ///< [m] of each tooth
  std::array<double, CHANNELS> delay;  ///< [s] of each channel
  double corner_radius = 0.0;          ///< [m] of the tool
  double path_share = 0.0;             ///< [1] 0: the rule of the surface, 1: the teeth's path
  std::vector<EdgeLayer> layers;
  std::vector<Resonance> resonances;                   ///< of channels, before shelves
  std::vector<std::pair<std::size_t, Shelf>> shelves;  ///< of channels, before they are late
};

/// Now.
struct Instant {
  double angle = 0.0;        ///< [rad] immersion angle of tooth 1
  double speed = 0.0;        ///< [rad/s] of the spindle
  double record_time = 0.0;  ///< [s] since the record began
  double start_time = 0.0;   ///< [s] of the record since the machine was cold
  double edge_time = 0.0;    ///< [s] that the edge has cut
  double cut_time = 0.0;     ///< [s] since this cut began
  double chip = 0.0;         ///< [m] feed per tooth of this cut, 0: the tool cuts nothing
  double depth = 0.0;        ///< [m] axial depth of this cut, as commanded
};

/// What effects set anew while the machine runs, from its nominal state each time.
struct TwinState {
  CuttingLaw law;
  double radius = 0.0;            ///< [m] of the tool
  double feed_ratio = 1.0;        ///< [1] actual over commanded feed
  double depth_extra = 0.0;       ///< [m] of the axial depth besides the commanded one
  double depth_slope = 0.0;       ///< [m/m] of the axial depth along the feed path from engagement
  double sensor_frequency = 1.0;  ///< [1] on the first mode of each axis of the force sensor
  double friction_extra = 0.0;    ///< [N m] spindle friction besides the model's
  double friction_factor = 1.0;   ///< [1] on the friction, the extra too
};

/// A sine in the signals whose phase no model knows: another one each record.
struct Tone {
  double frequency = 0.0;                    ///< [Hz]
  std::array<double, CHANNELS> amplitude{};  ///< in each channel
  double phase = 0.0;                        ///< [rad] at the start of the record
  double order = 0.0;                        ///< [1] of the spindle, instead of the frequency; 0: none

  /// [rad/s] @param speed [rad/s] of the spindle
  double rate(double speed) const { return order > 0.0 ? order * speed : units::TWO_PI * frequency; }
};

/// Decaying oscillations on a channel, one every period, at times that no model knows.
struct BurstTrain {
  std::size_t channel = 0;
  double period = 1.0;     ///< [s]
  double frequency = 1e3;  ///< [Hz]
  double decay = 1e-3;     ///< [s]
  double amplitude = 0.0;
  double first = 0.0;  ///< [s] a burst begins here after the start of the record

  double at(double time) const;
  /// Of a burst of unit amplitude [1] so long after its begin [s] >= 0.
  double shape(double since) const;
};

/// One physical cause that a nominal model may lack: an entry of a model's `effects:`. A class overrides the
/// hooks of its stage; effects act in the order of the catalogue (smartmill_core/model/effect_catalogue.h),
/// which declares them.
class Effect {
 public:
  virtual ~Effect() = default;

  /// Geometry, structure, sensor, delay, and what of the drive is constant.
  virtual void setUp(TwinSetup&) const {}
  /// Motion, cutting law, speed-dependent sensor, friction.
  virtual void update(const Instant&, TwinState&) const {}
  /// Whether update() sets nothing of the cut but coefficients and factors of the law.
  virtual bool scalesForce() const { return false; }
  /// Adds to the force on the sensor [N].
  virtual void addForce(const Instant&, Axes3&) const {}
  /// Sensor output and signal: changes measured channels.
  virtual void measure(const Instant&, ChannelValues&) const {}
  /// Lowers the size that each channel can show at most.
  virtual void limit(ChannelValues&) const {}
  /// Of an effect that is a tone in the signals, else nullptr.
  virtual Tone* tone() { return nullptr; }
  /// Of an effect that is bursts in the signals, else nullptr.
  virtual BurstTrain* bursts() { return nullptr; }
};

/// Whether a test of this kind knows of effects of a stage: a tap has no chip, no turning spindle.
bool touches(Stage stage, TestKind kind);

/// The class of an entry's name. @throws Error on a name without class, a key that is missing.
std::unique_ptr<Effect> makeEffect(const EffectEntry& entry);

/// The effects of one model, in the order in which they act.
class EffectSet {
 public:
  /// @throws Error on a name without class or a key that is missing, naming the model's file.
  explicit EffectSet(const MachineModel& model);

  bool empty() const { return effects_.empty(); }
  bool has(Stage stage) const;

  void setUp(TwinSetup& setup) const;
  void update(const Instant& now, TwinState& state) const;
  void addForce(const Instant& now, Axes3& force) const;
  /// Only the effects of one stage (sensor_output or signal).
  void measure(Stage stage, const Instant& now, ChannelValues& channels) const;
  /// The size that each channel can show at most; infinity: any.
  ChannelValues limits() const;
  std::vector<Tone*> tones();
  std::vector<BurstTrain*> bursts();

 private:
  struct Member {
    Stage stage;
    std::unique_ptr<Effect> effect;
  };
  std::vector<Member> effects_;
  std::array<bool, static_cast<std::size_t>(Stage::signal) + 1> has_{};
};

/// What a machine is before it starts, with what its effects change of it.
/// @throws Error as EffectSet()
TwinSetup setUpOf(MachineModel model, const EffectSet& effects);

}  // namespace smartmill::sim
