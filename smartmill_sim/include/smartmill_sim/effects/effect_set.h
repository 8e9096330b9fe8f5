#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/model/effect.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::sim {

using Stage = EffectStage;

/// Whether effects of a stage act in tests of this kind: a tap has neither chip nor spindle rotation, a move
/// has no chip.
bool actsIn(Stage stage, TestKind kind);

/// The effects of one model, in the order of action.
class EffectSet {
 public:
  /// @throws Error on an unknown name or a missing key, naming the model's file.
  explicit EffectSet(const MachineModel& model);

  bool empty() const { return effects_.empty(); }
  bool has(Stage stage) const;

  void setUp(TwinSetup& setup) const;
  void update(const Instant& now, TwinState& state) const;
  void addForce(const Instant& now, Axes3& force) const;
  /// Only the effects of one stage (sensor_output or signal).
  void measure(Stage stage, const Instant& now, ChannelValues& channels) const;
  /// The largest magnitude that each channel can indicate; infinity: unlimited.
  ChannelValues limits() const;
  std::vector<Tone*> tones();
  std::vector<BurstTrain*> bursts();
  std::vector<RecordZero*> zeros();

 private:
  struct Member {
    Stage stage;
    std::unique_ptr<Effect> effect;
  };
  std::vector<Member> effects_;
  std::array<bool, static_cast<std::size_t>(Stage::signal) + 1> has_{};
};

/// The stage of the effects that act on the channels after their filters (drift, hum, saturation), at an
/// instant of a record.
class SignalStage {
 public:
  SignalStage(EffectSet& effects, const Instant& now) : effects_(effects), now_(now) {}

  bool acts() const { return effects_.has(Stage::signal); }
  /// Changes the channels at a time since the begin of the record [s].
  void apply(double record_time, ChannelValues& channels) const;
  /// Tones (mains hum); the caller sets their phases.
  std::vector<Tone*> tones() const { return effects_.tones(); }
  /// Burst trains; the caller sets their begin.
  std::vector<BurstTrain*> bursts() const { return effects_.bursts(); }
  /// Zeros of channels; the caller sets their values.
  std::vector<RecordZero*> zeros() const { return effects_.zeros(); }
  /// Largest magnitude that each channel can indicate; infinity: unlimited.
  ChannelValues limits() const { return effects_.limits(); }

 private:
  EffectSet& effects_;
  Instant now_;
};

/// The initial machine with the changes by its effects.
/// @throws Error as EffectSet() does.
TwinSetup setUpOf(MachineModel model, const EffectSet& effects);

}  // namespace smartmill::sim
