#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/filter/coupled_filter.h"
#include "smartmill_kalman/filter/delay_filter.h"
#include "smartmill_kalman/filter/harmonic_filter.h"
#include "smartmill_kalman/filter/lag_smoother.h"
#include "smartmill_kalman/following/mode_follower.h"
#include "smartmill_kalman/following/speed_tracker.h"

namespace smartmill::kalman {

struct CompensationParameters {
  HarmonicFilterParameters filter;
  double least_speed = 20.0;
  double speed_tolerance = 0.002;
  double lag = 0.0;
  bool delay_form = false;
  bool track_speed = false;
  SpeedTrackerParameters tracker;
  double settling_periods = 5.0;
  bool follow = false;
  int follow_revolutions = 8;
  FollowParameters follower;
  double saturation = 0.0;

  void declare(ParameterTable& table) {
    filter.declare(table);
    table.number("least_speed", least_speed, "rad/s", Range::positive(),
                 "slower than this the samples pass through");
    table.number("speed_tolerance", speed_tolerance, "1", Range::open(0.0, 0.5),
                 "speed that changes by more within 50 ms is not steady: samples pass through");
    table.number(
        "lag", lag, "s", Range::closed(0.0, 10.0),
        "blocks come so much later, each force told from the samples up to so much after it; 0: causal");
    table.flag("delay_form", delay_form,
               "true: the force repeats with the revolution, F(t) = F(t - T), in place of harmonics; no band "
               "limit, three times the cost; with lag 0, without track_speed, follow and sensor_matrix");
    table.flag("track_speed", track_speed,
               "true: no tachometer; the speed is told from the force, from the cutting condition's on; a "
               "memory of 2 "
               "revolutions serves it best");
    tracker.declare(table);
    table.number("settling_periods", settling_periods, "1", Range::notNegative(),
                 "settling times after a start or a gap that are marked SETTLING");
    table.flag("follow", follow,
               "moves the sensor's modes where the harmonics of the cut say that they have moved");
    table.number("follow_revolutions", follow_revolutions, "1", Range::positive(), "between two looks");
    table.part("follow_", follower);
    table.number("saturation", saturation, "N", Range::notNegative(),
                 "samples at or beyond it count as clipped; 0: not watched");
  }
  /// @throws Error naming key and value.
  void validate() const;
};

/// Counts for diagnostics, since the start.
struct CompensationHealth {
  std::size_t gaps = 0;        ///< jumps of the sample index
  std::size_t not_finite = 0;  ///< samples that are NaN or infinite
  std::size_t clipped = 0;     ///< samples at the saturation limit
  std::size_t moves = 0;       ///< times that the sensor's modes were found moved
  double innovation_ratio =
      0;  ///< [1] RMS innovation over the design's, last compensated block; 1 when the model fits
  /// [1] largest correlation of an axis' innovations with the ones before, last compensated block; 0 when the
  /// model tells all that can be told, beyond 0.3 something is left in them
  double colour = 0;
  std::array<double, 3> zero{
      {0, 0, 0}};        ///< [N] mean of the sensor without cutting (condition AIR or NONE), over seconds
  double speed = 0;      ///< [rad/s] of the running filters; 0: passing through
  double speed_std = 0;  ///< [rad/s] where the speed is tracked
};

/// Sensor blocks in, force blocks out with the same sample index. Inputs come in stamp order
/// (CompensationPipeline); the result depends only on them: the filters start anew at every cutting condition
/// and at a gap of the sample index. They follow a speed that moves slowly; their gains are those of the
/// nearest speed of a fine grid, and change without a jump.
class ForceCompensation {
 public:
  using Output = std::function<void(const ForceBlock& measured, const ForceBlock& compensated)>;

  /// @param measures_workpiece the sensor shows the reaction: turned here, once. @throws Error.
  ForceCompensation(const CompensationParameters& parameters, bool measures_workpiece, Output output);

