#include "kalman/tuning.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/filter/harmonic_filter.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;

/// Candidate memories [revolutions].
constexpr double MEMORIES[] = {0.2, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0};
/// Revolutions after which the innovations of a record are used.
constexpr double SETTLED = 20.0;
/// Shortest memory of a harmonic [revolutions].
constexpr double QUICKEST = 0.2;

/// Lines 1 Hz apart.
std::vector<Complex> spectrum(std::vector<double> samples, double sample_rate) {
  samples.resize(std::max(samples.size(), static_cast<std::size_t>(std::lround(sample_rate))), 0.0);
  return fourier(samples);
}

std::size_t bandOf(double f, const std::vector<double>& edges) {
  return static_cast<std::size_t>(std::upper_bound(edges.begin(), edges.end(), f) - edges.begin());
}

}  // namespace

int TuningMap::best(double wanted) const {
  const auto column = static_cast<std::size_t>(
      std::min_element(speed.begin(), speed.end(),
                       [&](double a, double b) { return std::abs(a - wanted) < std::abs(b - wanted); }) -
      speed.begin());
  std::size_t least = 0;
  for (std::size_t i = 1; i < rmse.size(); ++i) {
    if (rmse[i][column] < rmse[least][column]) least = i;
  }
  return LEAST_EXPONENT + static_cast<int>(least);
}

std::vector<double> randomWalkForce(const std::vector<double>& measured, const ModalModel& sensor,
                                    double sample_rate, double q, double r) {
  // The design has q = r dt / tau^2.
  constexpr double SPEED = units::TWO_PI;  // arbitrary: one revolution per second
  HarmonicFilterParameters parameters;
  parameters.max_harmonics = 0;
  parameters.noise_rms = std::sqrt(r);
  parameters.settling_revolutions = parameters.memory_revolutions = std::sqrt(r / sample_rate / q);
  HarmonicFilter filter(sensor, SPEED, sample_rate, parameters);
  std::vector<double> force;
  force.reserve(measured.size());
  for (const double sample : measured) force.push_back(filter.step(sample));
  return force;
}

TuningMap tapMap(const ReferenceTaps& taps, const ModalModel& sensor, double sample_rate, double r,
                 const std::vector<double>& speeds, double band) {
  TuningMap map;
  map.speed = speeds;
  std::vector<std::vector<Complex>> truth;
  for (const auto& hammer : taps.hammer) truth.push_back(spectrum(hammer, sample_rate));
  const auto top = static_cast<std::size_t>(band) + 2;
  for (int exponent = LEAST_EXPONENT; exponent <= MOST_EXPONENT; ++exponent) {
    std::vector<double> squares(top, 0.0);
    for (std::size_t tap = 0; tap < taps.hammer.size(); ++tap) {
      const auto found = spectrum(
          randomWalkForce(taps.response[tap], sensor, sample_rate, std::pow(2.0, exponent), r), sample_rate);
      for (std::size_t k = 0; k < top; ++k) {
        const double off = (std::abs(found[k]) - std::abs(truth[tap][k])) / sample_rate;
        squares[k] += off * off / static_cast<double>(taps.hammer.size());
      }
    }
    map.rmse.emplace_back();
    for (const double speed : speeds) {
      double sum = 0.0;
      std::size_t count = 0;
      for (double f = speed / units::TWO_PI; f <= band; f += speed / units::TWO_PI) {
        const auto line = static_cast<std::size_t>(std::lround(f));
        for (std::size_t k = line - 1; k <= line + 1 && k < top; ++k, ++count) sum += squares[k];
      }
      map.rmse.back().push_back(std::sqrt(sum / static_cast<double>(std::max<std::size_t>(count, 1))));
    }
  }
  return map;
}

