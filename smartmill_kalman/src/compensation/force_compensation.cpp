#include "smartmill_kalman/compensation/force_compensation.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <limits>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

/// Gains are laid out at speeds this share apart and serve this far from their own (in points of that grid).
constexpr double SPEED_GRID = 0.01, GRID_HYSTERESIS = 0.7;
constexpr double ZERO_TIME = 2.0;  // [s] over which the sensor's zero is told
/// Modes may move by this share before the gains are laid out anew.
constexpr double GAINS_BEAR = 0.01;
/// The harmonics follow the spindle when its speed has moved by this share.
constexpr double RETUNE = 1e-6;
/// A tracked speed reaches the filters every so many samples, and is known once its standard deviation is
/// below this share.
constexpr std::size_t TRACK_EVERY = 32;
constexpr double TRACKED = 1e-4;
/// A harmonic tells the speed when a standard deviation of it moves the harmonic by less than this share of
/// the harmonics' spacing; a few always do.
constexpr double TELLING = 0.15, LEAST_TELLING = 8.0;
constexpr double STEADY_TIME = 0.05;  // [s] without a change of speed before filters are laid out

}  // namespace

void CompensationParameters::validate() const {
  checkBounds(*this);
  // Following needs the angle of the teeth, which the force alone does not tell.
  if (track_speed && follow) throw Error("track_speed: follow needs the spindle's angle, false is due");
  if (delay_form && (track_speed || follow || lag > 0.0))
    throw Error("delay_form: track_speed, follow and lag need harmonics, false and 0 are due");
}

ForceCompensation::ForceCompensation(const CompensationParameters& parameters, bool measures_workpiece,
                                     Output output)
    : parameters_(parameters), sign_(measures_workpiece ? -1.0 : 1.0), output_(std::move(output)) {
  parameters_.validate();
}

void ForceCompensation::setSensor(std::size_t axis, const ModalModel& sensor, double noise_rms) {
  sensor_.at(axis) = told_.at(axis) = sensor;
  noise_rms_.at(axis) = noise_rms;
  stop();
  schedule_.clear();
  delay_schedule_.clear();
}

void ForceCompensation::setMatrix(const SensorMatrix& matrix) {
  if (parameters_.lag > 0.0)
    throw Error("lag: with a sensor matrix 0 is due, the smoother knows no cross-talk");
  if (parameters_.delay_form)
    throw Error("delay_form: with a sensor matrix false is due, it needs harmonics");
  for (std::size_t axis = 0; axis < 3; ++axis) setSensor(axis, matrix.h[axis][axis]);
  matrix_ = matrix;
}

void ForceCompensation::layOutCrossTalk(double sample_rate) {
  if (!matrix_) return;
  for (std::size_t axis = 0; axis < 3; ++axis) matrix_->h[axis][axis] = *sensor_[axis];
  int harmonics = filters_[0].harmonics();
  for (const HarmonicFilter& filter : filters_) harmonics = std::min(harmonics, filter.harmonics());
  cross_talk_.emplace(*matrix_, filters_[0].spindleSpeed(), sample_rate, harmonics);
}

bool ForceCompensation::hasSensor() const {
  for (const auto& sensor : sensor_) {
    if (!sensor) return false;
  }
  return true;
}

void ForceCompensation::handle(const SpindleAngle& angle) {
  if (parameters_.track_speed) return;
  // While the spindle speeds up or slows down there is no harmonic to follow: a layout would be out of date
  // before it has settled. A slow drift is followed.
  if (steady_speed_ > 0.0 && std::abs(angle.speed / steady_speed_ - 1.0) > parameters_.speed_tolerance) {
    changing_until_ = angle.stamp + STEADY_TIME;
    steady_since_ = -std::numeric_limits<double>::infinity();
  }
  if (steady_speed_ == 0.0 || angle.stamp - steady_since_ >= STEADY_TIME) {
    steady_speed_ = angle.speed;
    steady_since_ = angle.stamp;
  }
  speed_ = angle.speed;
  angle_ = angle;
}

