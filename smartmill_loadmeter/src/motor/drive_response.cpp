#include "smartmill_loadmeter/motor/drive_response.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>

#include "smartmill_core/error.h"
#include "smartmill_core/fit/least_squares.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

using units::TWO_PI;

constexpr double LARGEST_RESIDUAL = 0.1;  // [1] largest residual of a move over the current
constexpr double START_TOLERANCE = 0.06;  // [s] longest interval between controller states
constexpr double MODEL_ERROR =
    0.03;  // [1] of a bandwidth by one move: a drive is only approximately a first-order lag
constexpr int CARRIER_STEPS = 7;  // carrier frequencies solution on each side
constexpr double LARGEST_QUADRATURE =
    0.05;  // [1] largest share of the lines' squares in quadrature to their carrier
constexpr double HIGHEST_FREQUENCY = 0.45;  // [1] largest frequency over the sample rate

/// Nonlinear unknowns of a move.
enum Unknown { BEGIN, ACCELERATION, VELOCITY, BANDWIDTH, DELAY, UNKNOWNS };
constexpr Eigen::Index SHARES = 6;  // acceleration, dry, viscous; each with the phase's sine and cosine
constexpr Eigen::Index LINEAR = SHARES + 3;

/// Trapezoidal velocity profile (triangular for a short distance) and its response behind a first-order lag.
class Profile {
 public:
  Profile(const DriveMove& move, const Eigen::VectorXd& at)
      : acceleration_(at[ACCELERATION]), lag_(1.0 / (TWO_PI * at[BANDWIDTH])) {
    fastest_ = std::min(at[VELOCITY], std::sqrt(move.distance * acceleration_));
    ramp_ = fastest_ / acceleration_;
    cruise_end_ = move.distance / fastest_;  // until deceleration starts
  }
  double fastest() const { return fastest_; }
  /// Position [m] at a time since the start [s].
  double position(double time) const {
    const double t = std::clamp(time, 0.0, cruise_end_ + ramp_);
    if (t < ramp_) return 0.5 * acceleration_ * t * t;
    const double braked = std::max(0.0, t - cruise_end_);
    return fastest_ * (t - 0.5 * ramp_) - 0.5 * acceleration_ * braked * braked;
  }
  /// Acceleration [m/s2], motion (0 or 1), velocity [m/s], each behind the lag.
  Eigen::Vector3d load(double time) const {
    const double up = time, top = time - ramp_, brake = time - cruise_end_, rest = time - cruise_end_ - ramp_;
    return {acceleration_ * (step(up) - step(top) - step(brake) + step(rest)), step(up) - step(rest),
            acceleration_ * (slope(up) - slope(top) - slope(brake) + slope(rest))};
  }

 private:
  double step(double t) const { return t > 0.0 ? -std::expm1(-t / lag_) : 0.0; }
  double slope(double t) const { return t > 0.0 ? t - lag_ * step(t) : 0.0; }

  double acceleration_, lag_, fastest_ = 0.0, ramp_ = 0.0, cruise_end_ = 0.0;
};

/// Columns of the linear unknowns: each share of the load under the phase's sine and cosine, the fifth
/// harmonic of the largest, a constant.
Eigen::MatrixXd columnsOf(const DriveMove& move, double phase_per_metre, const Eigen::VectorXd& at) {
  const auto count = static_cast<Eigen::Index>(move.current.size());
  const Profile profile(move, at);
  Eigen::MatrixXd columns(count, LINEAR);
  for (Eigen::Index i = 0; i < count; ++i) {
    const double time = static_cast<double>(i) / move.sample_rate - at[BEGIN];
    const double phase_angle = TWO_PI * phase_per_metre * profile.position(time);
    const Eigen::Vector3d load = profile.load(time - at[DELAY]);
    for (Eigen::Index k = 0; k < 3; ++k) {
      columns(i, 2 * k) = load[k] * std::sin(phase_angle);
      columns(i, 2 * k + 1) = load[k] * std::cos(phase_angle);
    }
    columns.row(i).tail<3>() << load[0] * std::sin(5.0 * phase_angle), load[0] * std::cos(5.0 * phase_angle),
        1.0;
  }
  return columns;
}

Eigen::VectorXd solveLinear(const Eigen::MatrixXd& columns, const Eigen::VectorXd& current) {
  Eigen::MatrixXd normal = columns.transpose() * columns;
  normal.diagonal() *= 1.0 + 1e-9;
  return linear::solveSymmetric(normal, Eigen::VectorXd(columns.transpose() * current));
}

/// Finds start and lag on a grid, because the many periods of the phase cause local minima.
void begin(const DriveMove& move, double phase_per_metre, const Eigen::VectorXd& current,
           Eigen::VectorXd* at) {
  double best = -1.0;
  Eigen::VectorXd one = *at;
  for (const double bandwidth : {10.0, 30.0, 90.0}) {
    one[BANDWIDTH] = bandwidth;
    for (double off = -START_TOLERANCE; off <= START_TOLERANCE; off += 0.5e-3) {
      one[BEGIN] = move.begin + off;
      if (one[BEGIN] < 0.0) continue;
      const Eigen::MatrixXd columns = columnsOf(move, phase_per_metre, one);
      const double explained = solveLinear(columns, current).dot(columns.transpose() * current);
      if (explained > best) best = explained, *at = one;
    }
  }
}

