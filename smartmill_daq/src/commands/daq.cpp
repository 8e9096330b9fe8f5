#include <chrono>
#include <cstdio>
#include <memory>
#include <string>

#include "smartmill_core/formatted.h"
#include "smartmill_core/stop_signal.h"
#include "smartmill_daq/acquisition/acquisition.h"
#include "smartmill_daq/acquisition/state_text.h"
#include "smartmill_daq/commands.h"
#include "smartmill_recording/recording_writer.h"

namespace smartmill::daq {
namespace {

constexpr int DEVICE_FAULT = 3;  // exit code
constexpr double PERIOD = 1.0;   // [s] between reports

struct Arguments {
  std::string config, record;
  double seconds = 0.0;
};

/// [s] since 1970-01-01
double wallTime() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

void report(const Acquisition& acquisition, double time) {
  const InstrumentState state = acquisition.state();
  std::printf("%8.1f s  %s, %llu samples, %llu lost; %s\n", time, summaryOf(state).c_str(),
              static_cast<unsigned long long>(state.account.delivered),
              static_cast<unsigned long long>(state.account.lost + state.account.estimated_lost),
              clockText(state.clock).c_str());
  const std::vector<Channel> channels = acquisition.instrument().channels();
  for (std::size_t c = 0; c < channels.size(); ++c)
    std::printf("            %s\n", levelText(channels[c], state.levels[c]).c_str());
  std::fflush(stdout);
}

int run(const Arguments& arguments) {
  std::optional<StrictYaml> options;
  const Instrument instrument = readInstrument(arguments.config, &options);
  std::unique_ptr<RecordingWriter> writer;
  if (!arguments.record.empty()) writer = createRecording(arguments.record, RecordingCompression::lz4);
  Acquisition::Outputs outputs;
  outputs.block = [&writer](const Stream& stream, const SampleBlock& block) {
    constexpr double NANOSECONDS = 1e9;
    if (writer)
      writer->write(stream.topic, static_cast<std::uint64_t>(wallTime() * NANOSECONDS),
                    toPlain(block, stream.frame));
  };
  outputs.fault = [](const Fault& fault) {
    std::fprintf(stderr, "%s at sample %llu: %s\n", faultName(fault.kind),
                 static_cast<unsigned long long>(fault.index), fault.text.c_str());
  };
  Acquisition acquisition(instrument, makeDriver(arguments.config, instrument, options), outputs, wallTime);
  catchStopSignals();
  const double begin = wallTime();
  double reported = begin;
  while (!stopRequested() && acquisition.step()) {
    const double now = wallTime();
    if (now - reported >= PERIOD) {
      report(acquisition, now - begin);
      reported = now;
    }
    if (arguments.seconds > 0.0 && now - begin >= arguments.seconds) break;
  }
  acquisition.finish();
  if (writer) writer->close();
  const InstrumentState state = acquisition.state();
  const SampleAccount& account = state.account;
  const std::string faults = faultText(state.faults);
  std::printf("%llu samples in %llu blocks, %llu lost, %llu lost by the clock, %llu withheld\nfaults: %s\n",
              static_cast<unsigned long long>(account.delivered),
              static_cast<unsigned long long>(account.blocks), static_cast<unsigned long long>(account.lost),
              static_cast<unsigned long long>(account.estimated_lost),
              static_cast<unsigned long long>(account.withheld), faults.empty() ? "none" : faults.c_str());
  return faults.empty() && account.delivered > 0 ? 0 : DEVICE_FAULT;
}

}  // namespace

Command daqCommand() {
  Command command("daq", "opens an instrument and shows level, clipping and clock of its channels");
  command.description =
      "Opens the device of an instrument file (docs/daq.md) without ROS and prints once a second whether it "
      "measures, its clock against the computer's and the level of each channel; faults on standard error.";
  command.examples = {{"front_end.yaml", "until Ctrl-C"},
                      {"front_end.yaml --seconds 60 --record test.bag", "a minute, recorded"}};
  command.files = {{"RECORD", "the blocks under their topics"}};
  command.exits = {{DEVICE_FAULT, "no samples, or a fault was announced"}};
  command.setBody(run, [](CommandLine& line, Arguments& arguments) {
    line.option("CONFIG", arguments.config, "instrument file (smartmill-instrument/1)").required();
    line.option("--seconds", arguments.seconds,
                "ends after this time [s]; 0: runs until Ctrl-C or the end of the device")
        .notNegative()
        .showDefault();
    line.option("--record", arguments.record, "records the blocks, *.bag or *.mcap");
  });
  return command;
}

}  // namespace smartmill::daq
