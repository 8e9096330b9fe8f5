#include "smartmill_kalman/following/mode_follower.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "cut_fit.h"
#include "cut_harmonics.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"

namespace smartmill::kalman {
namespace {

/// Sensor with one more mode per axis, at the frequency that reduces the innovations most.
/// @return nothing when there are too few harmonics, or the sensor has such a mode already
std::optional<Sensor> withHidden(const WeightedHarmonics& measured, const Sensor& sensor, const Basis& force,
                                 const std::array<std::size_t, 2>& tapped,
                                 const ModeFollowerParameters& parameters) {
  const std::size_t modes = tapped[0] + tapped[1];
  const auto unknowns = static_cast<Eigen::Index>(TERMS + 3 * (modes + 2));
  if (sensor[0].modes.size() + sensor[1].modes.size() > modes ||
      measured.rows() < unknowns + parameters.min_redundancy)
    return std::nullopt;
  const Eigen::MatrixXd even = measured.outputOf(sensor, force);
  const Eigen::VectorXd left = measured.innovations(sensor, force);
  Sensor best = sensor;
  double most = 0.0;
  for (double f = parameters.hidden_low; f < measured.highest(); f *= parameters.hidden_step) {
    Eigen::MatrixXd columns(measured.rows(), even.cols() + 2);
    columns.leftCols(even.cols()) = even;
    for (std::size_t axis = 0; axis < 2; ++axis)
      columns.col(even.cols() + static_cast<Eigen::Index>(axis)) =
          measured.hidden(axis, {f, parameters.hidden_damping, 1.0}, sensor, force);
    const Eigen::VectorXd x = leastSquares(columns, left, 1e-9);
    const double fall = left.squaredNorm() - (left - columns * x).squaredNorm();
    if (fall <= most) continue;
    most = fall;
    best = sensor;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const double gain = std::clamp(x(even.cols() + static_cast<Eigen::Index>(axis)), -0.2, 0.2);
      best[axis].modes.push_back({f, parameters.hidden_damping, gain});
      best[axis].direct -= gain;
    }
  }
  return best;
}

}  // namespace

void ModeFollowerParameters::validate() const {
  checkBounds(*this);
}

ModeFollower::ModeFollower(const ToolGeometry& tool, const Engagement& engagement, int harmonics,
                           const ModeFollowerParameters& parameters)
    : tool_(tool), engagement_(engagement), harmonics_(harmonics), parameters_(parameters) {
  parameters.validate();
  validate(tool);
  validate(engagement);
  if (harmonics < 1 || harmonics > static_cast<int>(REVOLUTION_POINTS / 4))
    throw Error("mode follower: no harmonics");
  radius_.assign(static_cast<std::size_t>(tool.teeth), 0.0);
}

std::optional<ModeFollower::Update> ModeFollower::update(const Harmonics& measured, double noise_std,
                                                         const std::array<ModalModel, 2>& now,
                                                         double spindle_speed) {
  const auto count = static_cast<std::size_t>(harmonics_) + 1;
  if (measured[0].size() < count || measured[1].size() < count)
    throw Error("mode follower: too few harmonics");
  if (!first_) first_ = now;
  const WeightedHarmonics harmonics(measured, count, noise_std, parameters_.misfit, now, spindle_speed);
  if (std::all_of(radius_.begin(), radius_.end(), [](double r) { return r == 0.0; }))
    radius_ = firstRadii(harmonics, now, tool_, engagement_);

  const std::array<std::size_t, 2> tapped{{(*first_)[0].modes.size(), (*first_)[1].modes.size()}};
  const auto residualsOf = [&](const Sensor& sensor) {
    return CutResiduals(harmonics, sensor, tool_, engagement_, radius_, parameters_, tapped);
  };
  // First the runout of the tool with the sensor in use: the cut without a shift of the modes.
  const CutResiduals residuals = residualsOf(now);
  CutFit cut(residuals);
  cut.fitRadii();
  const double unmoved = cut.cost();
  const std::vector<double> radius = cut.radii();
  Update update;
  update.before = cut.squares();
  const double first = harmonics.innovations(*first_, cut.force()).squaredNorm();
  const std::optional<Sensor> suspected = withHidden(harmonics, now, cut.force(), tapped, parameters_);
  cut.fitAll();
  update.after = cut.squares();
  update.sensor = cut.sensor();
  const double scale = scaleOf(harmonics, residuals, update.after);
  // A mode that is missing in the taps is accepted only when it explains the cut completely.
  if (suspected && scale > parameters_.unexplained) {
    const CutResiduals more = residualsOf(*suspected);
    CutFit hidden(more);
    hidden.fitAll();
    const double fall = std::min(cut.cost(), unmoved) - hidden.cost();
    const bool fully_explained = scaleOf(harmonics, more, hidden.squares()) <= 1.0 &&
                                 hidden.cost() < parameters_.max_cost_ratio * cut.cost();
    if (fully_explained && fall > parameters_.hidden_evidence * parameters_.evidence) {
      radius_ = hidden.radii();
      update.after = hidden.squares();
      update.sensor = hidden.sensor();
      return update;
    }
  }
  if ((unmoved - cut.cost()) / scale > parameters_.evidence) {
    radius_ = cut.radii();
    return update;
  }
  radius_ = radius;
  // Back to the tapped sensor when it explains the cut as well.
  if (first < update.before) {
    update.sensor = *first_;
    update.after = first;
    return update;
  }
  return std::nullopt;
}

}  // namespace smartmill::kalman
