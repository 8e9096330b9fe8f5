#include "stability/turning_loop.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>

#include "smartmill_core/error.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/units.h"
#include "smartmill_stability_testing/kim_case.h"

namespace smartmill::stability {

namespace {

using Complex = std::complex<double>;
using units::TWO_PI;
constexpr int LENGTH = 512, SEGMENT_SAMPLES = 2048;  // at 1 ms
constexpr double LINE = TWO_PI * 1000.0 / LENGTH;    // [rad/s]
constexpr double LOW = 200.0, HIGH = 500.0;          // [rad/s] search range of the machine's mode

SampleBlock commandBlock(std::uint64_t index, double rate, double value) {
  SampleBlock block;
  block.sample_rate = rate;
  block.first_index = index;
  block.channels = {"command"};
  block.units = {"m"};
  block.samples = {value};
  return block;
}

void keep(const sim::Lathe::Block& block, TurningTrace* trace) {
  for (std::size_t i = 0; i < block.displacement.size(); ++i) {
    trace->time.push_back(block.displacement.timeOf(i));
    trace->deflection.push_back(block.displacement.at(i, 0));
    trace->motion.push_back(block.motion[i]);
    trace->force.push_back(block.force[i]);
  }
}

/// Hamming-windowed spectra of the blocks of a segment, half overlapping, one after the other.
std::vector<std::vector<Complex>> spectraOf(const std::vector<double>& signal) {
  std::vector<std::vector<Complex>> all;
  for (std::size_t begin = 0; begin + LENGTH <= signal.size(); begin += LENGTH / 2) {
    std::vector<Complex> lines;
    for (int l = 1; l <= static_cast<int>(HIGH / LINE) + 8; ++l) {
      Complex sum = 0.0;
      for (int i = 0; i < LENGTH; ++i) {
        const double window = 0.54 - 0.46 * std::cos(TWO_PI * i / (LENGTH - 1));
        sum +=
            window * signal[begin + static_cast<std::size_t>(i)] * std::polar(1.0, -TWO_PI * l * i / LENGTH);
      }
      lines.push_back(sum);
    }
    all.push_back(lines);
  }
  return all;
}

/// Spectrum of a signal (eq. 12), line by line, averaged over the blocks.
std::vector<Complex> meanSpectrum(const std::vector<double>& signal) {
  const auto blocks = spectraOf(signal);
  std::vector<Complex> sum(blocks.front().size());
  for (const auto& block : blocks) {
    for (std::size_t l = 0; l < sum.size(); ++l) sum[l] += block[l] / static_cast<double>(blocks.size());
  }
  return sum;
}

/// Cross spectrum of two signals, line by line, averaged over the blocks.
std::vector<Complex> cross(const std::vector<double>& a, const std::vector<double>& b) {
  const auto first = spectraOf(a), second = spectraOf(b);
  std::vector<Complex> sum(first.front().size());
  for (std::size_t k = 0; k < first.size(); ++k) {
    for (std::size_t l = 0; l < sum.size(); ++l)
      sum[l] += std::conj(first[k][l]) * second[k][l] / static_cast<double>(first.size());
  }
  return sum;
}

}  // namespace

double TurningTrace::vibration(double begin, double end) const {
  double sum = 0.0, squares = 0.0, n = 0.0;
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (time[i] < begin || time[i] >= end) continue;
    sum += motion[i], squares += motion[i] * motion[i], n += 1.0;
  }
  return n > 0.0 ? std::sqrt(std::max(0.0, squares / n - sum * sum / n / n)) : 0.0;
}

TurningTrace runTurning(const TurningLoop& loop) {
  sim::Lathe lathe(loop.lathe);
  TurningTrace trace;
  ControlStream control(loop.control, [&](const LearntMachine& m) { trace.learnt.push_back(m); });
  std::deque<SampleBlock> under_way;
  const auto blocks =
      static_cast<std::size_t>(std::ceil(loop.duration * loop.lathe.rate / static_cast<double>(loop.block)));
  for (std::size_t b = 0; b < blocks; ++b) {
    const sim::Lathe::Block block = lathe.advance(loop.block);
    keep(block, &trace);
    if (!loop.controlled) continue;
    control.handle(block.angle);
    if (auto commands = control.handle(block.displacement)) under_way.push_back(std::move(*commands));
    while (under_way.size() > loop.way) {
      lathe.command(under_way.front());
      under_way.pop_front();
    }
  }
  trace.late = lathe.late();
  return trace;
}

TurningLoop kimLoop(double logarithm) {
  TurningLoop loop;
  const TurningProcess process = kimProcess(logarithm);
  loop.lathe.spindle_speed = TWO_PI / process.period;
  loop.lathe.chip = process.chip;
  loop.control.controller.chip = process.chip;
  // Delay of a command: one block is sampled and others are in transit.
  loop.control.controller.lead = static_cast<double>(loop.block * (loop.way + 1)) / loop.lathe.rate;
  // Delay of a second-order servo well below its natural frequency: 2 zeta / w.
  loop.control.controller.actuator_delay =
      2.0 * loop.lathe.servo_damping / (TWO_PI * loop.lathe.servo_frequency);
  return loop;
}

