#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_hammer/analysis/health.h"

namespace smartmill {
namespace hammer {

/// A stretch in air at a steady speed, as a force sensor's channel sees it: the line once per revolution.
struct TurningLine {
  double stamp = 0.0, speed = 0.0;  ///< [s] of its end, [rad/s]
  std::complex<double> force;       ///< [N] force = Re(this exp(i spindle angle))
  double std = 0.0;                 ///< [N] of real and imaginary part each
};

/// The same stretch as the load meter sees it.
struct IdleLoad {
  double stamp = 0.0, speed = 0.0;  ///< [s] of its end, [rad/s]
  double load = 0.0, std = 0.0;     ///< [1] of full scale
};

/// What was seen in air of one tool in one session.
struct IdleRecord {
  std::map<std::string, std::vector<TurningLine>> lines;  ///< by channel: fx, fy, or a sensor's own
  std::vector<IdleLoad> loads;
};

/// Watches the spindle turn in air (condition AIR), streams in stamp order: force, angle, load meter. A
/// stretch ends when the speed changes by 0.5 %, and after ten seconds.
class IdleSpindle {
 public:
  /// Called with the tool's name and what it showed when an air cut has ended that told something.
  using Told = std::function<void(const std::string& tool, const IdleRecord& seen)>;
  explicit IdleSpindle(Told told = {}) : told_(std::move(told)) {}

  void handle(const CuttingCondition& condition);
  void handle(const SpindleAngle& angle);
  void handle(const SampleBlock& force);
  void handle(const LoadSample& load);
  /// End of data.
  void finish();
  /// Forgets what is under way; what was told stays.
  void interrupt();

  /// By tool.
  const std::map<std::string, IdleRecord>& records() const { return records_; }

 private:
  /// Samples at one speed.
  struct Turning {
    double from = 0.0, to = 0.0, speed = 0.0;  // [s], [rad/s]
    std::vector<double> angle;                 // [rad]
    std::vector<std::string> channels;
    std::vector<std::vector<double>> force;  // [N] per channel
  };
  struct Reading {
    double from = 0.0, to = 0.0, speed = 0.0;
    std::vector<double> load;
  };
  bool inAir() const { return condition_ && condition_->kind == CuttingCondition::Kind::air; }
  void closeTurning();
  void closeReading();

  Told told_;
  std::optional<CuttingCondition> condition_;
  std::optional<SpindleAngle> angle_;
  std::optional<Turning> turning_;
  std::optional<Reading> reading_;
  IdleRecord seen_;  // of the air cut that runs
  std::map<std::string, IdleRecord> records_;
};

/// An IdleSpindle behind a StreamSorter, for node and offline tool. A jump back of time keeps what was told.
class IdleSpindlePipeline {
 public:
  /// @param hold_back [s] see StreamSorter
  explicit IdleSpindlePipeline(double hold_back, IdleSpindle::Told told = {});

  void push(const CuttingCondition& condition) { sort(conditions_, condition); }
  void push(const SpindleAngle& angle) { sort(angles_, angle); }
  void push(const SampleBlock& force) { sort(blocks_, force); }
  void push(const LoadSample& load) { sort(loads_, load); }
  void finish();
  const std::map<std::string, IdleRecord>& records() const { return idle_.records(); }

 private:
  template <class Input>
  void sort(StreamSorter::Stream stream, const Input& input) {
    sorter_.push(stream, input.stamp, [this, input] { idle_.handle(input); });
  }

  IdleSpindle idle_;
  StreamSorter sorter_;
  StreamSorter::Stream conditions_, angles_, blocks_, loads_;  // equal stamps come out in this order
};

/// Unbalance as a channel sees it: F = Re(unbalance w^2 G(w) exp(i spindle angle)) (effects.md), G what the
/// sensor makes of a force.
struct Unbalance {
  std::complex<double> value;  ///< [kg m]
  double std = 0.0;            ///< [kg m] of real and imaginary part each
};

/// Weighted mean of the lines over w^2 G. What does not go with the square of the speed shows as scatter
/// between speeds, and widens the deviation. @param sensor dynamics of the channel, static gain 1; empty:
/// ideal
Unbalance unbalanceOf(const std::vector<TurningLine>& lines, const std::optional<ModalModel>& sensor);

/// Power in air over speed: load = coulomb w + viscous w^2 [1 of full scale], Dunwoody eq. 3.2 read on the
/// load meter's own scale.
struct IdleFriction {
  double coulomb = 0.0, coulomb_std = 0.0;  ///< [s]
  double viscous = 0.0, viscous_std = 0.0;  ///< [s2]
};

/// By weighted least squares over all stretches; none where there are not two speeds.
std::optional<IdleFriction> frictionOf(const std::vector<IdleLoad>& loads);

/// [s] end of the last stretch
double endOf(const IdleRecord& record);

/// Adds what stands at speeds that the record does not have yet. @return whether there was any
bool addSpeeds(IdleRecord& record, const IdleRecord& more);

/// Changes of unbalance by channel, at the speeds that both have seen where there are any (what does not go
/// with the square of the speed then falls out), of friction, and of the load at those speeds.
/// @param sensors by channel
std::vector<HealthChange> idleChanges(const IdleRecord& before, const IdleRecord& now,
                                      const std::map<std::string, ModalModel>& sensors,
                                      const HealthAllowance& allowance = {});

}  // namespace hammer
}  // namespace smartmill
