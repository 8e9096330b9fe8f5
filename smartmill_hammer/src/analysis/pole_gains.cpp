#include "smartmill_hammer/analysis/pole_gains.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>

#include <Eigen/Core>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::hammer {

using Complex = std::complex<double>;
using Eigen::Index;

namespace {

/// Weighted least-squares rows: real and imaginary part of each line. The last two columns are the residual
/// terms: a constant and the square of the frequency.
struct WeightedLines {
  Eigen::MatrixXd a;
  Eigen::VectorXd b;
  Index residual_column = 0;  // first of the residual terms

  /// @param columns_at the other columns at a frequency [Hz]
  template <class Columns>
  WeightedLines(const FrequencyResponse& band, const std::vector<Complex>& value, Index columns, double high,
                const Columns& columns_at)
      : a(2 * static_cast<Index>(band.size()), columns + 2),
        b(2 * static_cast<Index>(band.size())),
        residual_column(columns) {
    if (a.rows() <= a.cols())
      throw Error("gains of known modes: " + std::to_string(band.size()) +
                  " lines, expected more than unknowns");
    std::vector<Complex> row;
    for (std::size_t i = 0; i < band.size(); ++i) {
      const double std = i < band.std_dev.size() ? band.std_dev[i] : NAN;
      const double weight = std > 0.0 ? std::sqrt(2.0) / std : 1.0;
      row.clear();
      columns_at(band.frequency[i], row);
      row.push_back(1.0);
      row.push_back(std::pow(band.frequency[i] / high, 2));
      const auto at = static_cast<Index>(2 * i);
      for (Index k = 0; k < a.cols(); ++k) {
        const Complex cell = weight * row[static_cast<std::size_t>(k)];
        a(at, k) = cell.real();
        a(at + 1, k) = cell.imag();
      }
      b(at) = weight * value[i].real();
      b(at + 1) = weight * value[i].imag();
    }
  }
};

Mode withUnitGain(Mode mode) {
  mode.gain = 1.0;
  return mode;
}

}  // namespace

ModalModel gainsAtPoles(const FrequencyResponse& frf, const ModalModel& poles, double low, double high) {
  const FrequencyResponse band = frf.band(low, high);
  const WeightedLines lines(band, band.value, static_cast<Index>(poles.modes.size()), high,
                            [&](double f, std::vector<Complex>& row) {
                              for (const Mode& mode : poles.modes)
                                row.push_back(withUnitGain(mode).response(f));
                            });
  const Eigen::MatrixXd inverse = linear::inverseSymmetric(Eigen::MatrixXd(lines.a.transpose() * lines.a));
  const Eigen::VectorXd x = inverse * (lines.a.transpose() * lines.b);
  if (!x.allFinite()) throw Error("gains of known modes: the lines do not distinguish two of them");
  const double misfit =
      (lines.a * x - lines.b).squaredNorm() / static_cast<double>(lines.b.size() - x.size());
  const auto std = [&](Index k) { return std::sqrt(std::max(0.0, inverse(k, k)) * std::max(1.0, misfit)); };
  ModalModel model = poles;
  for (Index k = 0; k < lines.residual_column; ++k) {
    model.modes[static_cast<std::size_t>(k)].gain = x(k);
    model.modes[static_cast<std::size_t>(k)].gain_std = std(k);
  }
  model.direct = x(lines.residual_column);
  model.direct_std = std(lines.residual_column);
  return model;
}

ModalModel modeShifts(const FrequencyResponse& frf, const std::vector<Complex>& change,
                      const ModalModel& model, double low, double high) {
  constexpr double STEP = 1e-6;  // [1] relative, of frequency and damping
  FrequencyResponse changed = frf;
  changed.value = change;
  const FrequencyResponse band = changed.band(low, high);
  const WeightedLines lines(band, band.value, 3 * static_cast<Index>(model.modes.size()), high,
                            [&](double f, std::vector<Complex>& row) {
                              for (const Mode& mode : model.modes) {
                                Mode faster = mode, damped = mode;
                                faster.frequency *= 1.0 + STEP;
                                damped.damping_ratio *= 1.0 + STEP;
                                const Complex here = mode.response(f);
                                row.push_back((faster.response(f) - here) / STEP);
                                row.push_back((damped.response(f) - here) / STEP);
                                row.push_back(here);
                              }
                            });
  // Relative shifts, so that the columns are of similar size.
  const Eigen::MatrixXd inverse = linear::inverseSymmetric(Eigen::MatrixXd(lines.a.transpose() * lines.a));
  const Eigen::VectorXd x = inverse * (lines.a.transpose() * lines.b);
  if (!x.allFinite()) throw Error("shift of modes: the lines do not distinguish two of them");
  ModalModel shift = model;
  for (std::size_t k = 0; k < model.modes.size(); ++k) {
    const auto at = static_cast<Index>(3 * k);
    shift.modes[k].frequency *= x(at);
    shift.modes[k].damping_ratio *= x(at + 1);
    shift.modes[k].gain *= x(at + 2);
  }
  shift.direct = x(lines.residual_column);
  return shift;
}

FrequencyResponse crossTipResponse(const FrequencyResponse& cross, const TipCorrection& correction,
                                   double low, double high) {
  ModalModel poles;
  std::vector<const TipMode*> tips;
  for (const TipMode& tip : correction.modes) {
    if (!tip.measured) continue;
    poles.modes.push_back(tip.direct);
    tips.push_back(&tip);
  }
  const ModalModel measured = gainsAtPoles(cross, poles, low, high);
  FrequencyResponse frf = cross;
  frf.std_dev.resize(frf.size(), 0.0);
  for (std::size_t i = 0; i < frf.size(); ++i) {
    double variance = std::pow(frf.std_dev[i], 2);
    for (std::size_t k = 0; k < tips.size(); ++k) {
      const Complex u = measured.modes[k].response(frf.frequency[i]);
      frf.value[i] += (tips[k]->factor - 1.0) * u;
      variance += std::norm(u) * std::pow(tips[k]->factor_std, 2);
    }
    frf.std_dev[i] = std::sqrt(variance);
  }
  return frf;
}

}  // namespace smartmill::hammer
