#include "smartmill_hammer/analysis/tap_records.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <fstream>
#include <sstream>

#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace hammer {
namespace {

/// Steps of the first column: a record is sampled faster than this, lines of an FRF are wider apart.
constexpr double LARGEST_TIME_STEP = 2e-3;  // [s]
/// Force that counts as the beginning of the hit, of the peak.
constexpr double ONSET_SHARE = 0.02;
/// Half width of the smoothing before peaks are sought, of the frequency.
constexpr double PEAK_SMOOTHING = 0.0015;
/// Share of a peak's height down to which its mode is fitted.
constexpr double HALF_POWER = 0.7071;
/// A rise above the lowest line so far by this factor is the next peak's flank.
constexpr double VALLEY_RISE = 1.02;

struct ThreeColumns {
  std::vector<double> a, b, c;
};

ThreeColumns readThreeColumns(const std::string& file) {
  std::ifstream stream(file);
  if (!stream) throw Error(file + ": cannot be read");
  ThreeColumns columns;
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos) continue;
    std::istringstream cells(line);
    double a = 0.0, b = 0.0, c = 0.0;
    std::string more;
    if (!(cells >> a >> b >> c) || (cells >> more)) {
      throw Error(file + ": line " + std::to_string(number) + ": three numbers are due");
    }
    if (!std::isfinite(a) || !std::isfinite(b) || !std::isfinite(c)) {
      throw Error(file + ": line " + std::to_string(number) + ": not a finite number");
    }
    columns.a.push_back(a);
    columns.b.push_back(b);
    columns.c.push_back(c);
  }
  if (columns.a.size() < 4) throw Error(file + ": holds fewer than four lines of three numbers");
  return columns;
}

// Times are printed with a few digits; rates are whole numbers of Hz.
double sampleRate(const std::vector<double>& time, const std::string& file) {
  const double rate = static_cast<double>(time.size() - 1) / (time.back() - time.front());
  if (!(rate > 0.0) || !std::isfinite(rate)) throw Error(file + ": the time column does not rise");
  const double whole = std::round(rate);
  return std::abs(rate - whole) < 1e-5 * rate ? whole : rate;
}

void evenTime(const std::vector<double>& time, const std::string& file) {
  const double step = (time.back() - time.front()) / static_cast<double>(time.size() - 1);
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (!(std::abs(time[i] - time.front() - static_cast<double>(i) * step) <= 0.25 * step)) {
      throw Error(file + ": line " + std::to_string(i + 1) + ": time is not evenly spaced");
    }
  }
}

std::size_t onset(const std::vector<double>& force) {
  const double level = ONSET_SHARE * *std::max_element(force.begin(), force.end());
  const auto peak = std::max_element(force.begin(), force.end()) - force.begin();
  auto i = peak;
  while (i > 0 && force[static_cast<std::size_t>(i)] > level) --i;
  return static_cast<std::size_t>(i);
}

}  // namespace

TapFormat detectFormat(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw Error(file + ": cannot be read");
  std::string first;
  char head[13] = {};
  stream.read(head, 12);
  if (std::string(head, 8) == "#ROSBAG ") return TapFormat::bag;
  stream.clear();
  stream.seekg(0);
  std::getline(stream, first);
  if (first.find('[') != std::string::npos && first.find("time") != std::string::npos) return TapFormat::csv;
  std::string second;
  std::getline(stream, second);
  double a0 = 0.0, a1 = 0.0, b = 0.0, c = 0.0;
  std::istringstream one(first), two(second);
  if ((one >> a0 >> b >> c) && (two >> a1 >> b >> c) && a1 > a0) {
    return a1 - a0 < LARGEST_TIME_STEP ? TapFormat::text : TapFormat::frf;
  }
  throw Error(
      file + ": neither a bag, nor CSV with time[s],hammer[N],acceleration[m/s2] (or displacement[m]), nor " +
      "three columns of numbers");
}

TapRecord readTapCsv(const std::string& file) {
  const Record record = readCsv(file);
  TapRecord tap;
  tap.file = file;
  tap.hit.force = record.column("hammer");
  tap.acceleration = !record.has("displacement");
  if (tap.acceleration && !record.has("acceleration")) {
    throw Error(file + ": column acceleration or displacement is missing");
  }
  tap.hit.response = record.column(tap.acceleration ? "acceleration" : "displacement");
  tap.hit.sample_rate = sampleRate(record.time, file);
  tap.hit.pre_trigger = onset(tap.hit.force);
  return tap;
}

