#include "smartmill_kalman/following/mode_follower.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/following/runout_force.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;
constexpr std::size_t POINTS = 1024;  // a revolution
constexpr int MAX_ITERATIONS = 20;
constexpr double RADIUS_UNIT = 1e-6;  // [m]
constexpr double RADIUS_STD = 20.0;   // [RADIUS_UNIT]

void requirePositive(const char* key, double value) {
  if (!(value > 0.0) || !std::isfinite(value)) throw Error(std::string(key) + ": above 0 is due");
}

/// Modes moved by p: log frequency, log damping of each in turn, x then y.
std::array<ModalModel, 2> moved(const std::array<ModalModel, 2>& from, const Eigen::VectorXd& p) {
  std::array<ModalModel, 2> sensor = from;
  Eigen::Index at = 0;
  for (ModalModel& axis : sensor) {
    for (Mode& mode : axis.modes) {
      mode.frequency *= std::exp(p(at++));
      mode.damping_ratio = std::min(0.9, mode.damping_ratio * std::exp(p(at++)));
    }
  }
  return sensor;
}

}  // namespace

void FollowParameters::validate() const {
  requirePositive("misfit", misfit);
  requirePositive("frequency_std", frequency_std);
  requirePositive("damping_std", damping_std);
  requirePositive("evidence", evidence);
}

ModeFollower::ModeFollower(const ToolGeometry& tool, const Engagement& engagement, int harmonics,
                           const FollowParameters& parameters)
    : tool_(tool), engagement_(engagement), harmonics_(harmonics), parameters_(parameters) {
  parameters.validate();
  validate(tool);
  validate(engagement);
  if (harmonics < 1 || harmonics > static_cast<int>(POINTS / 4)) throw Error("mode follower: no harmonics");
  radius_.assign(static_cast<std::size_t>(tool.teeth), 0.0);
}

// Harmonics of the force for each coefficient alone: tangential and radial, chip and edge.
ModeFollower::Basis ModeFollower::harmonicsOf(const ToolGeometry& tool,
                                              const std::vector<double>& radius) const {
  const double chip = 1.0 / engagement_.feed_per_tooth;
  const std::array<CuttingCoefficients, TERMS> unit{
      {{chip, 0, 0, 0, 0, 0}, {0, chip, 0, 0, 0, 0}, {0, 0, 0, 1, 0, 0}, {0, 0, 0, 0, 1, 0}}};
  Basis result;
  for (std::size_t u = 0; u < TERMS; ++u) {
    const auto force = revolutionForce(tool, unit[u], engagement_, radius, POINTS);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      result[u][axis] = fourier(force[axis]);
      for (Complex& value : result[u][axis]) value *= 2.0 / POINTS;
      result[u][axis][0] *= 0.5;
    }
  }
  return result;
}

