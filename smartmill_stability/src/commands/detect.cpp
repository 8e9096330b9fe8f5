#include "smartmill_stability/commands.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "commands/recording_file.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/units.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::stability;  // NOLINT

std::vector<double> modesOf(const std::string& file) {
  std::vector<double> modes;
  if (file.empty()) return modes;
  const MachineModel model = readMachineModel(file);
  for (const ModalModel* axis : {&model.tool_tip.x, &model.tool_tip.y})
    for (const Mode& mode : axis->modes) modes.push_back(mode.frequency);
  if (modes.empty()) throw Error(file + ": expected tool_tip with modes");
  return modes;
}

/// Draws the spectrogram in dB with the tooth passing harmonics as dotted lines and the chatter as a red
/// line.
void draw(const RecordingVerdict& verdict, const RecordingOptions& o) {
  constexpr std::size_t MOST = 400;
  const Spectrogram& s = verdict.spectrogram;
  const std::size_t across = std::max<std::size_t>(1, s.frequency.size() / MOST);
  const std::size_t along = std::max<std::size_t>(1, s.time.size() / MOST);
  std::vector<std::vector<double>> rows;
  for (std::size_t w = 0; w < s.time.size(); w += along)
    for (std::size_t k = 0; k + across <= s.frequency.size(); k += across) {
      double most = 1e-30;
      for (std::size_t i = k; i < k + across; ++i) most = std::max(most, s.power[w][i]);
      rows.push_back({s.time[w], s.frequency[k], 10.0 * std::log10(most)});
    }
  Gnuplot plot(o.picture, 1100, 650, 12);
  plot.block("levels", rows);
  const double passing = o.teeth * verdict.speed / units::TWO_PI, end = s.time.back();
  for (double f = passing; f < s.frequency.back(); f += passing)  // none if the speed is unknown
    plot << formatted("set arrow from %g,%g to %g,%g nohead front lc rgb '#ffffff' dt 3 lw 0.5\n", s.time[0],
                      f, end, f);
  if (verdict.chatter())
    plot << formatted("set arrow from %g,%g to %g,%g nohead front lc rgb '#ff2020' lw 1.5\n", s.time[0],
                      verdict.frequency, end, verdict.frequency)
         << formatted("set label 'chatter %.0f Hz' at %g,%g front tc rgb '#ff2020' offset 0,0.6\n",
                      verdict.frequency, s.time[0], verdict.frequency);
  plot << "set title " << Gnuplot::quoted(verdict.text()) << " font ',10'\nset xlabel "
       << Gnuplot::quoted("Time [s] of " + std::filesystem::path(o.file).filename().string())
       << "\nset ylabel 'Frequency [Hz] (dotted: tooth passing harmonics)'\nset cblabel 'Power [dB]'\n"
       << formatted("set xrange [%g:%g]\nset yrange [0:%g]\n", s.time[0], end, s.frequency.back())
       << "set palette defined (0 '#000020', 1 '#203080', 2 '#3090a0', 3 '#e0d060', 4 '#ffffff')\n"
       << "plot $levels using 1:2:3 with image notitle\n";
  plot.draw();
}

void run(const RecordingOptions& given) {
  RecordingOptions o = given;
  RecordingRequest request;
  request.speed = units::radPerSecFromRpm(o.rpm);
  request.teeth = o.teeth;
  request.speed_error = 0.01 * o.speed_error;
  request.modes = modesOf(o.model);
  if (o.picture.empty()) o.picture = std::filesystem::path(o.file).stem().string() + "_spectrogram.png";
  request.validate();
  if (!o.idle.empty()) {
    RecordingOptions idle = o;
    idle.file = o.idle;
    idle.from = 0.0;
    idle.to = INFINITY;
    request.idle = loadRecording(idle);
  }
  const RecordingVerdict verdict = judgeFile(o, request);
  std::printf("%s\n", verdict.text().c_str());
  draw(verdict, o);
}

}  // namespace

namespace smartmill::stability {

Command detectCommand() {
  Command command("detect", "detects chatter in a recorded cut (sound, vibration, force)");
  command.description =
      "Detects chatter in a recording of a cut (sound, vibration, displacement or force; WAV, FLAC, CSV or "
      "bag), "
      "prints the result in one line (no cut, stable, chatter or unsure, with the probability of chatter) "
      "and draws "
      "the spectrogram. Three revolutions and two samples in a tooth passing period are the least.";
  command.examples = {{"cut.wav --speed 8000 --teeth 4", "all channels of a sound file"},
                      {"cut.wav --teeth 4", "the spindle speed is found from the harmonics"},
                      {"cut.csv --speed 8000 --teeth 4 --channels fx,fy --model mill.yaml",
                       "two columns; chatter must lie near a mode of the model"}};
  command.files = {{"FILE", "the recording: WAV, FLAC, AIFF, CSV with a column time[s], or a bag"},
                   {"NAME_spectrogram.png", "spectrogram, unless -o sets another name"}};
  command.setBody(run, [](CommandLine& line, RecordingOptions& o) {
    line.option("FILE", o.file, "the recording").required();
    line.option("--speed", o.rpm, "spindle speed of the cut [rpm] (default: found from the harmonics)")
        .positive();
    line.option("--teeth", o.teeth, "teeth of the tool").required();
    line.option("--speed-error", o.speed_error, "largest error of the speed [percent]").showDefault();
    line.option(
        "--idle", o.idle,
        "recording of the idle spindle at the same speed by the same sensor: a cut is louder, and its lines "
        "are no chatter");
    line.option("--model", o.model, "machine model file; chatter must lie near a mode of its tool_tip");
    line.option("--channels", o.channels,
                "channel numbers of a sound file, or columns of a CSV file (default: all)")
        .commas();
    line.option(
        "--topic", o.topic,
        "topic of a bag (default: the first available of daq/sound, daq/vibration, force/compensated, "
        "daq/dynamometer)");
    line.option("--from", o.from, "start of the part to use [s]").notNegative();
    line.option("--to", o.to, "end of the part to use [s]");
    line.option("-o,--out", o.picture, "picture of the spectrogram (default: NAME_spectrogram.png)");
  });
  return command;
}

}  // namespace smartmill::stability