// Filters start anew: what they have learnt ends here.
void ForceCompensation::stop() {
  flush();
  filters_.clear();
  delays_.clear();
}

void ForceCompensation::flush() {
  while (!waiting_.empty()) release();
}

// The oldest block, as the samples up to now tell it.
void ForceCompensation::release() {
  auto [measured, compensated] = std::move(waiting_.front());
  waiting_.pop_front();
  for (std::size_t axis = 0; axis < 3; ++axis)
    compensated.force[axis] = smoothers_[axis].take(compensated.force[axis].size());
  output_(measured, compensated);
}

void ForceCompensation::handle(const CuttingCondition& condition) {
  stop();
  condition_ = condition;
  if (parameters_.track_speed) {
    tracker_.reset();
    speed_ = condition.spindle_speed;
  }
  forgetMoves();
}

// What one cut has moved does not reach the next: results depend on nothing before a condition.
void ForceCompensation::forgetMoves() {
  if (moves_ > 0) {
    sensor_ = told_;
    schedule_.clear();
  }
  moves_ = 0;
}

void ForceCompensation::reset() {
  waiting_.clear();
  smoothers_ = {};
  filters_.clear();
  delays_.clear();
  next_index_.reset();
  speed_ = steady_speed_ = 0.0;
  tracker_.reset();
  condition_.reset();
  forgetMoves();
  changing_until_ = -std::numeric_limits<double>::infinity();
  health_ = {};
}

const std::vector<HarmonicGain>& ForceCompensation::gains(std::size_t axis, int grid_point,
                                                          double sample_rate) {
  std::vector<HarmonicGain>& gains = schedule_[{axis, grid_point}];
  if (gains.empty()) {
    HarmonicFilterParameters parameters = parameters_.filter;
    parameters.noise_rms = noise_rms_[axis];
    if (axis < 2) {
      designed_for_[axis].clear();
      for (const Mode& mode : sensor_[axis]->modes) designed_for_[axis].push_back(mode.frequency);
    }
    gains = designGains(*sensor_[axis], std::exp(grid_point * SPEED_GRID), sample_rate, parameters);
  }
  return gains;
}

// The force goes on where the layout changes while the spindle turns.
void ForceCompensation::design(double speed, double sample_rate) {
  if (design_rate_ != sample_rate) schedule_.clear();
  design_rate_ = sample_rate;
  grid_point_ = static_cast<int>(std::lround(std::log(speed) / SPEED_GRID));
  std::vector<HarmonicFilter> before;
  before.swap(filters_);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::vector<HarmonicGain>& scheduled = gains(axis, grid_point_, sample_rate);
    filters_.emplace_back(scheduled, *sensor_[axis], speed, sample_rate);
    if (!before.empty()) filters_[axis].adopt(before[axis]);
  }
  layOutCrossTalk(sample_rate);
  follower_.reset();
  if (parameters_.follow && condition_ && condition_->kind == CuttingCondition::Kind::cut) {
    const int harmonics = std::min(filters_[0].harmonics(), filters_[1].harmonics());
    if (harmonics > 0)
      follower_.emplace(condition_->tool, condition_->engagement, harmonics, parameters_.follower);
    next_look_ = 0.0;
  }
  if (before.empty()) settle();
}

void ForceCompensation::settle() {
  settling_left_ =
      parameters_.settling_periods * parameters_.filter.settling_revolutions * units::TWO_PI / speed_;
}