TapRecord readTapText(const std::string& file) {
  const ThreeColumns columns = readThreeColumns(file);
  evenTime(columns.a, file);
  TapRecord tap;
  tap.file = file;
  tap.hit.force = columns.b;
  tap.hit.response = columns.c;
  tap.acceleration = true;
  tap.hit.sample_rate = sampleRate(columns.a, file);
  tap.hit.pre_trigger = onset(tap.hit.force);
  return tap;
}

FrequencyResponse readFrfText(const std::string& file) {
  const ThreeColumns columns = readThreeColumns(file);
  FrequencyResponse frf;
  frf.unit = "m/N";
  for (std::size_t i = 0; i < columns.a.size(); ++i) {
    if (i > 0 && !(columns.a[i] > columns.a[i - 1])) {
      throw Error(file + ": line " + std::to_string(i + 1) + ": frequencies do not rise");
    }
    if (columns.a[i] <= 0.0) continue;  // no receptance at rest from an accelerometer
    frf.frequency.push_back(columns.a[i]);
    frf.value.emplace_back(columns.b[i], columns.c[i]);
  }
  return frf;
}

TapFrf averageTaps(const std::vector<TapRecord>& taps, const HitLimits& limits, double exponential_time) {
  TapFrf result;
  ImpactOptions options;
  options.exponential_time = exponential_time;
  const bool acceleration = !taps.empty() && taps.front().acceleration;
  if (acceleration) options.unit = "m/s2/N";
  ImpactAnalysis analysis(options);
  for (const TapRecord& tap : taps) {
    if (tap.acceleration != acceleration) {
      throw Error(tap.file + ": " + (acceleration ? "displacement" : "acceleration") + ", but " +
                  taps.front().file + " holds " + (acceleration ? "acceleration" : "displacement"));
    }
    const HitFault fault = hitFault(tap.hit, limits);
    if (!fault.text.empty()) {
      result.notes.push_back(tap.file + ": left out: " + fault.text);
      continue;
    }
    try {
      analysis.add(tap.hit);
    } catch (const Error& error) {
      throw Error(tap.file + ": " + error.what());
    }
  }
  if (analysis.hits() == 0) {
    throw Error(result.notes.empty() ? std::string("no hit was given")
                                     : "no hit is left; " + result.notes.back());
  }
  result.measured = analysis.frf();
  const auto lines = result.measured.band(1e-9, INFINITY);
  result.measured = lines;
  result.receptance = acceleration ? receptanceFromAccelerance(lines) : lines;
  return result;
}

std::vector<ModeReading> peakModes(const FrequencyResponse& receptance, double low, double high, double share,
                                   std::size_t most) {
  const FrequencyResponse band = receptance.band(low, high);
  const std::size_t n = band.size();
  if (n < 8) throw Error("peaks: fewer than eight lines in the band");
  const double step = (band.frequency.back() - band.frequency.front()) / static_cast<double>(n - 1);
  // Averaged over some lines, so that a noisy line of a single hit is no peak; 0.15 % is less than a mode is
  // wide.
  FrequencyResponse smooth;
  smooth.frequency = band.frequency;
  for (std::size_t i = 0; i < n; ++i) {
    const auto half = static_cast<std::size_t>(PEAK_SMOOTHING * band.frequency[i] / step);
    const std::size_t first = i > half ? i - half : 0, last = std::min(n - 1, i + half);
    double sum = 0.0;
    for (std::size_t j = first; j <= last; ++j) sum += band.value[j].imag();
    smooth.value.emplace_back(sum / static_cast<double>(last - first + 1));
  }
  std::vector<double> peaks = findPeaks(smooth, low, high, share);  // strongest first
  if (peaks.size() > most) peaks.resize(most);
  std::sort(peaks.begin(), peaks.end());
  std::vector<ModeReading> rows;
  for (const double peak : peaks) {
    const auto at = static_cast<std::size_t>(
        std::lower_bound(band.frequency.begin(), band.frequency.end(), peak) - band.frequency.begin());
    const double height = std::abs(smooth.value[at].real());
    std::size_t first = at, last = at;
    // Down to the half-power height, but not over a valley into the next peak.
    const auto magnitude = [&](std::size_t i) { return std::abs(smooth.value[i].real()); };
    for (double valley = height; first > 0 && magnitude(first - 1) >= HALF_POWER * height &&
                                 magnitude(first - 1) <= VALLEY_RISE * valley;) {
      valley = std::min(valley, magnitude(--first));
    }
    for (double valley = height; last + 1 < n && magnitude(last + 1) >= HALF_POWER * height &&
                                 magnitude(last + 1) <= VALLEY_RISE * valley;) {
      valley = std::min(valley, magnitude(++last));
    }
    // A lightly damped mode is a few lines wide.
    while (last - first < 6 && (first > 0 || last + 1 < n)) {
      if (first > 0) --first;
      if (last + 1 < n) ++last;
    }
    ModalFitOptions options;
    options.low = band.frequency[first] - 0.1 * step;
    options.high = band.frequency[last] + 0.1 * step;
    options.modes = 1;
    try {
      const Mode mode = fitModes(band, options).model.modes.at(0);
      // A fit that leaves its peak tells of another mode.
      if (mode.frequency < options.low || mode.frequency > options.high) continue;
      rows.push_back({mode, receptance.at(mode.frequency)});
    } catch (const Error&) {
      continue;  // no mode's shape
    }
  }
  return rows;
}

