#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_recording/commands.h"
#include "smartmill_recording/export/exported_stream.h"
#include "smartmill_recording/reading_progress.h"
#include "smartmill_recording/recording_file.h"

namespace smartmill::recording {
namespace {

struct Arguments {
  std::string from, to;
  ExportSelection selection;
};

using Writer = std::function<void(const std::vector<ExportedStream>&, const std::string&)>;

/// By the extension of the file to write; without one a folder of CSV files.
Writer writerOf(const std::string& file) {
  static const std::map<std::string, Writer> writers{{".mat", writeMatFile},   {".h5", writeHdf5File},
                                                     {".hdf5", writeHdf5File}, {".uff", writeUffFile},
                                                     {".unv", writeUffFile},   {"", writeCsvFolder}};
  const auto found = writers.find(std::filesystem::path(file).extension().string());
  if (found == writers.end())
    throw Error(file + ": expected *.mat, *.h5, *.hdf5, *.uff, *.unv or a folder without an extension (CSV)");
  return found->second;
}

void run(const Arguments& arguments) {
  const Writer write = writerOf(arguments.to);
  if (!(arguments.selection.from < arguments.selection.to)) throw Error("--to: expected a time above --from");
  const std::vector<ExportedStream> streams =
      isRecording(arguments.from)
          ? streamsOfRecording(arguments.from, arguments.selection, printReadingProgress)
          : streamsOfCampaign(arguments.from, arguments.selection);
  write(streams, arguments.to);
  for (const ExportedStream& stream : streams)
    std::printf("%s: %zu samples of %zu channels\n", stream.name.c_str(), stream.size(),
                stream.columns.size() - 1);
}

}  // namespace

Command exportCommand() {
  Command command("export", "samples of a recording or campaign as MATLAB, HDF5, universal or CSV files");
  command.description =
      "Writes the sampled topics of a recording (sample blocks, forces, spindle angle, load, axis positions) "
      "or "
      "the records of a campaign to a file of another program. Values are in SI, each with its unit; times "
      "count "
      "from the first sample. Lost samples are a jump of the time, nothing is filled in.";
  command.examples = {
      {"session.bag -o session.mat", "a struct for each topic, with time, channels and units"},
      {"session.bag -o forces.h5 --name force/compensated --from 60 --to 90", "thirty seconds of one topic"},
      {"CAMPAIGN -o tables", "a folder with a CSV file for each test"}};
  command.files = {
      {"OUT", "*.mat (version 5), *.h5, *.uff (dataset 58b); without an extension a folder of CSV"}};
  command.setBody(run, [](CommandLine& line, Arguments& arguments) {
    line.option("INPUT", arguments.from, "bag, MCAP file or folder of a campaign").required();
    line.option("-o,--out", arguments.to, "file or folder to write").required();
    line.option("--name", arguments.selection.names,
                "topic relative to /smartmill, or test of the campaign; repeated for more; all by default");
    line.option("--from", arguments.selection.from, "[s] since the first sample").showDefault();
    line.option("--to", arguments.selection.to, "[s] since the first sample");
  });
  return command;
}

}  // namespace smartmill::recording
