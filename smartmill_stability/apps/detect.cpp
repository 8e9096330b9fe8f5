// rosrun smartmill_stability detect FILE --speed RPM --teeth N: is it chatter that was recorded?

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_core/io/gnuplot.h"
#include "smartmill_core/io/sound_file.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/program.h"
#include "smartmill_core/units.h"
#include "smartmill_ros/bag_reader.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_stability/chatter/recording.h"

namespace {

using namespace smartmill;             // NOLINT
using namespace smartmill::stability;  // NOLINT

struct Options {
  std::string file, model, topic, picture;
  std::vector<std::string> channels;
  double rpm = 0.0, speed_error = 2.0, from = 0.0, to = INFINITY;
  int teeth = 0;
};

Recording fromSound(const Options& o) {
  SoundFile sound = readSoundFile(o.file);
  Recording recording;
  recording.sample_rate = sound.sample_rate;
  if (o.channels.empty()) {
    recording.channels = std::move(sound.channels);
    return recording;
  }
  for (const std::string& channel : o.channels) {
    std::size_t number = 0;
    char rest = 0;
    if (std::sscanf(channel.c_str(), "%zu%c", &number, &rest) != 1 || number < 1 ||
        number > sound.channels.size())
      throw Error(o.file + ": channel '" + channel + "', 1.." + std::to_string(sound.channels.size()) +
                  " is due");
    recording.channels.push_back(sound.channels[number - 1]);
  }
  return recording;
}

bool isTime(const std::string& name) {
  return name == "t" || name == "t[s]" || name == "time" || name == "time[s]";
}

Recording fromTable(const Options& o) {
  const NumberTable table = readNumberTable(o.file);
  const auto time = std::find_if(table.names.begin(), table.names.end(), isTime);
  if (time == table.names.end()) throw Error(o.file + ": a column time[s] (or t[s]) is due");
  const std::vector<double>& t = table.columns[static_cast<std::size_t>(time - table.names.begin())];
  if (t.size() < 2 || !(t.back() > t.front())) throw Error(o.file + ": column time does not rise");
  Recording recording;
  recording.sample_rate = static_cast<double>(t.size() - 1) / (t.back() - t.front());
  for (std::size_t i = 1; i < t.size(); ++i) {
    if (!std::isfinite(t[i])) throw Error(o.file + formatted(": no time behind %.6f s", t[i - 1]));
    if (std::abs((t[i] - t[i - 1]) * recording.sample_rate - 1.0) > 0.1)
      throw Error(o.file + formatted(": uneven time at %.6f s", t[i]));
  }
  std::vector<std::string> names = o.channels;
  for (const std::string& name : table.names)
    if (o.channels.empty() && !isTime(name) && name.rfind("spindle_angle", 0) != 0) names.push_back(name);
  for (const std::string& name : names) {
    recording.channels.push_back(table.column(name));
    for (std::size_t i = 0; i < t.size(); ++i)
      if (!std::isfinite(recording.channels.back()[i]))
        throw Error(o.file + ": column " + name + formatted(" has no number at %.6f s", t[i]));
  }
  return recording;
}

/// The longest stretch of a topic without lost samples.
class Stretch {
 public:
  explicit Stretch(const Options& o) : o_(o) {}
  void add(const SampleBlock& block) {
    if (!begun_) begun_ = block.stamp;
    if (block.stamp - *begun_ < o_.from || block.stamp - *begun_ > o_.to) return;
    if (block.first_index != next_ || now_.channels.size() != block.channels.size()) restart(block);
    next_ = block.first_index + block.size();
    for (std::size_t c = 0; c < block.channels.size(); ++c)
      for (std::size_t i = 0; i < block.size(); ++i) now_.channels[c].push_back(block.at(i, c));
  }
  Recording longest() {
    keep();
    if (best_.channels.empty()) throw Error(o_.file + ": topic " + o_.topic + " holds no samples");
    for (const std::vector<double>& channel : best_.channels)
      for (const double v : channel)
        if (!std::isfinite(v))
          throw Error(o_.file + ": topic " + o_.topic + " holds a value that is not a finite number");
    return best_;
  }

 private:
  void keep() {
    if (!now_.channels.empty() &&
        (best_.channels.empty() || now_.channels[0].size() > best_.channels[0].size()))
      best_ = now_;
  }
  void restart(const SampleBlock& block) {
    keep();
    now_ = Recording();
    now_.sample_rate = block.sample_rate;
    now_.channels.resize(block.channels.size());
  }