bool looksDirect(const FrequencyResponse& receptance, double low, double high) {
  double wrong = 0.0, all = 0.0;
  for (const std::complex<double>& h : receptance.band(low, high).value) {
    all += h.imag() * h.imag();
    if (h.imag() > 0.0) wrong += h.imag() * h.imag();
  }
  return wrong < 0.02 * all;
}

std::vector<ModeReading> readModes(const ModalModel& model, const FrequencyResponse& receptance) {
  std::vector<ModeReading> rows;
  for (const Mode& mode : model.modes) rows.push_back({mode, receptance.at(mode.frequency)});
  return rows;
}

void writeFrfCsv(const FrequencyResponse& frf, const ModalModel& fit, const std::string& file) {
  std::ofstream out(file);
  const std::string& u = frf.unit;
  out << "frequency[Hz],real[" << u << "],imag[" << u << "],coherence[1],std_dev[" << u << "],fit_real[" << u
      << "],fit_imag[" << u << "]\n";
  out.precision(10);
  for (std::size_t k = 0; k < frf.size(); ++k) {
    const std::complex<double> f = fit.response(frf.frequency[k]);
    out << frf.frequency[k] << ',' << frf.value[k].real() << ',' << frf.value[k].imag() << ','
        << (frf.coherence.empty() ? NOT_A_NUMBER : frf.coherence[k]) << ','
        << (frf.std_dev.empty() ? NOT_A_NUMBER : frf.std_dev[k]) << ',' << f.real() << ',' << f.imag()
        << '\n';
  }
  if (!out.flush()) throw Error(file + ": cannot be written");
}

void writeModesCsv(const ModalModel& model, const std::string& file) {
  std::ofstream out(file);
  out << "frequency[Hz],frequency_std[Hz],damping_ratio[1],damping_ratio_std[1],stiffness[N/"
         "um],stiffness_std[N/um]\n";
  out.precision(10);
  for (const Mode& m : model.modes) {
    const double stiffness = 1.0 / m.gain / units::N_PER_UM;
    out << m.frequency << ',' << m.frequency_std << ',' << m.damping_ratio << ',' << m.damping_ratio_std
        << ',' << stiffness << ',' << std::abs(stiffness * m.gain_std / m.gain) << '\n';
  }
  if (!out.flush()) throw Error(file + ": cannot be written");
}

void plotFrf(const std::string& csv_file, const std::string& png_file, const std::string& title, double low,
             double high, bool coherence) {
  const int panels = coherence ? 3 : 2;
  const std::string csv = Gnuplot::quoted(csv_file);
  Gnuplot plot(png_file, 1100, 330 * panels);
  plot << "set datafile separator ','\nset datafile missing 'nan'\nset key autotitle columnhead\n"
       << "set multiplot layout " << panels << ",1 title " << Gnuplot::quoted(title) << "\nset xrange ["
       << low << ":" << high << "]\nset grid\nset lmargin 11\n";
  const auto part = [&](const char* name, int measured, int fitted) {
    plot << "set ylabel 'receptance " << name << " [um/N]'\nplot " << csv << " using 1:($" << measured
         << "*1e6) with lines lw 2 title 'measured', '' using 1:($" << fitted
         << "*1e6) with lines lw 1.5 title 'fitted modes'\n";
  };
  part("Re", 2, 6);
  if (!coherence) plot << "set xlabel 'frequency [Hz]'\n";
  part("Im", 3, 7);
  if (coherence) {
    plot << "set xlabel 'frequency [Hz]'\nset ylabel 'coherence [1]'\nset yrange [0:1.05]\nset key bottom "
            "right\n"
         << "plot " << csv << " using 1:4 with lines lw 1.5 title 'coherence'\n";
  }
  plot << "unset multiplot\n";
  plot.draw();
}

}  // namespace hammer
}  // namespace smartmill
