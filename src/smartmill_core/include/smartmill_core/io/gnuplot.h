#pragma once

#include <sstream>
#include <string>
#include <vector>

namespace smartmill {

/// One PNG picture drawn by gnuplot: commands are streamed in, data stand inline as named blocks or in files.
class Gnuplot {
 public:
  /// @param size of the picture [pixel]. @param font size [points]; texts are shown as they are (noenhanced).
  Gnuplot(std::string png, int width, int height, int font = 11);

  template <typename T>
  Gnuplot& operator<<(const T& text) {
    script_ << text;
    return *this;
  }

  /// Data block $name: one line a row, what is not finite interrupts a line.
  void block(const std::string& name, const std::vector<std::vector<double>>& rows);

  /// Runs gnuplot. @throws Error "PNG: gnuplot: what it complains of", "gnuplot cannot be started".
  void draw() const;

  /// A text or file name between gnuplot's single quotes.
  static std::string quoted(const std::string& text);

 private:
  std::string png_;
  std::ostringstream script_;
};

}  // namespace smartmill
