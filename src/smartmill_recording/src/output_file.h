#pragma once

#include <cstdint>
#include <fstream>
#include <string>

namespace smartmill {

/// A file that has its name only when it is whole; until then PATH.active.
class OutputFile {
 public:
  /// @throws Error when it cannot be created
  explicit OutputFile(std::string path);
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile();

  void write(const std::string& bytes);                            ///< @throws Error
  void rewrite(std::uint64_t position, const std::string& bytes);  ///< @throws Error
  void flush();                                                    ///< to the disk's cache @throws Error
  void close();                                                    ///< @throws Error
  std::uint64_t position() const { return position_; }

 private:
  void check();

  std::string path_, active_;
  std::ofstream stream_;
  std::uint64_t position_ = 0;
  bool closed_ = false;
};

}  // namespace smartmill
