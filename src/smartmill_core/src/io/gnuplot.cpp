#include "smartmill_core/io/gnuplot.h"

#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"

namespace smartmill {
namespace {

/// A temporary script file, removed with its object. gnuplot reads a file instead of a pipe, so that its
/// messages can be read.
class ScriptFile {
 public:
  explicit ScriptFile(const std::string& script)
      : name_((std::filesystem::temp_directory_path() / "smartmill_plot_XXXXXX").string()) {
    const int file = mkstemp(name_.data());
    if (file < 0) throw Error(name_ + ": cannot be written");
    close(file);
    writeText(name_, script);
  }
  ScriptFile(const ScriptFile&) = delete;
  ScriptFile& operator=(const ScriptFile&) = delete;
  ~ScriptFile() { std::remove(name_.c_str()); }
  const std::string& name() const { return name_; }

 private:
  std::string name_;
};

/// The line of gnuplot's output with the message, without carets and the position in the script.
std::string complaint(const std::string& words, const std::string& script) {
  std::istringstream lines(words);
  std::string line, last;
  while (std::getline(lines, line)) {
    if (line.find_first_not_of(" \t^") == std::string::npos) continue;
    last = line;
    if (line.find(script) != std::string::npos) break;
  }
  const std::size_t at = last.find(script);
  if (at != std::string::npos) last = last.substr(std::min(at + script.size() + 2, last.size()));
  return last;
}

}  // namespace

Gnuplot::Gnuplot(std::string png, int width, int height, int font) : png_(std::move(png)) {
  script_.precision(9);
  script_ << "set terminal pngcairo size " << width << "," << height << " font 'sans," << font
          << "' noenhanced\nset output " << quoted(png_) << "\n";
}

void Gnuplot::block(const std::string& name, const std::vector<std::vector<double>>& rows) {
  script_ << "$" << name << " << EOD\n";
  for (const std::vector<double>& row : rows) {
    for (const double value : row) {
      if (std::isfinite(value)) {
        script_ << value << ' ';
      } else {
        script_ << "nan ";
      }
    }
    script_ << '\n';
  }
  script_ << "EOD\n";
}

void Gnuplot::draw() const {
  const ScriptFile script(script_.str());
  FILE* pipe = popen(("exec gnuplot '" + script.name() + "' 2>&1").c_str(), "r");
  if (!pipe) throw Error("gnuplot cannot be started");
  std::string words;
  char part[512];
  for (std::size_t n; (n = std::fread(part, 1, sizeof part, pipe)) > 0;) words.append(part, n);
  const int status = pclose(pipe);
  if (status == 0) return;
  constexpr int NOT_FOUND = 127;  // sh
  if (WIFEXITED(status) && WEXITSTATUS(status) == NOT_FOUND) throw Error("gnuplot cannot be started");
  throw Error(png_ + ": gnuplot: " + complaint(words, script.name()));
}

std::string Gnuplot::quoted(const std::string& text) {
  // In gnuplot's single quotes only the quote itself is special.
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("''") : std::string(1, c);
  return out + "'";
}

}  // namespace smartmill
