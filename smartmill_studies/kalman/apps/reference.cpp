// rosrun smartmill_studies kalman_reference: errors of the compensation in the reference cut, next to their
// targets.

#include <cmath>
#include <cstdio>
#include <ctime>
#include <functional>
#include <string>
#include <vector>

#include "kalman/tuning.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/campaign_compensation.h"
#include "smartmill_kalman/compensation/record_compensation.h"
#include "smartmill_kalman/filter/delay_filter.h"
#include "smartmill_kalman_testing/reference_case.h"

namespace {

using namespace smartmill;          // NOLINT
using namespace smartmill::kalman;  // NOLINT

struct Errors {
  double to_3k = 0.0, to_5k = 0.0, entry_3k = 0.0, entry_5k = 0.0;  // [1]
};

using Estimator = std::function<std::vector<double>(const std::vector<double>&)>;

Errors errorsOf(const ReferenceCase& reference, const ReferenceRecord& record, const Estimator& estimator) {
  Errors worst;
  const double rate = reference.sample_rate, revolution = units::TWO_PI / reference.spindle_speed;
  const auto sample = [rate](double time) { return static_cast<std::size_t>(std::lround(time * rate)); };
  const std::size_t from = sample(reference.engage_time + 0.1), to = record.time.size();
  const std::size_t third = sample(reference.engage_time + 2.0 * revolution);
  const std::size_t eighth = sample(reference.engage_time + 8.0 * revolution);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const std::vector<double> force = estimator(record.measured[axis]);
    const auto error = [&](double band, std::size_t a, std::size_t b) {
      return bandError(force, record.truth[axis], rate, a, b, band);
    };
    worst.to_3k = std::max(worst.to_3k, error(3000.0, from, to));
    worst.to_5k = std::max(worst.to_5k, error(5000.0, from, to));
    worst.entry_3k = std::max(worst.entry_3k, error(3000.0, third, eighth));
    worst.entry_5k = std::max(worst.entry_5k, error(5000.0, third, eighth));
  }
  return worst;
}

template <class Filter>
std::vector<double> causal(Filter& filter, const std::vector<double>& measured) {
  filter.reset();
  std::vector<double> force;
  force.reserve(measured.size());
  for (const double sample : measured) force.push_back(filter.step(sample));
  return force;
}

ReferenceCase caseAt(double rpm, double duration) {
  ReferenceCase reference;
  reference.spindle_speed = units::radPerSecFromRpm(rpm);
  reference.duration = duration;
  return reference;
}

/// Worst error of x and y from a sample on.
double worstError(const std::array<std::vector<double>, 2>& force, const ReferenceCase& reference,
                  const ReferenceRecord& record, std::size_t from, std::size_t to, double band) {
  double worst = 0.0;
  for (std::size_t axis = 0; axis < 2; ++axis)
    worst =
        std::max(worst, bandError(force[axis], record.truth[axis], reference.sample_rate, from, to, band));
  return 100.0 * worst;
}

void row(double rpm, const char* name, const Errors& e, const char* target) {
  std::printf("%6.0f  %-30s %8.2f %8.2f %10.2f %8.2f   %s\n", rpm, name, 100.0 * e.to_3k, 100.0 * e.to_5k,
              100.0 * e.entry_3k, 100.0 * e.entry_5k, target);
}

/// The plain augmented Kalman filter with a random-walk force; its intensity is the best of a grid, chosen by
/// the truth.
Errors randomWalk(const ReferenceCase& reference, const ReferenceRecord& record, bool smooth) {
  Errors best;
  best.to_5k = 1e9;
  HarmonicFilterParameters parameters;
  parameters.max_harmonics = 0;
  for (double tau = 1e-6; tau < 1e-3; tau *= 2.0) {  // [s]
    parameters.settling_revolutions = parameters.memory_revolutions =
        tau * reference.spindle_speed / units::TWO_PI;
    HarmonicFilter filter(reference.sensor, reference.spindle_speed, reference.sample_rate, parameters);
    const Errors errors = errorsOf(reference, record, [&](const std::vector<double>& measured) {
      if (!smooth) return causal(filter, measured);
      filter.reset();
      return filter.smooth(measured);
    });
    if (errors.to_5k < best.to_5k) best = errors;
  }
  return best;
}

