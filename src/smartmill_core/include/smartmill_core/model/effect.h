#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/cutting/cutting_law.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/units.h"

// What the twin offers to an effect. The twin calls the functions of Effect in this order: setUp() once,
// update() every few integration steps and at every change of speed, addForce() and measure() at every step.

namespace smartmill {

/// Channels of the measuring chain, in the order of measuredChannels().
enum ChannelIndex : std::size_t {
  FX,
  FY,
  FZ,
  LOAD_METER,
  TOOL_X,
  TOOL_Y,
  DISPLACEMENT,
  ACCELERATION,
  CHANNEL_COUNT
};
using ChannelValues = std::array<double, CHANNEL_COUNT>;  ///< [N], [N], [N], [V], [m], [m], [m], [m/s2]
/// Name of a channel's column in a record.
const char* channelName(std::size_t channel);
/// @throws Error on an unknown name.
std::size_t channelOf(const std::string& name);

/// A lower layer of the cutter's edges, whose force is added to that of the whole edges.
struct EdgeLayer {
  /// Terms of its force: both, those of the chip coefficients, those of the edge coefficients.
  enum class Share { all, chip, edge };

  double weight = 1.0;  ///< [1] factor on its force
  double height = 0.0;  ///< [m] upper limit: above the tip, or below the surface of the work
  bool from_surface = false;
  Share share = Share::all;
  int missing_tooth = -1;  ///< tooth without this layer, counted from 0; -1: none
  int only_tooth = -1;     ///< the only tooth whose force counts; -1: all count
};

/// First-order shelf of a channel: above x + (below - above) L(x), L a first-order low pass.
struct Shelf {
  double corner = 0.0;              ///< [Hz]
  double below = 1.0, above = 1.0;  ///< [1]
};

/// A mode in the path from one force channel to another, or within one; there gain (mode(x) - x) is added.
struct Resonance {
  std::size_t channel = 0, from = 0;
  Mode mode;  ///< its gain is that of the path
};

/// The machine before it starts.
struct TwinSetup {
  MachineModel model;                       ///< without effects
  std::vector<double> radius_offset;        ///< [m] of each tooth
  std::array<double, CHANNEL_COUNT> delay;  ///< [s] of each channel
  double path_share = 0.0;  ///< [1] 0: surface by the rule of formats.md, 1: by the teeth's path
  std::vector<EdgeLayer> layers;
  std::vector<Resonance> resonances;                   ///< act before the shelves
  std::vector<std::pair<std::size_t, Shelf>> shelves;  ///< by channel, act before the delays
};

/// How far a cut is since it began.
struct CutProgress {
  double time = 0.0;   ///< [s]
  double path = 0.0;   ///< [m] along the feed
  double angle = 0.0;  ///< [rad] turned by the spindle
};

/// The present time step.
struct Instant {
  double angle = 0.0;        ///< [rad] immersion angle of tooth 1
  double speed = 0.0;        ///< [rad/s] of the spindle
  double record_time = 0.0;  ///< [s] since the record began
  double start_time = 0.0;   ///< [s] of the record, since the machine was started cold
  double edge_time = 0.0;    ///< [s] that the edge has cut
  CutProgress cut;
  double chip = 0.0;                   ///< [m] commanded feed per tooth; 0 outside a cut
  double depth = 0.0;                  ///< [m] commanded axial depth; 0 outside a cut
  Axes3 axis_acceleration{{0, 0, 0}};  ///< [m/s2] of the machine axes, where their motion is recorded
};

/// Values that update() changes, starting from the nominal ones each time.
struct TwinState {
  CuttingLaw law;
  double radius = 0.0;            ///< [m] of the tool
  double feed_ratio = 1.0;        ///< [1] actual over commanded feed
  double depth_extra = 0.0;       ///< [m] added to the commanded axial depth
  double depth_slope = 0.0;       ///< [m/m] of the axial depth along the feed path from engagement
  double sensor_frequency = 1.0;  ///< [1] factor on the first mode of each axis of the force sensor
  double friction_extra = 0.0;    ///< [N m] added to the model's spindle friction
  double friction_factor = 1.0;   ///< [1] factor on the whole friction
};

/// A sine in the signals with an unknown phase in each record.
struct Tone {
  double frequency = 0.0;                         ///< [Hz]
  std::array<double, CHANNEL_COUNT> amplitude{};  ///< in each channel
  double phase = 0.0;                             ///< [rad] at the start of the record
  double order = 0.0;                             ///< [1] of the spindle, replaces the frequency; 0: none
  bool on_sensor = false;  ///< amplitude is that of a force on the sensor, which responds to it
  /// [1] of the path to each channel at the tone's frequency; the caller sets that of the sensor.
  std::array<std::complex<double>, CHANNEL_COUNT> response = filled(1.0);

  /// [rad/s] @param speed [rad/s] of the spindle
  double rate(double speed) const { return order > 0.0 ? order * speed : units::TWO_PI * frequency; }
  /// Value in a channel. @param angle [rad] of the sine, including the phase
  double at(std::size_t channel, double angle) const {
    return amplitude[channel] * std::imag(response[channel] * std::polar(1.0, angle));
  }

 private:
  static std::array<std::complex<double>, CHANNEL_COUNT> filled(double value) {
    std::array<std::complex<double>, CHANNEL_COUNT> all;
    all.fill(value);
    return all;
  }
};

/// Decaying oscillations on a channel, one every period, with an unknown start in each record.
struct BurstTrain {
  std::size_t channel = 0;
  double period = 1.0;     ///< [s]
  double frequency = 1e3;  ///< [Hz]
  double decay = 1e-3;     ///< [s]
  double amplitude = 0.0;
  double first = 0.0;  ///< [s] start of one burst after the start of the record

  double at(double time) const;
  /// A burst of unit amplitude [1] this long after its start [s] >= 0.
  double shape(double since) const;
};

/// A constant on a channel that differs from record to record.
struct RecordZero {
  std::size_t channel = 0;
  double share = 1.0;  ///< [1] of the value that acts
  double value = 0.0;  ///< [unit of the channel] in this record; the caller estimates it
};

/// The physics of one entry of a model's `effects:`. A class overrides the functions of its stage
/// (EffectStage).
class Effect {
 public:
  virtual ~Effect() = default;

  /// Geometry, structure, sensor, delay, and constant values of the drive.
  virtual void setUp(TwinSetup&) const {}
  /// Motion, cutting law, speed-dependent sensor, friction.
  virtual void update(const Instant&, TwinState&) const {}
  /// Whether update() changes nothing of the cut but coefficients and factors of the law.
  virtual bool scalesForce() const { return false; }
  /// Adds to the force on the sensor [N], as force on the tool.
  virtual void addForce(const Instant&, Axes3&) const {}
  /// Sensor output and signal: changes measured channels.
  virtual void measure(const Instant&, ChannelValues&) const {}
  /// Lowers the largest magnitude that each channel can indicate.
  virtual void applyLimit(ChannelValues&) const {}
  /// The tone of an effect that is one, else nullptr.
  virtual Tone* tone() { return nullptr; }
  /// The bursts of an effect that consists of them, else nullptr.
  virtual BurstTrain* bursts() { return nullptr; }
  /// The zero of an effect that is one, else nullptr.
  virtual RecordZero* zero() { return nullptr; }
};

/// The physics of an entry. @throws Error on an unknown name, a missing key, values that contradict each
/// other.
std::unique_ptr<Effect> makeEffect(const EffectEntry& entry);

}  // namespace smartmill
