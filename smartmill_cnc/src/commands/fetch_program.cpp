#include <cstdio>
#include <string>

#include "smartmill_cnc/commands.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/stop_signal.h"
#include "smartmill_focas/client.h"

namespace {

using namespace smartmill;

constexpr std::size_t LARGE = 100000;  // [byte] from which on progress is displayed

struct Arguments {
  std::string host, file;
  int port = focas::DEFAULT_PORT, number = 0;
  double timeout = 2.0;
};

int run(const Arguments& a) {
  catchStopSignals();
  std::string text;
  int number = a.number;
  try {
    focas::Client client;
    client.connect(a.host, static_cast<std::uint16_t>(a.port), a.timeout);
    if (number == 0) {
      int running = 0;
      client.programNumber(&running, &number);
      if (number == 0) throw Error(a.host + ": no program is selected, expected --number");
    }
    bool shown = false;
    text = client.upload(number, [&](std::size_t size) {
      shown = size >= LARGE;
      if (shown) std::fprintf(stderr, "\r%zu kB", size / 1000);
      return !stopRequested();
    });
    if (shown) std::fprintf(stderr, "\n");
    client.close();
  } catch (const focas::FocasError& error) {
    if (error.code() == focas::EW_DATA)
      throw Error(formatted("%s: O%04d is not in the memory of the controller", a.host.c_str(), number));
    throw Error(error.what());
  }
  if (stopRequested()) {
    std::fprintf(stderr, "interrupted; %s has not been written\n", a.file.c_str());
    return INTERRUPTED;
  }
  writeText(a.file, text);
  std::printf("%s: O%04d, %zu bytes\n", a.file.c_str(), number, text.size());
  return 0;
}

}  // namespace

namespace smartmill::cnc {

Command fetchProgramCommand() {
  Command command("fetch-program", "reads an NC program from the memory of a Fanuc controller");
  command.description =
      "Reads an NC program from the memory of a Fanuc controller (FOCAS2 Ethernet) into a file. Nothing is "
      "written to the controller.";
  command.examples = {{"192.168.1.10 -o part.nc", "the selected program"},
                      {"192.168.1.10 --number 1234 -o part.nc", "O1234"}};
  command.files = {{"OUT", "the program as the controller sends it"}};
  command.exits = {{INTERRUPTED, "interrupted by Ctrl-C; nothing has been written"}};
  command.setBody(run, [](CommandLine& line, Arguments& a) {
    line.option("HOST", a.host, "name or address of the controller").required();
    line.option("-o,--out", a.file, "file to write").required();
    line.option("--number", a.number, "O number (default: the selected program)").within(1, 99999999);
    line.option("--port", a.port, "FOCAS port of the controller").within(1, 65535).showDefault();
    line.option("--timeout", a.timeout, "[s] timeout of connecting and of every reply")
        .positive()
        .showDefault();
  });
  return command;
}

}  // namespace smartmill::cnc