void ForceCompensation::follow(double time, double sample_rate) {
  const double revolution = units::TWO_PI / speed_;
  if (next_look_ == 0.0) next_look_ = time + parameters_.follow_revolutions * revolution;
  if (time < next_look_ || !filters_[0].settled() || !filters_[1].settled()) return;
  next_look_ = time + parameters_.follow_revolutions * revolution;
  const double angle = angle_.angle + speed_ * (time - angle_.stamp);
  ModeFollower::Harmonics harmonics;
  for (std::size_t axis = 0; axis < 2; ++axis) {
    harmonics[axis] = filters_[axis].measuredHarmonics();
    for (std::size_t n = 0; n < harmonics[axis].size(); ++n)
      harmonics[axis][n] *= std::polar(1.0, -static_cast<double>(n) * angle);
  }
  const double memory = parameters_.filter.memory_revolutions * revolution * sample_rate;  // [samples]
  const auto move = follower_->look(harmonics, std::max(noise_rms_[0], noise_rms_[1]) / std::sqrt(memory),
                                    {*sensor_[0], *sensor_[1]}, speed_);
  if (!move) return;
  ++health_.moves;
  ++moves_;
  // What waits for its lag is told with the modes that it was measured with.
  if (move->sensor[0].modes.size() != sensor_[0]->modes.size()) flush();
  for (std::size_t axis = 0; axis < 2; ++axis) {
    // The gains bear small moves.
    bool far = designed_for_[axis].size() != move->sensor[axis].modes.size();
    for (std::size_t k = 0; !far && k < designed_for_[axis].size(); ++k)
      far = std::abs(move->sensor[axis].modes[k].frequency / designed_for_[axis][k] - 1.0) > GAINS_BEAR;
    sensor_[axis] = move->sensor[axis];
    std::vector<HarmonicGain> fresh;
    if (far) {
      schedule_.erase(schedule_.lower_bound({axis, INT_MIN}), schedule_.upper_bound({axis, INT_MAX}));
      fresh = gains(axis, grid_point_, sample_rate);
    }
    filters_[axis].replaceSensor(*sensor_[axis], std::move(fresh));
  }
  layOutCrossTalk(sample_rate);
}

// A piezoelectric sensor drifts; without cutting its mean is its zero.
void ForceCompensation::watchZero(const ForceBlock& measured) {
  if (!condition_ || condition_->kind == CuttingCondition::Kind::cut || measured.force[0].empty()) return;
  const double length = static_cast<double>(measured.force[0].size());
  const double share = std::min(1.0, length / measured.sample_rate / ZERO_TIME);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double mean = 0.0;
    for (const double force : measured.force[axis]) mean += std::isfinite(force) ? force / length : 0.0;
    health_.zero[axis] += share * (mean - health_.zero[axis]);
  }
}

ForceBlock ForceCompensation::measuredIn(const SampleBlock& block) {
  std::array<std::size_t, 3> column{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    column[axis] = block.channel(FORCE_CHANNELS[axis]);
    if (block.units.at(column[axis]) != "N") {
      throw Error("force block: channel " + std::string(FORCE_CHANNELS[axis]) + " is in " +
                  block.units[column[axis]] + ", N is due");
    }
  }
  ForceBlock measured;
  measured.stamp = block.stamp;
  measured.sample_rate = block.sample_rate;
  measured.first_index = block.first_index;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double>& force = measured.force[axis];
    force.reserve(block.size());
    for (std::size_t i = 0; i < block.size(); ++i) {
      const double sample = block.at(i, column[axis]);
      if (!std::isfinite(sample)) ++health_.not_finite;
      if (parameters_.saturation > 0.0 && std::abs(sample) >= parameters_.saturation) ++health_.clipped;
      force.push_back(sign_ * sample);
    }
  }
  return measured;
}