void run(const std::vector<double>& speeds, double duration) {
  std::printf("reference cut: error of the force [%%], worst of x and y; targets to 3 / 5 kHz\n");
  std::printf("   rpm  method                          to 3 kHz to 5 kHz   rev 3-8 (3k)   (5k)   target\n");
  for (const double rpm : speeds) {
    ReferenceCase reference = caseAt(rpm, duration);
    std::fprintf(stderr, "%.0f rpm\n", rpm);
    const ReferenceRecord record = simulate(reference);
    const HarmonicFilterParameters parameters;
    const auto with = [&](Method method, const ModalModel& sensor) {
      return errorsOf(reference, record, [&](const std::vector<double>& measured) {
        return compensateRecord(method, measured, sensor, reference.spindle_speed, reference.sample_rate,
                                parameters);
      });
    };
    row(rpm, "measured", errorsOf(reference, record, [](const std::vector<double>& m) { return m; }), "");
    row(rpm, "kalman", with(Method::kalman, reference.sensor), "0.6 / 1.2, rev 3-8: 1");
    row(rpm, "smoother", with(Method::smoother, reference.sensor), "0.5 / 1.0");
    row(rpm, "inverse", with(Method::inverse, reference.sensor), "1.2 / 2.2");
    const ReferenceTaps taps = simulateTaps(reference, 9);
    const ModalFit fit =
        identifySensor(taps.hammer, taps.response, reference.sample_rate, {100.0, 5000.0, 4});
    row(rpm, "kalman, nine taps", with(Method::kalman, fit.model), "1.5");
    row(rpm, "random walk, best q, causal", randomWalk(reference, record, false), "baseline");
    row(rpm, "random walk, best q, smoothed", randomWalk(reference, record, true), "baseline");
  }
}

std::size_t statesOf(const HarmonicFilter& filter) {
  return filter.pairs().states();
}
std::size_t statesOf(const DelayFilter& filter) {
  return filter.states();
}

/// Comparison of Fourier series and F(t) = F(t - T): error, states, time per sample and of the design.
void runForceModels(const std::vector<double>& speeds, double duration) {
  const auto seconds = [](std::clock_t since) {
    return static_cast<double>(std::clock() - since) / CLOCKS_PER_SEC;
  };
  std::printf("force models: error of the force [%%], worst of x and y, causal\n");
  std::printf(
      "   rpm  T [samples]  force model         to 3 kHz to 5 kHz   rev 3-8 (3k)   (5k)  states  ns a sample"
      "  layout [s]\n");
  for (const double rpm : speeds) {
    ReferenceCase reference = caseAt(rpm, duration);
    const ReferenceRecord record = simulate(reference);
    const auto show = [&](const char* name, auto make) {
      const std::clock_t began = std::clock();
      auto filter = make();
      const double layout = seconds(began);
      double cost = 0.0;
      const Errors e = errorsOf(reference, record, [&](const std::vector<double>& measured) {
        const std::clock_t start = std::clock();
        const std::vector<double> force = causal(filter, measured);
        cost = 1e9 * seconds(start) / static_cast<double>(measured.size());
        return force;
      });
      std::printf("%6.0f  %11.3f  %-18s %9.2f %8.2f %10.2f %10.2f %7zu %10.0f %12.3f\n", rpm,
                  60.0 / rpm * reference.sample_rate, name, 100.0 * e.to_3k, 100.0 * e.to_5k,
                  100.0 * e.entry_3k, 100.0 * e.entry_5k, statesOf(filter), cost, layout);
    };
    const HarmonicFilterParameters parameters;
    show("Fourier series", [&] {
      return HarmonicFilter(reference.sensor, reference.spindle_speed, reference.sample_rate, parameters);
    });
    show("F(t) = F(t - T)", [&] {
      return DelayFilter(reference.sensor, reference.spindle_speed, reference.sample_rate, parameters);
    });
  }
}

