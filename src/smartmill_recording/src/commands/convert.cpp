#include <cstdio>
#include <map>
#include <string>

#include "smartmill_recording/commands.h"
#include "smartmill_recording/reading_progress.h"
#include "smartmill_recording/recording_writer.h"

namespace smartmill::recording {
namespace {

const std::map<std::string, RecordingCompression>& compressions() {
  static const std::map<std::string, RecordingCompression> all{{"lz4", RecordingCompression::lz4},
                                                               {"none", RecordingCompression::none},
                                                               {"zstd", RecordingCompression::zstd}};
  return all;
}

struct Arguments {
  std::string from, to, compression = "lz4";
};

void run(const Arguments& arguments) {
  const std::size_t messages = convertRecording(
      arguments.from, arguments.to, compressions().at(arguments.compression), printReadingProgress);
  std::printf("%s: %zu messages\n", arguments.to.c_str(), messages);
}

}  // namespace

Command convertCommand() {
  Command command("convert", "copies a recording to the other format, bag or MCAP");
  command.description =
      "Copies a recording (bag of format 2.0, MCAP file) to a bag or an MCAP file. Messages, times of "
      "reception, definitions and publishers stay.";
  command.examples = {{"session.bag -o session.mcap --compression zstd", "for programs that read MCAP files"},
                      {"session.mcap -o session.bag", "for the tools of ROS 1"}};
  command.files = {{"OUT", "the copy; PATH.active until it is complete"}};
  command.setBody(run, [](CommandLine& line, Arguments& arguments) {
    std::vector<std::string> names;
    for (const auto& [name, compression] : compressions()) names.push_back(name);
    line.option("RECORDING", arguments.from, "bag or MCAP file").required();
    line.option("-o,--out", arguments.to, "file to write, *.bag or *.mcap").required();
    line.option("--compression", arguments.compression, "of the chunks; zstd in MCAP files only")
        .oneOf(names)
        .showDefault();
  });
  return command;
}

}  // namespace smartmill::recording