  const Options& o_;
  std::optional<double> begun_;
  std::uint64_t next_ = 0;
  Recording now_, best_;
};

Recording fromBag(Options o) {
  BagReader bag(o.file);
  for (const char* topic : {"daq/sound", "daq/vibration", names::FORCE_COMPENSATED, names::DYNAMOMETER})
    if (o.topic.empty() && bag.has(topic)) o.topic = topic;
  if (o.topic.empty() || !bag.has(o.topic))
    throw Error(o.file + ": topic " +
                (o.topic.empty() ? "daq/sound, daq/vibration or force/compensated" : o.topic) +
                " is missing");
  Stretch stretch(o);
  if (o.topic.find("force/") != std::string::npos) {
    bag.on<smartmill_msgs::ForceBlock>(o.topic, [&](const smartmill_msgs::ForceBlock& m, double) {
      const ForceBlock force = fromMsg(m);
      SampleBlock block;
      block.stamp = force.stamp;
      block.sample_rate = force.sample_rate;
      block.first_index = force.first_index;
      block.channels = {"fx", "fy", "fz"};
      for (std::size_t i = 0; i < force.force[0].size(); ++i)
        for (const std::vector<double>& axis : force.force) block.samples.push_back(axis[i]);
      stretch.add(block);
    });
  } else {
    bag.on<smartmill_msgs::SampleBlock>(
        o.topic, [&](const smartmill_msgs::SampleBlock& m, double) { stretch.add(fromMsg(m)); });
  }
  bag.run();
  return stretch.longest();
}

Recording load(const Options& o) {
  const std::string ending = std::filesystem::path(o.file).extension().string();
  if (ending == ".bag") return fromBag(o);
  Recording recording = isSoundFile(o.file) ? fromSound(o) : fromTable(o);
  const auto size = recording.channels.empty() ? 0 : recording.channels[0].size();
  const auto at = [&](double seconds) {
    return static_cast<std::size_t>(
        std::clamp(seconds * recording.sample_rate, 0.0, static_cast<double>(size)));
  };
  const std::size_t from = at(o.from), to = at(o.to);
  if (from >= to) throw Error(o.file + formatted(": nothing between %.2f and %.2f s", o.from, o.to));
  for (std::vector<double>& channel : recording.channels)
    channel = {channel.begin() + static_cast<std::ptrdiff_t>(from),
               channel.begin() + static_cast<std::ptrdiff_t>(to)};
  return recording;
}

std::vector<double> modesOf(const std::string& file) {
  std::vector<double> modes;
  if (file.empty()) return modes;
  const MachineModel model = readMachineModel(file);
  for (const ModalModel* axis : {&model.tool_tip.x, &model.tool_tip.y})
    for (const Mode& mode : axis->modes) modes.push_back(mode.frequency);
  if (modes.empty()) throw Error(file + ": tool_tip with modes is due");
  return modes;
}

/// Time and frequency in dB, tooth passings as thin lines, the chatter as an arrow.
void draw(const RecordingVerdict& verdict, const Options& o) {
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
  for (double f = passing; f < s.frequency.back(); f += passing)
    plot << formatted("set arrow from %g,%g to %g,%g nohead front lc rgb '#ffffff' dt 3 lw 0.5\n", s.time[0],
                      f, end, f);
  if (verdict.chatter)
    plot << formatted("set arrow from %g,%g to %g,%g nohead front lc rgb '#ff2020' lw 1.5\n", s.time[0],
                      verdict.frequency, end, verdict.frequency)
         << formatted("set label 'chatter %.0f Hz' at %g,%g front tc rgb '#ff2020' offset 0,0.6\n",
                      verdict.frequency, s.time[0], verdict.frequency);
  plot << "set title " << Gnuplot::quoted(verdict.text()) << " font ',10'\nset xlabel "
       << Gnuplot::quoted("Time [s] of " + std::filesystem::path(o.file).filename().string())
       << "\nset ylabel 'Frequency [Hz] (dotted: tooth passings)'\nset cblabel 'Power [dB]'\n"
       << formatted("set xrange [%g:%g]\nset yrange [0:%g]\n", s.time[0], end, s.frequency.back())
       << "set palette defined (0 '#000020', 1 '#203080', 2 '#3090a0', 3 '#e0d060', 4 '#ffffff')\n"
       << "plot $levels using 1:2:3 with image notitle\n";
  plot.draw();
}

void run(Options o) {
  RecordingRequest request;
  request.speed = units::radPerSecFromRpm(o.rpm);
  request.teeth = o.teeth;
  request.speed_error = 0.01 * o.speed_error;
  request.modes = modesOf(o.model);
  if (o.picture.empty()) o.picture = std::filesystem::path(o.file).stem().string() + "_spectrogram.png";
  request.validate();
  const Recording recording = load(o);
  const RecordingVerdict verdict = [&] {
    try {
      return judgeRecording(recording, request);
    } catch (const Error& error) {
      throw Error(o.file + ": " + error.what());
    }
  }();
  draw(verdict, o);
  std::printf("%s\n", verdict.text().c_str());
}

}  // namespace

int main(int argc, char** argv) {
  CommandLine line(
      "Judges a recording of a cut (sound, vibration, displacement or force; WAV, FLAC, CSV or bag): chatter "
      "or not, "
      "in one line, and draws its spectrogram.");
  Options o;
  line.option("FILE", o.file, "the recording").required();
  line.option("--speed", o.rpm, "of the spindle in the cut [rpm]").required().positive();
  line.option("--teeth", o.teeth, "of the tool").required();
  line.option("--speed-error", o.speed_error, "the speed may be so much off [percent] (2)");
  line.option("--model", o.model, "machine model whose tool_tip tells the modes: chatter lies near one");
  line.option("--channels", o.channels, "numbers of a sound file's channels, or columns of a CSV (all)")
      .commas();
  line.option("--topic", o.topic, "of a bag (daq/sound, daq/vibration, force/compensated, what there is)");
  line.option("--from", o.from, "second at which to begin").notNegative();
  line.option("--to", o.to, "and to end");
  line.option("-o,--out", o.picture, "picture of the spectrogram (NAME_spectrogram.png)");
  return runProgram(line, argc, argv, [&] { run(o); });
}