/// Without a tachometer: the speed as a state, compared with a tachometer and with the commanded speed.
/// Errors to 3 kHz over the last 0.3 s; speed error at the end.
void runSpeeds(const std::vector<double>& speeds, double duration) {
  std::printf("no tachometer: error of the force to 3 / 5 kHz [%%] over the last 0.3 s, worst of x and y\n");
  std::printf(
      "   rpm  commanded speed is off   speed falls    tachometer       speed a state   commanded taken for "
      "true\n");
  for (const double rpm : speeds) {
    for (const auto& [off, drop] : {std::pair(0.0, 0.0), std::pair(0.01, 0.0), std::pair(-0.01, 0.0),
                                    std::pair(0.0, 0.01), std::pair(0.01, 0.01)}) {
      ReferenceCase reference = caseAt(rpm, duration);
      reference.nominal_off = off;
      reference.speed_drop = drop;
      const ReferenceRecord record = simulate(reference);
      const auto error = [&](const ReferenceCase& told, bool track) {
        CompensationParameters parameters;
        parameters.track_speed = track;
        parameters.filter.memory_revolutions = 2.0;  // without a tachometer a longer memory has larger errors
        const auto force = runCompensation(told, record, reference.sensor, parameters);
        const std::size_t to = force[0].size();
        const auto from = to - static_cast<std::size_t>(0.3 * reference.sample_rate);
        return std::array<double, 2>{{worstError(force, reference, record, from, to, 3000.0),
                                      worstError(force, reference, record, from, to, 5000.0)}};
      };
      ReferenceCase blind = reference;
      blind.spindle_speed *= 1.0 + off;
      blind.speed_drop = 0.0;
      const auto tachometer = error(reference, false), tracked = error(reference, true),
                 commanded = error(blind, false);
      std::printf("%6.0f %18.1f %% %13.1f %% %9.2f %7.2f %10.2f %7.2f %12.1f %7.1f\n", rpm, 100.0 * off,
                  100.0 * drop, tachometer[0], tachometer[1], tracked[0], tracked[1], commanded[0],
                  commanded[1]);
    }
  }
}

/// Speed ripple at an order of the spindle or at a frequency of its own: the force models that can follow it,
/// each without passing samples through, and the choice of the node. A reading of the spindle every 10 ms.
void runRipples(const std::vector<double>& speeds, double duration) {
  struct Ripple {
    const char* name;
    double order, frequency;  // [1/revolution], [Hz]
  };
  std::printf("speed ripple: error of the force to 5 kHz [%%] over the last 0.3 s, worst of x and y\n");
  std::printf(
      "   rpm  ripple       RMS [%%]  measured  track_speed never  by angle  estimated  delay form    "
      "auto\n");
  for (const double rpm : speeds) {
    for (const Ripple& ripple : {Ripple{"order 1", 1.0, 0.0}, Ripple{"order 4", 4.0, 0.0},
                                 Ripple{"7 Hz", 0.0, 7.0}, Ripple{"33 Hz", 0.0, 33.0}}) {
      for (const double rms : {0.0, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02}) {
        ReferenceCase reference = caseAt(rpm, duration);
        reference.speed_ripple = rms;
        reference.ripple_frequency = ripple.order * rpm / 60.0 + ripple.frequency;
        const ReferenceRecord record = simulate(reference);
        const auto error = [&](const std::array<std::vector<double>, 2>& force) {
          const std::size_t to = record.time.size() / 256 * 256;
          return worstError(force, reference, record,
                            to - static_cast<std::size_t>(0.3 * reference.sample_rate), to, 5000.0);
        };
        const auto with = [&](AutoSetting track, bool delay_form, bool pass) {
          CompensationParameters parameters;
          parameters.track_speed = std::move(track);
          parameters.delay_form = delay_form;
          if (!pass) parameters.speed_tolerance = 0.49;
          return error(runCompensation(reference, record, reference.sensor, parameters));
        };
        std::printf("%6.0f  %-10s %9.2f %9.1f %18.2f %9.2f %10.2f %11.2f %7.2f\n", rpm, ripple.name,
                    100.0 * rms, error(record.measured), with(false, false, true), with(false, false, false),
                    with(true, false, false), with(false, true, false), with({}, false, true));
      }
    }
  }
}