std::optional<ModeFollower::Move> ModeFollower::look(const Harmonics& measured, double noise_std,
                                                     const std::array<ModalModel, 2>& now,
                                                     double spindle_speed) {
  const auto n_max = static_cast<std::size_t>(harmonics_) + 1;  // the mean first: it tells the pressures
  if (measured[0].size() < n_max || measured[1].size() < n_max)
    throw Error("mode follower: too few harmonics");
  if (!first_ || (*first_)[0].modes.size() != now[0].modes.size() ||
      (*first_)[1].modes.size() != now[1].modes.size()) {
    first_ = now;
  }
  const auto rows = static_cast<Eigen::Index>(4 * n_max), terms = static_cast<Eigen::Index>(TERMS);
  const auto modal = static_cast<Eigen::Index>(2 * (now[0].modes.size() + now[1].modes.size()));
  const auto freedom =
      modal + static_cast<Eigen::Index>(tool_.teeth - 1);  // the first tooth's radius is the datum
  const auto frequency = [&](std::size_t n) {
    return static_cast<double>(n) * spindle_speed / units::TWO_PI;
  };

  // What the force model misses passes the sensor too.
  std::array<double, 2> largest{};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    for (std::size_t n = 0; n < n_max; ++n) {
      largest[axis] = std::max(largest[axis], std::abs(measured[axis][n]) /
                                                  std::max(1.0, std::abs(now[axis].response(frequency(n)))));
    }
  }
  Eigen::VectorXd weight(rows), target(rows);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    for (std::size_t n = 0; n < n_max; ++n) {
      const double passed = std::abs(now[axis].response(frequency(n)));
      const double missed =
          parameters_.misfit * std::max(0.1 * passed * largest[axis], std::abs(measured[axis][n]));
      const auto row = static_cast<Eigen::Index>(2 * (axis * n_max + n));
      weight(row) = weight(row + 1) = 1.0 / std::hypot(noise_std, missed);
      target(row) = measured[axis][n].real();
      target(row + 1) = measured[axis][n].imag();
    }
  }
  target.array() *= weight.array();
  const auto fill = [&](Eigen::MatrixXd& seen, Eigen::Index column, const std::array<ModalModel, 2>& sensor,
                        const auto& harmonic) {
    for (std::size_t axis = 0; axis < 2; ++axis) {
      for (std::size_t n = 0; n < n_max; ++n) {
        const Complex y = sensor[axis].response(frequency(n)) * harmonic(axis, n);
        const auto row = static_cast<Eigen::Index>(2 * (axis * n_max + n));
        seen(row, column) = weight(row) * y.real();
        seen(row + 1, column) = weight(row) * y.imag();
      }
    }
  };
  const auto columns = [&](const std::array<ModalModel, 2>& sensor, const Basis& basis) {
    Eigen::MatrixXd seen(rows, terms);
    for (Eigen::Index j = 0; j < terms; ++j) {
      fill(seen, j, sensor,
           [&](std::size_t axis, std::size_t n) { return basis[static_cast<std::size_t>(j)][axis][n]; });
    }
    return seen;
  };
  // To first order runout adds to each tooth's edge force what its chip is thicker by: tells the radii to
  // begin with.
  if (std::all_of(radius_.begin(), radius_.end(), [](double r) { return r == 0.0; })) {
    ToolGeometry one = tool_;
    one.teeth = 1;
    one.pitch.clear();
    const Basis tooth = harmonicsOf(one, {0.0});
    const Eigen::MatrixXd even = columns(now, harmonicsOf(tool_, radius_));
    const Eigen::VectorXd x = (even.transpose() * even).ldlt().solve(even.transpose() * target);
    Eigen::MatrixXd seen(rows, tool_.teeth);
    for (int k = 0; k < tool_.teeth; ++k) {
      fill(seen, k, now, [&](std::size_t axis, std::size_t n) {
        const Complex turned = std::polar(1.0, static_cast<double>(n) * tool_.toothAngle(k));
        return turned * (x(0) * tooth[2][axis][n] + x(1) * tooth[3][axis][n]) / engagement_.feed_per_tooth;
      });
    }
    Eigen::MatrixXd normal = seen.transpose() * seen;
    normal.diagonal().array() *= 1.0 + 1e-6;
    const Eigen::VectorXd thicker = normal.ldlt().solve(seen.transpose() * (target - even * x));  // [m]
    for (Eigen::Index k = 0; k + 1 < tool_.teeth; ++k) {
      // Tooth k cuts what tooth k + 1 has left.
      const double limit = 0.5 * engagement_.feed_per_tooth;
      radius_[static_cast<std::size_t>(k + 1)] =
          radius_[static_cast<std::size_t>(k)] - std::clamp(thicker(k) - thicker.mean(), -limit, limit);
    }
  }
  // Residual with the force model's numbers at their best for this sensor.
  const auto innovations = [&](const std::array<ModalModel, 2>& sensor, const Basis& basis) {
    const Eigen::MatrixXd seen = columns(sensor, basis);
    Eigen::MatrixXd normal = seen.transpose() * seen;
    normal.diagonal().array() *= 1.0 + 1e-10;
    return Eigen::VectorXd(target - seen * normal.ldlt().solve(seen.transpose() * target));
  };
  Eigen::VectorXd prior(freedom);
  for (Eigen::Index i = 0; i < freedom; ++i) {
    prior(i) = 1.0 / (i >= modal   ? RADIUS_STD
                      : i % 2 == 0 ? parameters_.frequency_std
                                   : parameters_.damping_std);
  }
  const auto radii = [&](const Eigen::VectorXd& at) {
    std::vector<double> radius = radius_;
    for (Eigen::Index i = modal; i < freedom; ++i)
      radius[static_cast<std::size_t>(i - modal + 1)] += RADIUS_UNIT * at(i);
    return radius;
  };

  // Least squares over the unknowns from `first` on; the ones before stay as they are.
  Eigen::VectorXd p = Eigen::VectorXd::Zero(freedom);
  Basis force = harmonicsOf(tool_, radius_);
  Eigen::VectorXd residual = innovations(now, force);
  double best = 0.0;
  const auto cost = [&](const Eigen::VectorXd& r, const Eigen::VectorXd& at) {
    return r.squaredNorm() + (prior.array() * at.array()).square().sum();
  };
  const auto descend = [&](Eigen::Index first) {
    best = cost(residual, p);
    double damping = 1e-3;
    const Eigen::Index free = freedom - first;
    for (int iteration = 0; iteration < MAX_ITERATIONS; ++iteration) {
      Eigen::MatrixXd slope(rows, free);
      for (Eigen::Index i = first; i < freedom; ++i) {
        const double step = i < modal ? 1e-5 : 0.05;
        Eigen::VectorXd other = p;
        other(i) += step;
        const auto sensor = moved(now, other);
        slope.col(i - first) =
            (innovations(sensor, i < modal ? force : harmonicsOf(tool_, radii(other))) - residual) / step;
      }
      const auto weightOf = prior.tail(free).array().square();
      Eigen::MatrixXd normal = slope.transpose() * slope;
      normal.diagonal().array() += weightOf;
      const Eigen::VectorXd gradient =
          slope.transpose() * residual + (weightOf * p.tail(free).array()).matrix();
      bool better = false;
      double gained = 0.0;
      for (int attempt = 0; attempt < 8 && !better; ++attempt) {
        Eigen::MatrixXd damped = normal;
        damped.diagonal() *= 1.0 + damping;
        Eigen::VectorXd trial = p;
        trial.tail(free) -= damped.ldlt().solve(gradient);
        const Basis trial_force = harmonicsOf(tool_, radii(trial));
        const Eigen::VectorXd trial_residual = innovations(moved(now, trial), trial_force);
        const double trial_cost = cost(trial_residual, trial);
        if (trial_cost < best) {
          gained = best - trial_cost;
          best = trial_cost;
          p = trial;
          force = trial_force;
          residual = trial_residual;
          damping *= 0.2;
          better = true;
        } else {
          damping *= 6.0;
        }
      }
      if (!better || gained < 1e-3 * best) break;
    }
  };
  // The tool's runout first, with the sensor as believed: that is what the cut may be without any move.
  Move move;
  descend(modal);
  move.before = residual.squaredNorm();
  const double unmoved = best;
  const std::vector<double> radius = radii(p);
  const Basis unmoved_force = force;
  descend(0);
  move.after = residual.squaredNorm();
  move.sensor = moved(now, p);
  // The force model's own shortcomings raise what counts as evidence.
  const double scale = std::max(1.0, move.after / static_cast<double>(rows - terms - freedom));
  const double first = innovations(*first_, unmoved_force).squaredNorm();
  if ((unmoved - best) / scale > parameters_.evidence) {
    radius_ = radii(p);
    return move;
  }
  radius_ = radius;
  // Back to the taps when they explain the cut as well.
  if (first < move.before) {
    move.sensor = *first_;
    move.after = first;
    return move;
  }
  return std::nullopt;
}

}  // namespace smartmill::kalman