/// The same of the delay form. Its gains are those of the speed at which the cut began, or of one as far on
/// as the harmonics' grid allows.
void ForceCompensation::prepareDelays(double sample_rate) {
  const bool fresh = delays_.empty();
  const double halves = 2.0 * units::TWO_PI / speed_ * sample_rate;
  const auto point = static_cast<int>(std::lround(halves));
  if (fresh || design_rate_ != sample_rate || std::abs(halves - grid_point_) > GRID_HYSTERESIS) {
    if (design_rate_ != sample_rate) delay_schedule_.clear();
    std::vector<DelayFilter> before;
    before.swap(delays_);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      auto scheduled = delay_schedule_.find({axis, point});
      if (scheduled == delay_schedule_.end()) {
        HarmonicFilterParameters parameters = parameters_.filter;
        parameters.noise_rms = noise_rms_[axis];
        const DelayFilter made(*sensor_[axis], 2.0 * units::TWO_PI * sample_rate / point, sample_rate,
                               parameters);
        scheduled = delay_schedule_.emplace(std::pair(axis, point), made).first;
      }
      delays_.push_back(scheduled->second);
      delays_[axis].retune(speed_);
      if (!before.empty() && design_rate_ == sample_rate) delays_[axis].adopt(before[axis]);
    }
    grid_point_ = point;
    design_rate_ = sample_rate;
    if (fresh) settle();
  } else if (std::abs(speed_ / delays_.front().spindleSpeed() - 1.0) > RETUNE) {
    for (DelayFilter& filter : delays_) filter.retune(speed_);
  }
}

/// Filters for the speed and rate of now: laid out anew, or turned to a speed that moved a little.
void ForceCompensation::prepareFilters(double sample_rate) {
  if (parameters_.delay_form) return prepareDelays(sample_rate);
  const double off_grid = std::abs(std::log(speed_) / SPEED_GRID - grid_point_);
  if (filters_.empty() || design_rate_ != sample_rate || off_grid > GRID_HYSTERESIS) {
    design(speed_, sample_rate);
  } else if (std::abs(speed_ / filters_.front().spindleSpeed() - 1.0) > RETUNE) {
    retune(sample_rate);
  }
  if (parameters_.track_speed && !tracker_) tracker_.emplace(parameters_.tracker, speed_, sample_rate);
}

void ForceCompensation::retune(double sample_rate) {
  for (std::size_t axis = 0; axis < 3; ++axis) filters_[axis].retune(*sensor_[axis], speed_);
  layOutCrossTalk(sample_rate);
}

void ForceCompensation::handle(const SampleBlock& block) {
  ForceBlock measured = measuredIn(block);
  if (next_index_ && *next_index_ != block.first_index) {
    ++health_.gaps;
    stop();
  }
  next_index_ = block.first_index + block.size();
  watchZero(measured);
  ForceBlock compensated = measured;
  if (!hasSensor() || speed_ < parameters_.least_speed || block.stamp < changing_until_) {
    stop();
    health_.speed = 0.0;
    compensated.status = ForceBlock::Status::passed_through;
    output_(measured, compensated);
    return;
  }
  prepareFilters(block.sample_rate);
  health_.speed = parameters_.delay_form ? delays_.front().spindleSpeed() : filters_.front().spindleSpeed();
  run(compensated.force, block.sample_rate);
  const bool settling = settling_left_ > 0.0 || (tracker_ && tracker_->speedStd() > TRACKED * speed_);
  compensated.status = settling ? ForceBlock::Status::settling : ForceBlock::Status::compensated;
  settling_left_ -= static_cast<double>(block.size()) / block.sample_rate;
  if (parameters_.lag > 0.0) {
    waiting_.emplace_back(std::move(measured), std::move(compensated));
    const auto lag = static_cast<std::size_t>(std::lround(parameters_.lag * block.sample_rate));
    while (!waiting_.empty() && smoothers_[0].waiting() >= waiting_.front().first.force[0].size() + lag)
      release();
  } else {
    output_(measured, compensated);
  }
  if (follower_) follow(block.timeOf(block.size()), block.sample_rate);
}