/// Error over lag, from causal to the complete record.
void runLags(const std::vector<double>& speeds, double duration) {
  std::printf(
      "fixed lag: error of the force to 3 / 5 kHz [%%] from 0.1 s after engagement, worst of x and y\n");
  std::printf("   rpm      lag [ms]  to 3 kHz to 5 kHz\n");
  for (const double rpm : speeds) {
    ReferenceCase reference = caseAt(rpm, duration);
    const ReferenceRecord record = simulate(reference);
    const auto from = static_cast<std::size_t>((reference.engage_time + 0.1) * reference.sample_rate);
    for (const double lag : {0.0, 0.002, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16}) {
      CompensationParameters parameters;
      parameters.lag = lag;
      const auto force = runCompensation(reference, record, reference.sensor, parameters);
      const auto error = [&](double band) {
        return worstError(force, reference, record, from, force[0].size(), band);
      };
      std::printf("%6.0f  %12.0f %9.3f %8.3f\n", rpm, 1000.0 * lag, error(3000.0), error(5000.0));
    }
  }
}

/// Sensor that differs from its model.
struct Wrong {
  const char* name;
  std::function<ModalModel(ModalModel)> change;  // of the true sensor
  bool drifts;                                   // changes during the cut, from 0.3 to 0.8 s
};

const std::vector<Wrong>& wrongs() {
  static const auto scale = [](double frequency, double damping) {
    return [frequency, damping](ModalModel sensor) {
      for (Mode& mode : sensor.modes) {
        mode.frequency *= frequency;
        mode.damping_ratio *= damping;
      }
      return sensor;
    };
  };
  static const std::vector<Wrong> all{{"exact", scale(1.0, 1.0), false},
                                      {"frequencies +1 %", scale(1.01, 1.0), false},
                                      {"frequencies -1 %", scale(0.99, 1.0), false},
                                      {"frequencies +3 %", scale(1.03, 1.0), false},
                                      {"damping +30 %", scale(1.0, 1.3), false},
                                      {"one more mode, 3000 Hz, gain 0.03",
                                       [](ModalModel sensor) {
                                         sensor.modes.push_back({3000.0, 0.03, 0.03});
                                         sensor.modes[0].gain -= 0.03;
                                         return sensor;
                                       },
                                       false},
                                      {"first mode +1 % in the cut",
                                       [](ModalModel sensor) {
                                         sensor.modes[0].frequency *= 1.01;
                                         return sensor;
                                       },
                                       true},
                                      // The workpiece is half of the moving mass.
                                      {"workpiece 20 % lighter in the cut",
                                       [](ModalModel sensor) {
                                         for (Mode& mode : sensor.modes) mode.frequency /= std::sqrt(0.9);
                                         return sensor;
                                       },
                                       true}};
  return all;
}

void runErrors(const std::vector<double>& speeds, double duration) {
  std::printf("model errors: error of the force up to 5 kHz [%%] over the last 0.3 s, worst of x and y\n");
  std::printf("   rpm  the sensor is                        measured   frozen  following  moves\n");
  for (const double rpm : speeds) {
    for (const Wrong& wrong : wrongs()) {
      ReferenceCase reference = caseAt(rpm, duration);
      const ModalModel believed = reference.sensor;
      reference.later = wrong.change(reference.sensor);
      if (wrong.drifts) {
        reference.drift_from = 0.3;
        reference.drift_to = 0.8;
      } else {
        reference.sensor = reference.later;
      }
      const ReferenceRecord record = simulate(reference);
      CompensationParameters parameters;
      const auto frozen = runCompensation(reference, record, believed, parameters);
      parameters.follow = true;
      std::size_t moves = 0;
      const auto following = runCompensation(reference, record, believed, parameters, &moves);
      const auto error = [&](const std::array<std::vector<double>, 2>& force) {
        const std::size_t to = following[0].size();
        const auto from = to - static_cast<std::size_t>(0.3 * reference.sample_rate);
        return worstError(force, reference, record, from, to, 5000.0);
      };
      std::printf("%6.0f  %-36s %8.2f %8.2f %10.2f %6zu\n", rpm, wrong.name, error(record.measured),
                  error(frozen), error(following), moves);
    }
  }
}

