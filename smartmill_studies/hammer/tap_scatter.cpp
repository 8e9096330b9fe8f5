#include "hammer/tap_scatter.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "hammer/station_draw.h"
#include "hammer/station_machine.h"
#include "smartmill_core/error.h"
#include "smartmill_core/signal/statistics.h"
#include "study_case.h"

namespace smartmill::hammer {
namespace {

using nlohmann::json;

constexpr double FACTOR = 1.5;       // [1] between the two deviations
constexpr double SAME_MODE = 0.005;  // [1] of the frequency

using Runs = std::vector<MeasureFrfResult>;

/// Indices of the scored lines.
std::vector<std::size_t> bandOf(const FrequencyResponse& frf) {
  std::vector<std::size_t> lines;
  for (std::size_t i = 0; i < frf.size(); ++i) {
    if (frf.frequency[i] > BAND_LOW && frf.frequency[i] < BAND_HIGH) lines.push_back(i);
  }
  return lines;
}

std::vector<std::complex<double>> meanOf(const Runs& runs) {
  std::vector<std::complex<double>> mean(runs.front().measured_frf.size());
  for (const MeasureFrfResult& run : runs) {
    for (std::size_t i = 0; i < mean.size(); ++i)
      mean[i] += run.measured_frf.value[i] / static_cast<double>(runs.size());
  }
  return mean;
}

/// Each run divided by its least-squares scale to the mean of all.
void takeScalesOff(Runs* runs, const std::vector<std::size_t>& lines) {
  const std::vector<std::complex<double>> mean = meanOf(*runs);
  for (MeasureFrfResult& run : *runs) {
    double both = 0.0, own = 0.0;
    for (const std::size_t i : lines) {
      const double weight = 1.0 / std::pow(run.measured_frf.std_dev[i], 2);
      both += weight * (std::conj(mean[i]) * run.measured_frf.value[i]).real();
      own += weight * std::norm(mean[i]);
    }
    for (std::complex<double>& value : run.measured_frf.value) value *= own / both;
  }
}

/// [1] for every line: standard deviation of the runs over the stated one.
std::vector<double> lineRatios(const Runs& runs, const std::vector<std::size_t>& lines) {
  const std::vector<std::complex<double>> mean = meanOf(runs);
  const auto count = static_cast<double>(runs.size());
  std::vector<double> ratios;
  for (const std::size_t i : lines) {
    double observed = 0.0, stated = 0.0;
    for (const MeasureFrfResult& run : runs) {
      observed += std::norm(run.measured_frf.value[i] - mean[i]) / (count - 1.0);
      stated += std::pow(run.measured_frf.std_dev[i], 2) / count;
    }
    ratios.push_back(std::sqrt(observed / stated));
  }
  return ratios;
}

/// [1] standard deviation of the values over the root of their mean stated variance.
double ratioOf(const std::vector<double>& values, const std::vector<double>& stated) {
  return standardDeviation(values) / rms(stated);
}

json modeRatios(const Runs& runs) {
  json modes = json::array();
  for (const Mode& first : runs.front().measured.modes) {
    if (first.frequency < BAND_LOW || first.frequency > BAND_HIGH) continue;
    std::vector<double> f, f_std, zeta, zeta_std;
    for (const MeasureFrfResult& run : runs) {
      for (const Mode& m : run.measured.modes) {
        if (std::abs(m.frequency / first.frequency - 1.0) > SAME_MODE) continue;
        f.push_back(m.frequency);
        f_std.push_back(m.frequency_std);
        zeta.push_back(m.damping_ratio);
        zeta_std.push_back(m.damping_ratio_std);
      }
    }
    if (f.size() != runs.size()) continue;
    modes.push_back(
        {{"f", first.frequency}, {"f_ratio", ratioOf(f, f_std)}, {"zeta_ratio", ratioOf(zeta, zeta_std)}});
  }
  return modes;
}

}  // namespace

json tapScatter(const StationStudy& study, int number, int repeats) {
  const DrawnStation drawn = drawStation(study.seed, number);
  const StationTask task = taskOf(drawn, study.hits);
  Runs runs;
  for (int k = 0; k < repeats; ++k) {
    StationMachine machine(drawn, seedOfCase(study.seed + static_cast<std::uint64_t>(number), k));
    double seconds = 0.0;
    const MeasureFrfResult result = measure(machine, task.parameters, drawn.believed, task.goal, seconds);
    if (result.code == FrfCode::ok) runs.push_back(result);
  }
  json line{{"machine", number}, {"out_of_range", drawn.out_of_range}, {"runs", runs.size()}};
  if (drawn.out_of_range) return line;
  if (runs.size() < 3)
    throw Error("machine " + std::to_string(number) + ": fewer than three runs have a result");
  const std::vector<std::size_t> lines = bandOf(runs.front().measured_frf);
  takeScalesOff(&runs, lines);
  double sum = 0.0, within = 0.0;
  const std::vector<double> ratios = lineRatios(runs, lines);
  for (const double r : ratios) {
    sum += r * r / static_cast<double>(ratios.size());
    within += (r < FACTOR && r > 1.0 / FACTOR ? 1.0 : 0.0) / static_cast<double>(ratios.size());
  }
  line["scatter"] = std::sqrt(sum);
  line["within"] = within;
  line["modes"] = modeRatios(runs);
  return line;
}

}  // namespace smartmill::hammer
