#include <cstdio>
#include <map>
#include <string>
#include <vector>

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
  std::vector<std::string> from;
  std::string to, compression = "lz4";
};

void run(const Arguments& arguments) {
  const ConvertedRecording copy = convertRecording(
      arguments.from, arguments.to, compressions().at(arguments.compression), printReadingProgress);
  for (std::size_t i = 0; i < copy.left_out.size(); ++i) {
    if (copy.left_out[i] > 0)
      std::printf("%s: was cut off: %llu bytes behind its last complete record are left out\n",
                  arguments.from[i].c_str(), static_cast<unsigned long long>(copy.left_out[i]));
  }
  std::printf("%s: %zu messages\n", arguments.to.c_str(), copy.messages);
}

}  // namespace

Command convertCommand() {
  Command command("convert", "copies a recording to the other format, bag or MCAP");
  command.description =
      "Copies a recording (bag of format 2.0, MCAP file) to a bag or an MCAP file. Messages, times of "
      "reception, definitions and publishers stay. Parts of a recording become one file. A recording that "
      "was cut off is copied to its last complete record.";
  command.examples = {{"session.bag -o session.mcap --compression zstd", "for programs that read MCAP files"},
                      {"session.mcap -o session.bag", "for the tools of ROS 1"},
                      {"week.bag week_1.bag week_2.bag -o whole.bag", "the parts of a recording"},
                      {"session.bag.active -o session.bag", "what a killed recorder left"}};
  command.files = {{"OUT", "the copy; PATH.active until it is complete"}};
  command.setBody(run, [](CommandLine& line, Arguments& arguments) {
    std::vector<std::string> names;
    for (const auto& [name, compression] : compressions()) names.push_back(name);
    line.option("RECORDING", arguments.from, "bags or MCAP files, the parts of a recording in their order")
        .required();
    line.option("-o,--out", arguments.to, "file to write, *.bag or *.mcap").required();
    line.option("--compression", arguments.compression, "of the chunks; zstd in MCAP files only")
        .oneOf(names)
        .showDefault();
  });
  return command;
}

}  // namespace smartmill::recording
