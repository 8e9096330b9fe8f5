#include "smartmill_core/program.h"

#include <cstdio>
#include <exception>
#include <filesystem>

#include <CLI/CLI.hpp>

namespace smartmill {

int runProgram(CLI::App& app, int argc, const char* const* argv, const std::function<int()>& run) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  try {
    return run();
  } catch (const std::exception& e) {
    const std::string name = argc > 0 ? std::filesystem::path(argv[0]).filename().string() : "program";
    std::fprintf(stderr, "%s: %s\n", name.c_str(), e.what());
    return 1;
  }
}

}  // namespace smartmill
