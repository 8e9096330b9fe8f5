#include <cstdio>
#include <set>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_daq/alignment/stream_alignment.h"
#include "smartmill_daq/commands.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::daq {
namespace {

constexpr int NO_SHIFT = 3;  // exit code

struct Arguments {
  std::string record, late, early, method = "auto", config;
  double range = AlignmentOptions().range, window = AlignmentOptions().window;
};

AlignmentOptions optionsOf(const Arguments& arguments) {
  AlignmentOptions options;
  options.range = arguments.range;
  options.window = arguments.window;
  if (!(options.range < options.window)) throw Error("--range: expected less than --window");
  for (const auto method : {AlignmentMethod::taps, AlignmentMethod::motion, AlignmentMethod::correlation})
    if (arguments.method == methodName(method)) options.only = method;
  return options;
}

int run(const Arguments& arguments) {
  StreamAlignment alignment(SignalName(arguments.late), SignalName(arguments.early), optionsOf(arguments));
  RecordingReader reader(arguments.record);
  for (const std::string& topic : std::set<std::string>{alignment.late().topic, alignment.early().topic}) {
    if (!reader.has(topic)) throw Error(arguments.record + ": no topic " + topic);
    if (topic == names::CNC_STATE) {
      reader.on<CncState>(topic, [&](const CncState& state, double) { alignment.push(state); });
    } else {
      reader.on<SampleBlock>(topic,
                             [&, topic](const SampleBlock& block, double) { alignment.push(topic, block); });
    }
  }
  reader.run();
  alignment.finish();
  std::printf("%s\n", alignmentText(alignment).c_str());
  if (!alignment.state()) return NO_SHIFT;
  const std::string change = alignment.takeChange();
  if (!change.empty() && !arguments.config.empty())
    throw Error(arguments.record + ": " + change + "; a shift that changes is not stored");
  if (!change.empty()) std::fprintf(stderr, "%s\n", change.c_str());
  if (!arguments.config.empty()) {
    const double latency = storeLatency(arguments.config, alignment.state()->shift);
    std::printf("latency %.6f s stored in %s\n", latency, arguments.config.c_str());
  }
  return 0;
}

}  // namespace

Command alignCommand() {
  Command command("align", "shift between two streams of a recording, by taps, motion or correlation");
  command.description =
      "Estimates by how much the stream of one device is stamped later than that of another device or of the "
      "controller that shows the same event: taps that both see, the start of an axis (air cut), or the "
      "cross-correlation of both. Prints the shift with its standard deviation and adds it to `latency` of "
      "the "
      "late device's instrument file.";
  command.examples = {
      {"taps.bag daq/hammer/hammer daq/dynamometer/fz", "a hammer at one device, a dynamometer at another"},
      {"air_cut.bag daq/dynamometer/fx cnc/state/x --write front_end.yaml", "against the controller's axis"}};
  command.files = {{"CONFIG", "with --write: latency and latency_std"}};
  command.exits = {{NO_SHIFT, "no shift shows"}};
  command.setBody(run, [](CommandLine& line, Arguments& arguments) {
    line.option("RECORD", arguments.record, "bag or MCAP file").required();
    line.option("LATE", arguments.late, "TOPIC/CHANNEL of sample blocks").required();
    line.option("EARLY", arguments.early, "TOPIC/CHANNEL, or cnc/state/AXIS").required();
    line.option("--by", arguments.method, "the only method to try")
        .oneOf({"auto", "taps", "motion", "correlation"})
        .showDefault();
    line.option("--range", arguments.range, "[s] searched to either side").positive().showDefault();
    line.option("--window", arguments.window, "[s] of the record that is evaluated at a time")
        .positive()
        .showDefault();
    line.option("--write", arguments.config, "instrument file (smartmill-instrument/1) of the late device");
  });
  return command;
}

}  // namespace smartmill::daq