/// Burzoni's tables 8..15 and maps: q from the taps compared with the best q of the cut (chosen by the
/// truth), and the harmonic form by its default design and with a memory per band from the likelihood.
class TuningStudy {
 public:
  explicit TuningStudy(double duration) {
    reference_.duration = duration;
    taps_ = simulateTaps(reference_, 9);
    sensor_ = identifySensor(taps_.hammer, taps_.response, rate(), {100.0, BAND, 4}).model;
    frf_ = averagedFrf(taps_.hammer, taps_.response, rate());
    r_taps_ = noiseBefore(taps_, rate(), 0.009);
    for (double rpm = 1000.0; rpm <= 20000.0; rpm += 200.0) speeds_.push_back(units::radPerSecFromRpm(rpm));
    map_ = tapMap(taps_, sensor_, rate(), r_taps_, speeds_, BAND);
  }

  void run() {
    std::printf(
        "sensor from nine taps; R from before the hits %.3f N2; RMSE of the harmonics' amplitudes [N], "
        "amplitude error of the tooth harmonics to 3 kHz [%%], worst of x and y\n",
        r_taps_);
    std::printf(
        "        |        random walk (Burzoni)                     |   harmonics, default      |  "
        "memory per band by likelihood\n");
    std::printf(
        "    rpm | R of air   q of taps  RMSE   ampl.  best q  RMSE |      RMSE   ampl.         |  "
        "RMSE   ampl.   revolutions\n");
    for (const double rpm : {1000.0, 3700.0, 6500.0, 9300.0, 12000.0, 14800.0, 17600.0}) runSpeed(rpm);
  }

  void draw(const std::string& picture) const {
    std::vector<NamedMap> maps{{"sensor as measured", map_, cuts_}};
    for (const double k : {-3.0, -2.0, 2.0, 3.0}) {
      const std::string name = formatted("%+.0f standard deviations", k);
      maps.push_back(
          {name, tapMap(plantAt(taps_, frf_, rate(), k), sensor_, rate(), r_taps_, speeds_, BAND), cuts_});
      std::printf("plant at %s: best q at 9300 rpm 2^%d, at 17600 rpm 2^%d\n", name.c_str(),
                  maps.back().map.best(units::radPerSecFromRpm(9300.0)),
                  maps.back().map.best(units::radPerSecFromRpm(17600.0)));
    }
    drawMaps(maps, picture);
    std::printf("maps written to %s\n", picture.c_str());
  }

 private:
  static constexpr double BAND = 5000.0, AMPLITUDES = 3000.0;  // [Hz]
  static constexpr int FLUTES = 4, HARMONICS = 60;
  double rate() const { return reference_.sample_rate; }