ReferenceTaps plantAt(const ReferenceTaps& taps, const FrequencyResponse& measured, double sample_rate,
                      double k) {
  ReferenceTaps plant = taps;
  for (auto& response : plant.response) {
    auto lines = fourier(response);
    const std::vector<double> frequency = fourierFrequencies(response.size(), sample_rate);
    for (std::size_t i = 1; i < lines.size() && i < measured.size(); ++i) {
      if (measured.frequency[i] != frequency[i])
        throw Error("confidence interval: the FRFs have different frequency lines");
      const double s = measured.std_dev.at(i) / std::abs(measured.value[i]);
      if (std::isfinite(s)) lines[i] *= std::polar(1.0 + k * std::min(s, 0.3), k * std::min(s, 0.3));
    }
    response = inverseFourier(lines, response.size());
  }
  return plant;
}

double noiseBefore(const ReferenceTaps& taps, double sample_rate, double before) {
  const auto count = static_cast<std::size_t>(before * sample_rate);
  double sum = 0.0;
  for (const auto& response : taps.response) {
    for (std::size_t i = 0; i < count; ++i) sum += response.at(i) * response[i];
  }
  if (!(sum > 0.0)) throw Error("tuning: no signal before the hits, R is undefined");
  return sum / static_cast<double>(count * taps.response.size());
}

CutScore scoreCut(const std::vector<double>& force, const std::vector<double>& truth, double sample_rate,
                  double spindle_speed, int flutes, std::size_t from, double band, double amplitude_band) {
  CutScore score;
  const double revolution = units::TWO_PI / spindle_speed * sample_rate;
  const double whole = std::floor(static_cast<double>(truth.size() - from) / revolution);
  from = truth.size() - static_cast<std::size_t>(std::lround(whole * revolution));
  double squares = 0.0, largest = 0.0;
  int count = 0;
  for (int n = 1; n * spindle_speed <= units::TWO_PI * band; ++n, ++count) {
    Complex is = 0.0, found = 0.0;
    for (std::size_t i = from; i < truth.size(); ++i) {
      const Complex turn = std::polar(2.0 / static_cast<double>(truth.size() - from),
                                      -n * spindle_speed * static_cast<double>(i) / sample_rate);
      is += turn * truth[i];
      found += turn * force[i];
    }
    squares += std::pow(std::abs(found) - std::abs(is), 2);
    if (n % flutes != 0 || n * spindle_speed > units::TWO_PI * amplitude_band) continue;
    largest = std::max(largest, std::abs(is));
    // Harmonics below a fiftieth of the largest are not scored.
    if (std::abs(is) > 0.02 * largest)
      score.amplitude = std::max(score.amplitude, std::abs(std::abs(found) / std::abs(is) - 1.0));
  }
  score.rmse = std::sqrt(squares / std::max(count, 1));
  return score;
}

std::vector<double> bandForce(const std::vector<double>& measured, const ModalModel& sensor,
                              double spindle_speed, double sample_rate, double noise_rms,
                              const std::vector<double>& edges, const std::vector<double>& memory,
                              int max_harmonics, double* log_likelihood) {
  const double revolution = units::TWO_PI / spindle_speed;
  const int harmonics = harmonicCount(std::min(5000.0, 0.45 * sample_rate), revolution, max_harmonics);
  std::vector<double> settling;
  for (int n = 0; n <= harmonics; ++n) {
    const double f = n / revolution;
    settling.push_back(harmonicSettling(sensor, f, memory.at(bandOf(f, edges)), QUICKEST) * revolution);
  }
  const HarmonicGain gain = designHarmonicGain({sensor, spindle_speed, sample_rate, noise_rms, settling});
  HarmonicFilter filter({gain}, sensor, spindle_speed, sample_rate);
  std::vector<double> force;
  force.reserve(measured.size());
  const std::size_t from =
      std::min(static_cast<std::size_t>(SETTLED * revolution * sample_rate), measured.size() / 2);
  double sum = 0.0;
  for (std::size_t i = 0; i < measured.size(); ++i) {
    force.push_back(filter.step(measured[i]));
    if (i >= from) sum -= 0.5 * (std::log(gain.variance) + std::pow(filter.innovation(), 2) / gain.variance);
  }
  if (log_likelihood) *log_likelihood = sum;
  return force;
}