  /// Model of an axis (0 x, 1 y, 2 z) from now on; filters start anew.
  void setSensor(std::size_t axis, const ModalModel& sensor) {
    setSensor(axis, sensor, parameters_.filter.noise_rms);
  }
  /// @param noise_rms [N] of one sample, > 0
  void setSensor(std::size_t axis, const ModalModel& sensor, double noise_rms);
  /// Cross-talk from now on: force of an axis also from what the others show. Its own axes serve as sensor
  /// models; later ones of setSensor() replace them, the cross-talk stays. @throws Error at the first block
  /// when the matrix cannot be inverted at a harmonic.
  void setMatrix(const SensorMatrix& matrix);
  bool hasSensor() const;
  /// Model in use. @throws std::bad_optional_access when there is none.
  const ModalModel& sensor(std::size_t axis) const { return sensor_.at(axis).value(); }

  /// @throws Error when channels fx, fy, fz are missing or not in N.
  void handle(const SampleBlock& block);
  void handle(const SpindleAngle& angle);
  void handle(const CuttingCondition& condition);

  /// End of data, or nothing more that belongs together: what waits for later samples comes out.
  void flush();

  /// A bag was restarted: as new, sensor models stay.
  void reset();

  const CompensationHealth& health() const { return health_; }

 private:
  void design(double speed, double sample_rate);
  void settle();
  ForceBlock measuredIn(const SampleBlock& block);
  void prepareFilters(double sample_rate);
  void prepareDelays(double sample_rate);
  void retune(double sample_rate);
  /// Sums over a block, each innovation over its design.
  struct Innovations {
    std::array<double, 3> last{}, own{}, neighbours{};
  };
  void take(std::size_t axis, double& sample, Innovations& innovations);
  template <class Filter>
  void judge(std::size_t axis, const Filter& filter, Innovations& innovations);
  void couple(std::array<std::vector<double>, 3>& force, std::size_t i);
  void track(std::array<std::vector<double>, 3>& force, std::size_t i, double sample_rate,
             Innovations& innovations);
  void run(std::array<std::vector<double>, 3>& force, double sample_rate);
  void layOutCrossTalk(double sample_rate);
  void follow(double time, double sample_rate);
  void watchZero(const ForceBlock& measured);
  void forgetMoves();
  void stop();
  void release();
  const std::vector<HarmonicGain>& gains(std::size_t axis, int grid_point, double sample_rate);

  CompensationParameters parameters_;
  double sign_;
  Output output_;
  std::array<std::optional<ModalModel>, 3> sensor_, told_;  // in use, as set
  std::array<double, 3> noise_rms_{{0, 0, 0}};              // [N]
  std::optional<SensorMatrix> matrix_;
  std::optional<CrossTalkInverse> cross_talk_;  // of matrix_ at the filters' speed
  std::vector<HarmonicFilter> filters_;         // of the axes with a model, in order; empty: to be laid out
  std::vector<DelayFilter> delays_;             // in their place with delay_form
  std::map<std::pair<std::size_t, int>, DelayFilter> delay_schedule_;  // laid out, by axis and point
  std::array<LagSmoother, 3> smoothers_;
  std::deque<std::pair<ForceBlock, ForceBlock>> waiting_;  // measured and causal, for their lag to pass
  std::map<std::pair<std::size_t, int>, std::vector<HarmonicGain>>
      schedule_;  // by axis and point of the speed grid
  int grid_point_ = 0;
  std::optional<CuttingCondition> condition_;
  std::optional<ModeFollower> follower_;
  std::optional<SpeedTracker> tracker_;
  std::size_t restarts_ = 0;                         // of all filters, as the tracker knows them
  std::array<std::vector<double>, 2> designed_for_;  // [Hz] modes' frequencies that the gains know
  SpindleAngle angle_;
  double next_look_ = 0.0;     // [s]
  std::size_t moves_ = 0;      // in this cut
  double design_rate_ = 0.0;   // [Hz]
  double speed_ = 0.0;         // [rad/s] newest
  double steady_speed_ = 0.0;  // [rad/s] from which readings are counted as a change
  double steady_since_ = -std::numeric_limits<double>::infinity();    // [s] of that reading
  double changing_until_ = -std::numeric_limits<double>::infinity();  // [s]
  std::optional<std::uint64_t> next_index_;
  double settling_left_ = 0.0;  // [s]
  CompensationHealth health_;
};

}  // namespace smartmill::kalman
