#pragma once

#include <sstream>
#include <string>
#include <vector>

namespace smartmill {

/// One PNG picture drawn by gnuplot: commands are streamed in, data are inline named blocks or files.
class Gnuplot {
 public:
  /// @param size of the picture [pixel]. @param font size [points]; texts are printed literally (noenhanced).
  Gnuplot(std::string png, int width, int height, int font = 11);

  template <typename T>
  Gnuplot& operator<<(const T& text) {
    script_ << text;
    return *this;
  }

  /// Data block $name: one line per row; a value that is not finite interrupts a line.
  void block(const std::string& name, const std::vector<std::vector<double>>& rows);

  /// Runs gnuplot. @throws Error "PNG: gnuplot: MESSAGE" or "gnuplot cannot be started".
  void draw() const;

  /// A text or file name between gnuplot's single quotes.
  static std::string quoted(const std::string& text);

 private:
  std::string png_;
  std::ostringstream script_;
};

}  // namespace smartmill
