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

namespace smartmill::hammer {

/// Once-per-revolution component of a force channel over a segment of an air cut at steady speed.
struct SynchronousForce {
  double stamp = 0.0, speed = 0.0;  ///< [s] of the segment's end, [rad/s]
  std::complex<double> force;       ///< [N] force = Re(this exp(i spindle angle))
  double std = 0.0;                 ///< [N] of real and imaginary part each
};

/// Mean of the load meter over the same segment.
struct AirCutLoad {
  double stamp = 0.0, speed = 0.0;  ///< [s] of its end, [rad/s]
  double load = 0.0, std = 0.0;     ///< [1] of full scale
};

/// The air cuts of one tool in one session.
struct AirCutRecord {
  std::map<std::string, std::vector<SynchronousForce>> forces;  ///< by channel: fx, fy, or a sensor's own
  std::vector<AirCutLoad> loads;
};

/// How air cuts are evaluated.
struct IdleSpindleOptions {
  double steady_speed =
      0.005;                  ///< [1] change of speed that ends a segment; a controlled spindle keeps within
  double least_speed = 10.0;  ///< [rad/s] below it the spindle counts as stopped
  double longest_segment = 10.0;   ///< [s] so that a long air cut shows its scatter
  std::size_t sections = 8;        ///< of a segment; their scatter gives the standard deviation
  double least_revolutions = 3.0;  ///< of a section, to separate the synchronous part
  double load_settle = 0.3;        ///< [s] of a load meter after a change
  std::size_t least_loads = 4;     ///< samples of a mean with a standard deviation
  double least_load_std = 1e-5;    ///< [1] of full scale: resolution of a meter
  double same_speed = 0.01;        ///< [1] of speed: segments that are compared with each other
  double least_speed_ratio = 1.2;  ///< [1] closer speeds do not separate Coulomb and viscous friction
  double gain_error = 0.002;  ///< [1] of a force, not contained in its scatter: error of the sensor's gain
};

/// Evaluates air cuts (condition AIR) from streams in stamp order: force, angle, load meter. A segment ends
/// when the speed changes by 0.5 %, and after ten seconds.
class IdleSpindle {
 public:
  /// Called with the tool's name at the end of an air cut with at least one complete segment.
  using RecordCallback = std::function<void(const std::string& tool, const AirCutRecord& record)>;
  explicit IdleSpindle(RecordCallback on_record = {}, const IdleSpindleOptions& options = {})
      : on_record_(std::move(on_record)), options_(options) {}

  void handle(const CuttingCondition& condition);
  void handle(const SpindleAngle& angle);
  void handle(const SampleBlock& force);
  void handle(const LoadSample& load);
  /// End of data.
  void finish();
  /// Discards the current air cut; finished ones remain.
  void interrupt();

  /// By tool.
  const std::map<std::string, AirCutRecord>& records() const { return records_; }

 private:
  /// Samples at one speed.
  struct ForceSegment {
    double from = 0.0, to = 0.0, speed = 0.0;  // [s], [rad/s]
    std::vector<double> angle;                 // [rad]
    std::vector<std::string> channels;
    std::vector<std::vector<double>> force;  // [N] per channel
  };
  struct LoadSegment {
    double from = 0.0, to = 0.0, speed = 0.0;
    std::vector<double> load;
  };
  bool inAir() const { return condition_ && condition_->kind == CuttingCondition::Kind::air; }
  void closeForceSegment();
  void closeLoadSegment();

  RecordCallback on_record_;
  IdleSpindleOptions options_;
  std::optional<CuttingCondition> condition_;
  std::optional<SpindleAngle> angle_;
  std::optional<ForceSegment> force_segment_;
  std::optional<LoadSegment> load_segment_;
  AirCutRecord current_;  // of the current air cut
  std::map<std::string, AirCutRecord> records_;
};

/// An IdleSpindle behind a StreamSorter, for node and offline tool. A backward jump of time keeps the
/// finished air cuts.
class IdleSpindlePipeline {
 public:
  /// @param hold_back [s] see StreamSorter
  explicit IdleSpindlePipeline(double hold_back, IdleSpindle::RecordCallback on_record = {});

  void push(const CuttingCondition& condition) { sort(conditions_, condition); }
  void push(const SpindleAngle& angle) { sort(angles_, angle); }
  void push(const SampleBlock& force) { sort(blocks_, force); }
  void push(const LoadSample& load) { sort(loads_, load); }
  void finish();
  const std::map<std::string, AirCutRecord>& records() const { return idle_.records(); }

 private:
  template <class Input>
  void sort(StreamSorter::Stream stream, const Input& input) {
    sorter_.push(stream, input.stamp, [this, input] { idle_.handle(input); });
  }

  IdleSpindle idle_;
  StreamSorter sorter_;
  StreamSorter::Stream conditions_, angles_, blocks_, loads_;  // equal stamps are passed on in this order
};

/// Unbalance as measured by a channel: F = Re(unbalance w^2 G(w) exp(i spindle angle)) (effects.md), G the
/// transmissibility of the force sensor.
struct Unbalance {
  std::complex<double> value;  ///< [kg m]
  double std = 0.0;            ///< [kg m] of real and imaginary part each
};

/// Weighted mean of the forces over w^2 G. Scatter between speeds widens the standard deviation: what is not
/// proportional to the square of the speed. @param sensor G, static gain 1; empty: ideal
Unbalance unbalanceOf(const std::vector<SynchronousForce>& forces, const std::optional<ModalModel>& sensor);

/// Power in air over speed: load = coulomb w + viscous w^2 [1 of full scale], Dunwoody eq. 3.2 on the load
/// meter's own scale.
struct IdleFriction {
  double coulomb = 0.0, coulomb_std = 0.0;  ///< [s]
  double viscous = 0.0, viscous_std = 0.0;  ///< [s2]
};

/// By weighted least squares over all segments; empty without two different speeds.
std::optional<IdleFriction> frictionOf(const std::vector<AirCutLoad>& loads);

/// [s] end of the last segment
double endTime(const AirCutRecord& record);

/// Adds the segments at speeds that the record does not contain yet. @return whether there are any
bool addNewSpeeds(AirCutRecord& record, const AirCutRecord& more);

/// Changes of unbalance by channel, of friction, and of the load at common speeds. Common speeds are used for
/// the unbalance too, where there are any: what is not proportional to the square of the speed then cancels.
/// @param sensors by channel
std::vector<HealthChange> airCutChanges(const AirCutRecord& before, const AirCutRecord& now,
                                        const std::map<std::string, ModalModel>& sensors,
                                        const HealthAllowance& allowance = {});

}  // namespace smartmill::hammer