SecondOrder readOff(const std::vector<double>& frequency, const std::vector<Complex>& response, double low,
                    double high) {
  std::size_t peak = 0;
  double most = -1.0;
  for (std::size_t i = 0; i < frequency.size(); ++i) {
    if (frequency[i] < low || frequency[i] > high || std::abs(response[i]) <= most) continue;
    most = std::abs(response[i]);
    peak = i;
  }
  if (most < 0.0) throw Error("transfer function: no line between the frequencies");
  const auto side = [&](int step) {
    auto i = static_cast<std::ptrdiff_t>(peak);
    while (i + step >= 0 && i + step < static_cast<std::ptrdiff_t>(frequency.size()) &&
           std::abs(response[static_cast<std::size_t>(i)]) > most / std::sqrt(2.0))
      i += step;
    const auto at = static_cast<std::size_t>(i), before = static_cast<std::size_t>(i - step);
    const double a = std::abs(response[before]), b = std::abs(response[at]);
    const double share = a > b ? std::clamp((a - most / std::sqrt(2.0)) / (a - b), 0.0, 1.0) : 1.0;
    return frequency[before] + share * (frequency[at] - frequency[before]);
  };
  SecondOrder found;
  found.frequency = frequency[peak];
  found.damping_ratio = std::clamp((side(1) - side(-1)) / (2.0 * found.frequency), 1e-3, 0.9);
  found.gain = 2.0 * found.damping_ratio * most;
  return found;
}

const char* nameOf(KimUpdate update) {
  return update == KimUpdate::printed ? "eq. 16 as printed" : "eq. 16 corrected";
}

Complex updateLine(KimUpdate update, const KimLine& last, const KimLine& before) {
  const Complex moved = last.tool - before.tool;
  if (std::abs(moved) <= 1e-9 * std::abs(last.work)) return last.g;
  return last.g + (last.work - (update == KimUpdate::corrected ? last.tool : before.tool)) / moved *
                      (last.g - before.g);
}

namespace {

/// Signals of a segment at 1 ms.
struct KimSignals {
  std::vector<double> chip, deflection, tool;  ///< [m]
};

/// Terms of eq. 16 of a segment that the next one needs.
struct KimTerms {
  std::vector<Complex> tool;      ///< Y_t; over the chip if corrected
  std::vector<Complex> in_force;  ///< G of the controller in this segment
};

/// Estimates of a segment from those before it. @param terms of the last segment, then of this one
KimSegment kimSegment(const KimSignals& signals, KimUpdate update, const std::vector<KimSegment>& earlier,
                      KimTerms* terms) {
  KimSegment segment;
  const auto power = cross(signals.chip, signals.chip), deflection = cross(signals.chip, signals.deflection);
  const bool corrected = update == KimUpdate::corrected;
  KimTerms now;
  now.tool = corrected ? cross(signals.chip, signals.tool) : meanSpectrum(signals.tool);
  for (std::size_t l = 0; l < power.size(); ++l) {
    segment.frequency.push_back(LINE * static_cast<double>(l + 1));
    segment.ratio.push_back(deflection[l] / power[l]);
    if (corrected) now.tool[l] /= power[l];
    now.in_force.push_back(earlier.empty() ? 0.0 : earlier.back().read.response(segment.frequency.back()));
  }
  segment.used = segment.ratio;
  if (!earlier.empty()) {
    const std::vector<Complex> work = corrected ? segment.ratio : meanSpectrum(signals.deflection);
    // As printed, the first application takes the plain estimates of the first two segments.
    const std::vector<Complex>& g =
        corrected ? now.in_force : (earlier.size() == 1 ? segment.ratio : earlier.back().used);
    const std::vector<Complex>& older =
        corrected ? terms->in_force : earlier[earlier.size() - std::min<std::size_t>(earlier.size(), 2)].used;
    for (std::size_t l = 0; l < g.size(); ++l)
      segment.used[l] = updateLine(update, {work[l], now.tool[l], g[l]}, {0.0, terms->tool[l], older[l]});
  }
  segment.read = readOff(segment.frequency, segment.used, LOW, HIGH);
  // K / K_m remains that of the first estimate (section 4).
  if (!earlier.empty()) segment.read.gain = earlier.front().read.gain;
  *terms = now;
  return segment;
}

}  // namespace

KimRun runKim(const TurningLoop& loop, KimUpdate update) {
  KimRun run;
  sim::Lathe lathe(loop.lathe);
  const auto every = static_cast<std::size_t>(std::lround(loop.lathe.rate / 1000.0));
  const double back = TWO_PI / loop.lathe.spindle_speed * loop.lathe.rate;
  std::unique_ptr<ModalFilter> filter;
  KimSignals signals;
  KimTerms terms;
  double chip_before = loop.lathe.chip;
  const auto samples = static_cast<std::size_t>(loop.duration * loop.lathe.rate);
  for (std::size_t i = 0; i < samples; ++i) {
    const sim::Lathe::Block block = lathe.advance(1);
    keep(block, &run.trace);
    const double deflection = block.displacement.at(0, 0), tool = block.displacement.at(0, 1);
    const auto whole = static_cast<std::size_t>(back);
    double past = 0.0;
    if (i > whole) {
      const double share = back - static_cast<double>(whole);
      past = run.trace.motion[i - whole] +
             share * (run.trace.motion[i - whole - 1] - run.trace.motion[i - whole]);
    }
    const double chip = loop.lathe.chip - (deflection - tool) + loop.lathe.overlap * past;
    double command = 0.0;
    if (filter) {
      filter->step(chip);
      command = filter->peek(2.0 * chip - chip_before);
    }
    chip_before = chip;
    lathe.command(commandBlock(i, loop.lathe.rate, command));
    if (i % every == 0) {
      signals.chip.push_back(chip);
      signals.deflection.push_back(deflection);
      signals.tool.push_back(tool);
    }
    if (signals.chip.size() < SEGMENT_SAMPLES) continue;
    const KimSegment segment = kimSegment(signals, update, run.segments, &terms);
    filter = std::make_unique<ModalFilter>(segment.read.modal(), loop.lathe.rate, Hold::first_order);
    run.segments.push_back(segment);
    signals = {};
  }
  run.trace.late = lathe.late();
  return run;
}

}  // namespace smartmill::stability
