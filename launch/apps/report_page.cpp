// rosrun smartmill_launch report_page results/summary.md -o results/summary.html

#include <filesystem>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/io/report_page.h"
#include "smartmill_core/io/text_file.h"
#include "smartmill_core/program.h"

int main(int argc, char** argv) {
  std::string file, out;
  smartmill::CommandLine line{"Converts a Markdown report and its pictures to a self-contained HTML file."};
  line.option("report", file, "Markdown file").required().existingFile();
  line.option("-o,--out", out, "HTML file").required();
  return smartmill::runProgram(line, argc, argv, [&] {
    smartmill::ReportPage page(std::filesystem::path(file).stem().string());
    const std::string text = smartmill::readText(file);
    if (text.empty()) throw smartmill::Error(file + ": is empty");
    page.markdown(text, std::filesystem::absolute(file).parent_path().string());
    page.write(out);
    return 0;
  });
}