  /// Worst of x and y.
  CutScore scored(const ReferenceRecord& record, const Estimator& estimate) const {
    const auto from = static_cast<std::size_t>(0.4 * reference_.duration * rate());
    CutScore worst;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const CutScore score = scoreCut(estimate(record.measured[axis]), record.truth[axis], rate(),
                                      reference_.spindle_speed, FLUTES, from, BAND, AMPLITUDES);
      worst.rmse = std::max(worst.rmse, score.rmse);
      worst.amplitude = std::max(worst.amplitude, score.amplitude);
    }
    return worst;
  }

  CutScore walk(const ReferenceRecord& record, double r, int exponent) const {
    return scored(record, [&](const std::vector<double>& measured) {
      return randomWalkForce(measured, sensor_, rate(), std::pow(2.0, exponent), r);
    });
  }

  CutScore laidOut(const ReferenceRecord& record) const {
    HarmonicFilterParameters parameters;
    parameters.max_harmonics = HARMONICS;
    HarmonicFilter filter(sensor_, reference_.spindle_speed, rate(), parameters);
    return scored(record, [&](const std::vector<double>& measured) { return causal(filter, measured); });
  }

  void runSpeed(double rpm) {
    const std::vector<double> edges{1000.0, 3000.0};  // [Hz]
    const double speed = reference_.spindle_speed = units::radPerSecFromRpm(rpm);
    const ReferenceRecord record = simulate(reference_);
    // Air cutting: the tool is not in the cut before engage_time.
    double r_air = 0.0;
    const auto air = static_cast<std::size_t>(0.9 * reference_.engage_time * rate());
    for (std::size_t i = 0; i < air; ++i)
      r_air += std::pow(record.measured[0][i], 2) / static_cast<double>(air);
    const int told = map_.best(speed);
    const CutScore own = walk(record, r_air, told);
    CutScore best;
    best.rmse = 1e9;
    int best_exponent = 0;
    for (int exponent = LEAST_EXPONENT; exponent <= MOST_EXPONENT; ++exponent) {
      const CutScore score = walk(record, r_air, exponent);
      if (score.rmse >= best.rmse) continue;
      best = score;
      best_exponent = exponent;
    }
    cuts_.emplace_back(speed, best_exponent);
    const CutScore laid_out = laidOut(record);
    const double noise = std::sqrt(r_air);
    const BandTuning tuned =
        tuneBands(record.measured[0], sensor_, speed, rate(), noise, edges, frf_, HARMONICS);
    const CutScore bands = scored(record, [&](const std::vector<double>& measured) {
      return bandForce(measured, sensor_, speed, rate(), noise, edges, tuned.memory, HARMONICS);
    });
    std::printf("%7.0f | %8.3f %8s%-2d %6.3f %6.2f %5s%-2d %6.3f | %9.3f %7.2f         | %6.3f %6.2f  ", rpm,
                r_air, "2^", told, own.rmse, 100.0 * own.amplitude, "2^", best_exponent, best.rmse,
                laid_out.rmse, 100.0 * laid_out.amplitude, bands.rmse, 100.0 * bands.amplitude);
    for (const double memory : tuned.memory) std::printf(" %g", memory);
    std::printf("\n");
  }

  ReferenceCase reference_;
  ReferenceTaps taps_;
  ModalModel sensor_;
  FrequencyResponse frf_;
  double r_taps_ = 0.0;  // [N2]
  std::vector<double> speeds_;
  TuningMap map_;
  std::vector<std::pair<double, int>> cuts_;  // [rad/s], best exponent
};

void runTuning(double duration, const std::string& picture) {
  TuningStudy study(duration);
  study.run();
  if (!picture.empty()) study.draw(picture);
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  std::vector<double> speeds{3000.0, 9000.0, 15000.0, 21750.0};
  double duration = 1.0;
  std::string picture;
  bool errors = false, tuning = false, force_models = false, track = false, lags = false, ripples = false;
  CommandLine line{"Errors of the force compensation in the reference cut, next to their targets."};
  line.option("--speed-rpm", speeds, "spindle speeds").within(500.0, 60000.0);
  line.option("--duration-s", duration, "length of a record").within(0.3, 100.0);
  line.flag("--model-errors", errors, "a sensor that differs from its model: frozen and following filter");
  line.flag("--force-models", force_models, "Fourier series and F(t) = F(t - T): error and cost");
  line.flag("--track-speed", track, "no tachometer: the speed as a state, compared with a tachometer");
  line.flag(
      "--speed-ripple", ripples,
      "speed ripple of 0.05 to 2 %: harmonics by angle, estimated speed, delay form and the node's choice");
  line.flag("--lags", lags, "error of the fixed-lag smoother over its lag");
  line.flag("--tuning", tuning, "seven speeds: q from the taps compared with the best q of the cut");
  line.option("--picture", picture, "with --tuning: PNG of the maps q over speed, with confidence plants");
  return runProgram(line, argc, argv, [&] {
    if (force_models) {
      runForceModels(speeds, duration);
      return 0;
    }
    if (track) {
      runSpeeds(speeds, duration);
      return 0;
    }
    if (ripples) {
      runRipples(speeds, std::max(duration, 1.2));
      return 0;
    }
    if (lags) {
      runLags(speeds, duration);
      return 0;
    }
    if (tuning) {
      runTuning(duration, picture);
      return 0;
    }
    errors ? runErrors(speeds, std::max(duration, 1.6)) : run(speeds, duration);

    return 0;
  });
}