fit::Result refine(const DriveMove& move, double phase_per_metre, const Eigen::VectorXd& current,
                   const Eigen::VectorXd& at) {
  const double ramp = move.velocity / move.acceleration;
  const std::vector<fit::Parameter> start{
      {at[BEGIN], at[BEGIN] - 0.01, at[BEGIN] + 0.01, 1e-3},
      {at[ACCELERATION], 0.8 * at[ACCELERATION], 1.25 * at[ACCELERATION], 0.01 * at[ACCELERATION]},
      {at[VELOCITY], 0.9 * at[VELOCITY], 1.1 * at[VELOCITY], 0.01 * at[VELOCITY]},
      {at[BANDWIDTH], 2.0, HIGHEST_FREQUENCY * move.sample_rate, 20.0},
      {at[DELAY], -2e-3, std::min(5e-3, 0.5 * ramp), 1e-3}};
  const fit::FunctionResiduals residuals(current.size(), [&](const Eigen::VectorXd& v, Eigen::VectorXd& out) {
    const Eigen::MatrixXd columns = columnsOf(move, phase_per_metre, v);
    out = columns * solveLinear(columns, current) - current;
  });
  fit::Options options;
  options.iterations = 60;
  options.function_tolerance = 1e-8;
  return fit::minimise(residuals, start, options);
}

}  // namespace

std::optional<DriveResponse> identifyResponse(const DriveMove& move, double phase_per_metre) {
  const auto count = static_cast<Eigen::Index>(move.current.size());
  if (!(move.distance * phase_per_metre >= 2.0) || !(move.velocity > 0.0) || !(move.acceleration > 0.0) ||
      count < 8 * LINEAR || !(phase_per_metre * move.velocity < HIGHEST_FREQUENCY * move.sample_rate))
    return std::nullopt;
  const Eigen::VectorXd current = Eigen::Map<const Eigen::VectorXd>(move.current.data(), count);
  if (!current.allFinite()) return std::nullopt;
  Eigen::VectorXd at(static_cast<Eigen::Index>(UNKNOWNS));
  at << move.begin, move.acceleration, move.velocity, 0.0, 0.0;
  begin(move, phase_per_metre, current, &at);
  const fit::Result found = refine(move, phase_per_metre, current, at);
  if (!found.usable()) return std::nullopt;
  const Eigen::VectorXd linear = solveLinear(columnsOf(move, phase_per_metre, found.value), current);
  DriveResponse response;
  const Eigen::ArrayXd away = current.array() - current.mean();
  response.residual = std::sqrt(found.squares / away.square().sum());
  if (!(response.residual < LARGEST_RESIDUAL) || !found.moves[BANDWIDTH]) return std::nullopt;
  const double noise = std::sqrt(found.squares / static_cast<double>(count - UNKNOWNS - LINEAR));
  // The residual is not white (disturbance of the screw), which reduces the number of independent samples.
  const double lagResponse =
      found.residual.tail(count - 1).dot(found.residual.head(count - 1)) / found.squares;
  const double coloured = std::sqrt((1.0 + std::max(0.0, lagResponse)) / (1.0 - std::min(0.99, lagResponse)));
  const fit::Covariance covariance = found.covariance();
  response.bandwidth = {
      found.value[BANDWIDTH],
      std::hypot(MODEL_ERROR * found.value[BANDWIDTH], coloured * noise * covariance.deviation(BANDWIDTH))};
  // The range is twice the amplitude; friction has the phase of the acceleration.
  const double amplitude = std::hypot(linear[0], linear[1]);
  const Eigen::Vector2d phase(linear[0] / amplitude, linear[1] / amplitude);
  response.acceleration = {
      2.0 * amplitude,
      2.0 * amplitude * coloured * noise * covariance.deviation(ACCELERATION) / found.value[ACCELERATION]};
  response.friction = 2.0 * (phase.dot(linear.segment<2>(2)) +
                             Profile(move, found.value).fastest() * phase.dot(linear.segment<2>(4)));
  if (!std::isfinite(response.bandwidth.std_dev)) return std::nullopt;
  return response;
}

Estimate weightedMean(const std::vector<Estimate>& estimates) {
  if (estimates.empty()) throw Error("weighted mean: expected one estimate or more");
  double weight = 0.0, sum = 0.0, squares = 0.0;
  for (const Estimate& e : estimates) {
    const double one = 1.0 / (e.std_dev * e.std_dev);
    weight += one, sum += one * e.value;
  }
  const double mean = sum / weight, freedom = static_cast<double>(estimates.size()) - 1.0;
  for (const Estimate& e : estimates) squares += std::pow((e.value - mean) / e.std_dev, 2);
  const double factor = freedom > 0.0 ? std::max(1.0, squares / freedom) : 1.0;
  return {mean, std::sqrt(factor / weight)};
}