void ForceCompensation::take(std::size_t axis, double& sample, Innovations& innovations) {
  HarmonicFilter& filter = filters_[axis];
  // A sample that is not a number is bridged by the model, never passed on.
  if (parameters_.lag > 0.0) {
    sample = smoothers_[axis].step(filter, sample);
  } else {
    sample = std::isfinite(sample) ? filter.step(sample) : filter.coast();
  }
  judge(axis, filter, innovations);
}

template <class Filter>
void ForceCompensation::judge(std::size_t axis, const Filter& filter, Innovations& innovations) {
  const double innovation = filter.innovation() / filter.innovationStd();
  innovations.own[axis] += innovation * innovation;
  innovations.neighbours[axis] += innovation * innovations.last[axis];
  innovations.last[axis] = innovation;
}

void ForceCompensation::couple(std::array<std::vector<double>, 3>& force, std::size_t i) {
  std::array<double, 3> now{{force[0][i], force[1][i], force[2][i]}};
  cross_talk_->add(filters_, now);
  for (std::size_t axis = 0; axis < 3; ++axis) force[axis][i] = now[axis];
}

/// The samples of one time, and what they tell of the speed.
void ForceCompensation::track(std::array<std::vector<double>, 3>& force, std::size_t i, double sample_rate,
                              Innovations& innovations) {
  const std::size_t level = std::min({filters_[0].level(), filters_[1].level(), filters_[2].level()});
  const double memory = parameters_.filter.memory(level) * units::TWO_PI / speed_;
  // A harmonic that may lie nearer to its neighbour's place than to its own would mislead.
  const double highest = std::max(LEAST_TELLING, TELLING * speed_ / tracker_->speedStd());
  // Root of the sum of n^2: what harmonics of noise make of a slope.
  const double n = std::min(highest, static_cast<double>(filters_.front().harmonics()));
  const double slope_gain = std::sqrt(n * (n + 1.0) * (2.0 * n + 1.0) / 6.0);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double slope = filters_[axis].slope(highest);
    take(axis, force[axis][i], innovations);
    tracker_->update(axis, filters_[axis].innovation(), slope, noise_rms_[axis],
                     noise_rms_[axis] * slope_gain / std::sqrt(memory * sample_rate));
  }
  if (matrix_) couple(force, i);
  tracker_->predict(speed_, memory);
  std::size_t restarts = 0;
  for (const HarmonicFilter& filter : filters_) restarts += filter.restarts();
  if (restarts != restarts_) tracker_->reopen();
  restarts_ = restarts;
  if ((i + 1) % TRACK_EVERY == 0 && std::abs(tracker_->speed() / speed_ - 1.0) > RETUNE) {
    speed_ = tracker_->speed();
    retune(sample_rate);
  }
}

/// Takes a block's samples through the filters, in place.
void ForceCompensation::run(std::array<std::vector<double>, 3>& force, double sample_rate) {
  Innovations innovations;
  const std::size_t count = force[0].size();
  if (tracker_) {
    for (std::size_t i = 0; i < count; ++i) track(force, i, sample_rate, innovations);
    health_.speed = speed_;
    health_.speed_std = tracker_->speedStd();
  } else if (matrix_) {
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) take(axis, force[axis][i], innovations);
      couple(force, i);
    }
  } else if (parameters_.delay_form) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (double& sample : force[axis]) {
        sample = std::isfinite(sample) ? delays_[axis].step(sample) : delays_[axis].coast();
        judge(axis, delays_[axis], innovations);
      }
    }
  } else {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (double& sample : force[axis]) take(axis, sample, innovations);
    }
  }
  double squares = 0.0;
  health_.colour = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double own = innovations.own[axis];
    squares += own;
    if (own > 0.0) health_.colour = std::max(health_.colour, std::abs(innovations.neighbours[axis] / own));
  }
  health_.innovation_ratio = count == 0 ? 0.0 : std::sqrt(squares / (3.0 * static_cast<double>(count)));
}

}  // namespace smartmill::kalman