BandTuning tuneBands(const std::vector<double>& measured, const ModalModel& sensor, double spindle_speed,
                     double sample_rate, double noise_rms, const std::vector<double>& edges,
                     const FrequencyResponse& frf, int max_harmonics) {
  // The effect of the FRF's uncertainty on the measured harmonics is noise for the filter.
  double variance = noise_rms * noise_rms;
  const std::size_t half = measured.size() / 2;
  for (int n = 1; n * spindle_speed / units::TWO_PI < std::min(5000.0, frf.frequency.back()); ++n) {
    const double f = n * spindle_speed / units::TWO_PI;
    Complex harmonic = 0.0;
    for (std::size_t i = half; i < measured.size(); ++i)
      harmonic += measured[i] * std::polar(2.0 / static_cast<double>(measured.size() - half),
                                           -units::TWO_PI * f * static_cast<double>(i) / sample_rate);
    const auto line = static_cast<std::size_t>(
        std::lower_bound(frf.frequency.begin(), frf.frequency.end(), f) - frf.frequency.begin());
    const double relative = frf.std_dev.at(std::min(line, frf.size() - 1)) / std::abs(frf.at(f));
    if (std::isfinite(relative)) variance += 0.5 * std::norm(harmonic) * std::pow(std::min(relative, 1.0), 2);
  }
  BandTuning best;
  best.memory.assign(edges.size() + 1, 2.0);
  const auto likelihood = [&](const std::vector<double>& memory) {
    double value = 0.0;
    bandForce(measured, sensor, spindle_speed, sample_rate, std::sqrt(variance), edges, memory, max_harmonics,
              &value);
    return value;
  };
  best.log_likelihood = likelihood(best.memory);
  for (std::size_t band = 0; band < best.memory.size(); ++band) {
    for (const double memory : MEMORIES) {
      std::vector<double> tried = best.memory;
      tried[band] = memory;
      if (tried == best.memory) continue;
      const double value = likelihood(tried);
      if (value > best.log_likelihood) best = {tried, value};
    }
  }
  return best;
}

void drawMaps(const std::vector<NamedMap>& maps, const std::string& png) {
  const std::size_t lines = (maps.size() + 1) / 2;
  Gnuplot script(png, 1100, 400 * static_cast<int>(lines));
  for (std::size_t m = 0; m < maps.size(); ++m) {
    const TuningMap& map = maps[m].map;
    std::vector<std::vector<double>> rows, best, cuts;
    for (std::size_t k = 0; k < map.speed.size(); ++k) {
      for (std::size_t i = 0; i < map.rmse.size(); ++i)
        rows.push_back(
            {units::rpmFromRadPerSec(map.speed[k]), LEAST_EXPONENT + static_cast<double>(i), map.rmse[i][k]});
      best.push_back({units::rpmFromRadPerSec(map.speed[k]), static_cast<double>(map.best(map.speed[k]))});
    }
    for (const auto& [speed, exponent] : maps[m].cuts)
      cuts.push_back({units::rpmFromRadPerSec(speed), static_cast<double>(exponent)});
    script.block(formatted("map%zu", m), rows);
    script.block(formatted("best%zu", m), best);
    script.block(formatted("cuts%zu", m), cuts);
  }
  script
      << "set multiplot layout " << lines
      << ",2\nset logscale cb\nset xlabel 'spindle speed [rpm]'\nset ylabel 'n of q = 2^n N2/s'\nset cblabel "
         "'RMSE [N s]'\nset key outside above horizontal samplen 2 opaque\nset xtics 4000\n";
  for (std::size_t m = 0; m < maps.size(); ++m)
    script << "set title " << Gnuplot::quoted(maps[m].name) << "\nplot ["
           << units::rpmFromRadPerSec(maps[m].map.speed.front()) << ":"
           << units::rpmFromRadPerSec(maps[m].map.speed.back()) << "] [" << LEAST_EXPONENT << ":"
           << MOST_EXPONENT << "] $map" << m << " using 1:2:3 with image notitle, $best" << m
           << " using 1:2 with lines lw 3 lc rgb '#20c0e0' title 'best of the taps', $cuts" << m
           << " using 1:2 with points pt 7 lc 'red' title 'best of the cut'\n";
  script << "unset multiplot\n";
  script.draw();
}

}  // namespace smartmill::kalman
