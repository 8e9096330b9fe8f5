#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "convert.h"
#include "module.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/sound_file.h"
#include "smartmill_stability/chart/uncertainty.h"
#include "smartmill_stability/chatter/recording.h"
#include "smartmill_stability/solvers/model_system.h"
#include "smartmill_stability/solvers/solver.h"
#include "work.h"

namespace smartmill::python {
namespace {

using namespace smartmill::stability;

constexpr std::size_t PIECE = 25;  // speeds between two calls of progress

py::object lobes(const MachineModel& model, double entry_deg, double exit_deg, const Array& speed,
                 double max_depth, const std::string& method, bool errors, const py::object& progress) {
  const std::vector<double> speeds = vectorOf(speed);
  std::vector<Limit> limits = interruptible(progress, [=](Work& work) {
    SolverOptions options;
    options.estimate_error = errors;
    const auto solver = makeSolver(methodOf(method), systemOf(model, entry_deg, exit_deg), options);
    std::vector<Limit> all;
    // Pieces overlap by one speed, as the solver compares neighbours.
    for (std::size_t i = 0; i < speeds.size(); i += PIECE) {
      work.progress(static_cast<double>(i) / static_cast<double>(speeds.size()));
      const std::size_t from = i > 0 ? i - 1 : 0, to = std::min(i + PIECE + 1, speeds.size());
      const auto begin = speeds.begin();
      const std::vector<double> piece(begin + static_cast<std::ptrdiff_t>(from),
                                      begin + static_cast<std::ptrdiff_t>(to));
      const std::vector<Limit> found = solver->limits(piece, max_depth);
      for (std::size_t k = i; k < std::min(i + PIECE, speeds.size()); ++k) all.push_back(found[k - from]);
    }
    work.progress(1.0);
    return all;
  });
  std::vector<double> depth, frequency, error;
  py::list kind;
  for (const Limit& limit : limits) {
    depth.push_back(limit.depth);
    frequency.push_back(limit.frequency);
    error.push_back(limit.error);
    kind.append(nameOf(limit.kind));
  }
  return make("Lobes", arrayOf(speeds), arrayOf(std::move(depth)), arrayOf(std::move(frequency)),
              py::tuple(kind), arrayOf(std::move(error)));
}

py::object chatterRisk(const MachineModel& model, double entry_deg, double exit_deg, const Array& speed,
                       const Array& depth, int draws, unsigned seed, double risk, double speed_margin,
                       const py::object& progress) {
  const std::vector<double> speeds = vectorOf(speed), depths = vectorOf(depth);
  ProbabilityChart chart = interruptible(progress, [=](Work& work) {
    const auto system = UncertainSystem::of(model, systemOf(model, entry_deg, exit_deg));
    return probabilityChart(system, speeds, depths, draws, seed, [&](double share) { work.progress(share); });
  });
  const std::vector<RobustPoint> points =
      robustPoints(chart, risk, speed_margin, static_cast<int>(speeds.size()));
  return make("ChatterRisk", arrayOf(std::move(chart.speeds)), arrayOf(std::move(chart.depths)),
              arrayOf(chart.probability), arrayOf(std::move(chart.nominal)),
              tupleOf(points, [](const RobustPoint& p) {
                return make("RobustPoint", p.speed, p.depth, p.probability);
              }));
}

py::object verdictOf(RecordingVerdict v) {
  using py::arg;
  const std::string text = v.text();
  return make(
      "Chatter", arg("chatter") = v.chatter(), arg("verdict") = nameOf(v.kind),
      arg("probability") = v.probability, arg("cut") = v.cut, arg("frequency") = v.frequency,
      arg("spindle_speed") = v.speed, arg("start") = v.from, arg("end") = v.to,
      arg("over_noise") = v.over_noise, arg("over_air") = v.over_air, arg("companions") = v.companions,
      arg("share") = v.share, arg("mode") = v.mode, arg("reason") = v.reason, arg("text") = text,
      arg("time") = arrayOf(std::move(v.spectrogram.time)),
      arg("line") = arrayOf(std::move(v.spectrogram.frequency)), arg("power") = arrayOf(v.spectrogram.power));
}

py::object detect(const std::vector<Array>& samples, double rate, double speed, int teeth, double speed_error,
                  const std::vector<double>& modes) {
  Recording recording{rate, {}};
  for (const Array& channel : samples) recording.channels.push_back(vectorOf(channel));
  return verdictOf(interruptible(py::none(), [=](Work&) {
    return judgeRecording(recording, {speed, teeth, speed_error, modes, {}});
  }));
}

py::object detectSound(const std::string& file, double speed, int teeth, double speed_error,
                       const std::vector<double>& modes) {
  const RecordingRequest request{speed, teeth, speed_error, modes, {}};
  request.validate();
  return verdictOf(interruptible(py::none(), [=](Work& work) {
    SoundFile sound = readSoundFile(file);
    work.check();
    try {
      return judgeRecording({sound.sample_rate, std::move(sound.channels)}, request);
    } catch (const Error& error) {
      throw Error(file + ": " + error.what());
    }
  }));
}

}  // namespace

void addStability(py::module_& m) {
  m.def("lobes", &lobes, py::arg("model"), py::arg("entry_deg"), py::arg("exit_deg"), py::arg("speed"),
        py::arg("max_depth"), py::arg("method"), py::arg("errors"), py::arg("progress"));
  m.def("chatter_risk", &chatterRisk, py::arg("model"), py::arg("entry_deg"), py::arg("exit_deg"),
        py::arg("speed"), py::arg("depth"), py::arg("draws"), py::arg("seed"), py::arg("risk"),
        py::arg("speed_margin"), py::arg("progress"));
  m.def("detect", &detect, py::arg("samples"), py::arg("rate"), py::arg("spindle_speed"), py::arg("teeth"),
        py::arg("speed_error"), py::arg("modes"));
  m.def("detect_sound", &detectSound, py::arg("file"), py::arg("spindle_speed"), py::arg("teeth"),
        py::arg("speed_error"), py::arg("modes"));
}

}  // namespace smartmill::python
