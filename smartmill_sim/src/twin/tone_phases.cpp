#include "twin/tone_phases.h"

#include <cmath>
#include <complex>

#include <Eigen/Dense>

#include "smartmill_core/units.h"

namespace smartmill::sim {

void findPhases(const Record* recorded, const ChannelRows& raw, double rate, double speed,
                const SignalStage& signals, std::mt19937_64& random) {
  const std::vector<Tone*> tones = signals.tones();
  if (tones.empty()) return;
  if (!recorded) {
    for (Tone* tone : tones) tone->phase = std::uniform_real_distribution<double>(0.0, units::TWO_PI)(random);
    return;
  }
  const ChannelValues limits = signals.limits();
  const auto n = static_cast<Eigen::Index>(2 * tones.size());
  std::vector<double> amplitude;
  for (Tone* tone : tones) {
    amplitude.insert(amplitude.end(), tone->amplitude.begin(), tone->amplitude.end());
    tone->amplitude.fill(0.0);
  }
  const auto amplitudeOf = [&](Eigen::Index tone, std::size_t channel) {
    return amplitude[static_cast<std::size_t>(tone) * CHANNEL_COUNT + channel];
  };
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(n);
  for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) {
    bool in_channel = false;
    for (Eigen::Index k = 0; k < n / 2; ++k) in_channel = in_channel || amplitudeOf(k, c) != 0.0;
    if (!in_channel || !raw[c] || !recorded->has(channelName(c))) continue;
    const std::vector<double>& measured = recorded->column(channelName(c));
    Eigen::MatrixXd square = Eigen::MatrixXd::Zero(n + 1, n + 1);  // last: the mean
    Eigen::VectorXd product = Eigen::VectorXd::Zero(n + 1), row = Eigen::VectorXd::Ones(n + 1);
    for (std::size_t i = 0; i < measured.size(); ++i) {
      if (std::abs(measured[i]) > 0.98 * limits[c]) continue;
      const double t = static_cast<double>(i) / rate;
      ChannelValues values{};
      values[c] = (*raw[c])[i];
      signals.apply(t, values);
      for (Eigen::Index k = 0; k < n / 2; ++k) {
        const Tone& tone = *tones[static_cast<std::size_t>(k)];
        const std::complex<double> wave =
            amplitudeOf(k, c) * tone.response[c] * std::polar(1.0, tone.rate(speed) * t);
        row(2 * k) = wave.imag();
        row(2 * k + 1) = wave.real();
      }
      square += row * row.transpose();
      product += row * (measured[i] - values[c]);
    }
    if (square(n, n) <= 0.0) continue;
    const Eigen::VectorXd mean = square.col(n) / square(n, n);
    normal += (square - mean * square.row(n)).topLeftCorner(n, n);
    right += (product - mean * product(n)).head(n);
  }
  const Eigen::VectorXd wave = normal.completeOrthogonalDecomposition().solve(right);
  for (Eigen::Index k = 0; k < n / 2; ++k) {
    Tone& tone = *tones[static_cast<std::size_t>(k)];
    for (std::size_t c = 0; c < CHANNEL_COUNT; ++c) tone.amplitude[c] = amplitudeOf(k, c);
    tone.phase = std::atan2(wave(2 * k + 1), wave(2 * k));
  }
}

}  // namespace smartmill::sim