LagResponse lagResponse(double frequency, double bandwidth) {
  const double squared = 1.0 / (1.0 + std::pow(frequency / bandwidth, 2));
  return {std::sqrt(squared), 1.0 - squared};
}

std::vector<SpectralLine> cutLines(double speed, int teeth) {
  std::vector<SpectralLine> lines;
  const double revolution = speed / TWO_PI;
  if (!(revolution > 0.0)) return lines;
  if (teeth > 1) lines.push_back({revolution, 0, 0.0, 0.0});
  for (int k = 1; k <= TOOTH_HARMONICS; ++k) lines.push_back({k * teeth * revolution, k, 0.0, 0.0});
  return lines;
}

namespace {

/// Phase of the carrier from its static amplitude and all lines, given as pairs of amplitudes under sine and
/// cosine. When the cut cancels the range of the friction, only the lines determine it.
struct Carrier {
  Eigen::Vector2d direction;
  double quadrature = 0.0;  // share of the squares in quadrature
};

Carrier carrierOf(const std::vector<Eigen::Vector2d>& pairs) {
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector2d& pair : pairs) squares += pair * pair.transpose();
  const auto axes = linear::symmetricEigensystem(squares);
  return {axes.vectors.col(1), axes.values[0] / std::max(1e-300, axes.values[1])};
}

Eigen::MatrixXd modulated(Eigen::Index count, double sample_rate, double frequency,
                          const std::vector<SpectralLine>& lines) {
  Eigen::MatrixXd columns(count, static_cast<Eigen::Index>(5 + 4 * lines.size()));
  for (Eigen::Index i = 0; i < count; ++i) {
    const double time = static_cast<double>(i) / sample_rate, phase_angle = TWO_PI * frequency * time;
    const double s = 0.5 * std::sin(phase_angle), c = 0.5 * std::cos(phase_angle);
    columns.row(i).head(5) << s, c, 1.0, std::sin(5.0 * phase_angle), std::cos(5.0 * phase_angle);
    for (std::size_t k = 0; k < lines.size(); ++k) {
      const double line = TWO_PI * lines[k].frequency * time;
      columns.row(i).segment<4>(static_cast<Eigen::Index>(5 + 4 * k)) << s * std::cos(line),
          c * std::cos(line), s * std::sin(line), c * std::sin(line);
    }
  }
  return columns;
}

}  // namespace

std::vector<SpectralLine> fitSpectralLines(const std::vector<double>& current, double sample_rate,
                                           double frequency, const std::vector<SpectralLine>& lines) {
  std::vector<SpectralLine> found;
  for (const SpectralLine& line : lines) {
    if (line.frequency + frequency < HIGHEST_FREQUENCY * sample_rate) found.push_back(line);
  }
  const auto count = static_cast<Eigen::Index>(current.size());
  const auto unknowns = static_cast<Eigen::Index>(5 + 4 * found.size());
  if (found.empty() || count < 4 * unknowns) return {};
  const Eigen::VectorXd samples = Eigen::Map<const Eigen::VectorXd>(current.data(), count);
  // With a small static range the lines determine the carrier's frequency better than the sine fit.
  Eigen::VectorXd at;
  Eigen::MatrixXd covariance;
  double noise = std::numeric_limits<double>::infinity();
  for (int step = -CARRIER_STEPS; step <= CARRIER_STEPS; ++step) {
    const double one = frequency + 0.15 * step * sample_rate / static_cast<double>(count);
    if (!(one > 0.0)) continue;
    const Eigen::MatrixXd columns = modulated(count, sample_rate, one, found);
    const Eigen::MatrixXd inverse = linear::inverseSymmetric(Eigen::MatrixXd(columns.transpose() * columns));
    const Eigen::VectorXd solution = inverse * (columns.transpose() * samples);
    const double residual =
        (samples - columns * solution).squaredNorm() / static_cast<double>(count - unknowns);
    if (residual < noise) noise = residual, at = solution, covariance = inverse;
  }
  std::vector<Eigen::Vector2d> pairs{at.head<2>()};
  for (Eigen::Index c = 5; c < unknowns; c += 2) pairs.push_back(at.segment<2>(c));
  const Carrier carrier = carrierOf(pairs);
  if (!(carrier.quadrature < LARGEST_QUADRATURE)) return {};
  for (std::size_t k = 0; k < found.size(); ++k) {
    double power = 0.0, variance = 0.0;  // of each of the two amplitudes
    for (const std::size_t part : {2 * k + 1, 2 * k + 2}) {
      const auto c = static_cast<Eigen::Index>(3 + 2 * part);
      power += std::pow(carrier.direction.dot(pairs[part]), 2);
      variance += 0.5 * noise * carrier.direction.dot(covariance.block<2, 2>(c, c) * carrier.direction);
    }
    found[k].power = power - 2.0 * variance;
    found[k].power_std =
        std::sqrt(4.0 * std::max(0.0, found[k].power) * variance + 4.0 * variance * variance);
  }
  return found;
}

}  // namespace smartmill::loadmeter
