#include "smartmill_core/signal/revolution_window.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/interpolate.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

/// Removes the slow change of a signal that repeats with a period: at each place of the period a cosine
/// series over the periods, without its mean. @param period [samples] a divisor of the length @param terms of
/// the series; the fastest makes half of them in cycles along the signal
void removeSlowChange(std::vector<double>& signal, std::size_t period, std::size_t terms) {
  const std::size_t periods = signal.size() / period;
  const auto count = static_cast<double>(periods);
  std::vector<double> wave(periods);
  for (std::size_t term = 1; term <= terms; ++term) {
    for (std::size_t k = 0; k < periods; ++k)
      wave[k] = std::cos(units::PI * static_cast<double>(term) * (static_cast<double>(k) + 0.5) / count);
    std::vector<double> amplitude(period, 0.0);
    for (std::size_t i = 0; i < signal.size(); ++i)
      amplitude[i % period] += 2.0 / count * wave[i / period] * signal[i];
    for (std::size_t i = 0; i < signal.size(); ++i) signal[i] -= wave[i / period] * amplitude[i % period];
  }
}

}  // namespace

RevolutionWindow::RevolutionWindow(std::size_t bins, std::size_t turns, int teeth, Cut cut)
    : bins_(bins),
      turns_(turns),
      cut_(cut),
      half_(teeth > 0 && teeth % 2 == 0 ? static_cast<std::size_t>(teeth) / 2 : 0),
      teeth_(teeth),
      remainder_of_turn_(turns, 0.0),
      taper_(hannWindow(bins * turns)),
      of_order_(bins / 2 + 1, 0.0),
      power_(bins * turns / 2 + 1, 0.0) {
}

void RevolutionWindow::add(std::vector<double> channel) {
  const auto n = static_cast<double>(channel.size());
  double mean = 0.0;
  std::vector<double> repeated(bins_, 0.0);
  for (std::size_t i = 0; i < channel.size(); ++i) {
    mean += channel[i] / n;
    repeated[i % bins_] += channel[i] / static_cast<double>(turns_);
  }
  // The mean over the revolutions removes 1 / turns of the energy of the remainder.
  const double share = static_cast<double>(turns_) / static_cast<double>(turns_ - 1);
  for (std::size_t i = 0; i < channel.size(); ++i) {
    total_ += (channel[i] - mean) * (channel[i] - mean) / n;
    channel[i] -= repeated[i % bins_];
  }
  if (cut_ == Cut::unsteady) {
    constexpr std::size_t WHOLE_CYCLE = 2;
    removeSlowChange(channel, bins_, WHOLE_CYCLE);
    removeSlowChange(channel, bins_ / static_cast<std::size_t>(teeth_), turns_);
  }
  for (std::size_t i = 0; i < channel.size(); ++i) {
    remainder_ += share * channel[i] * channel[i] / n;
    remainder_of_turn_[i / bins_] += share * channel[i] * channel[i] / static_cast<double>(bins_);
    channel[i] *= taper_[i];
  }
  addOrders(repeated);
  const auto spectrum = fourier(channel);
  constexpr double MEAN_SQUARE = 0.375;  // of the Hann window
  const double scale = 2.0 * share / (MEAN_SQUARE * n * n);
  for (std::size_t k = 0; k < power_.size(); ++k) power_[k] += scale * std::norm(spectrum[k]);
}

void RevolutionWindow::add(const std::vector<double>& series, double start, double revolution) {
  std::vector<double> channel;
  channel.reserve(bins_ * turns_);
  for (std::size_t i = 0; i < bins_ * turns_; ++i) {
    const double position = start + revolution * static_cast<double>(i) / static_cast<double>(bins_);
    const auto at = static_cast<std::size_t>(position);
    channel.push_back(catmullRom(series[at - 1], series[at], series[at + 1], series[at + 2],
                                 position - static_cast<double>(at)));
  }
  add(std::move(channel));
}

double RevolutionWindow::strongestFlipOrder() const {
  std::size_t strongest = 0;
  for (std::size_t k = half_; half_ > 0 && 2 * k < bins_; k += 2 * half_)
    if (strongest == 0 || of_order_[k] > of_order_[strongest]) strongest = k;
  return static_cast<double>(strongest);
}

void RevolutionWindow::addOrders(const std::vector<double>& repeated) {
  const auto orders = fourier(repeated);
  for (std::size_t k = 1; 2 * k < bins_; ++k)
    of_order_[k] += 2.0 * std::norm(orders[k]) / std::pow(static_cast<double>(bins_), 2);
  alternating_ = unequal_ = 0.0;
  for (std::size_t k = 1; half_ > 0 && 2 * k < bins_; ++k) {
    if (k % half_ != 0) unequal_ += of_order_[k];
    if (k % (2 * half_) == half_) alternating_ += of_order_[k];
  }
}

}  // namespace smartmill
