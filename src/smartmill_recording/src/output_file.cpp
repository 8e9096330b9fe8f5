#include "output_file.h"

#include <filesystem>
#include <system_error>
#include <utility>

#include "smartmill_core/error.h"

namespace smartmill {

OutputFile::OutputFile(std::string path)
    : path_(std::move(path)),
      active_(path_ + ".active"),
      stream_(active_, std::ios::binary | std::ios::trunc) {
  if (!stream_) throw Error(path_ + ": cannot be written: " + active_ + " cannot be created");
}

OutputFile::~OutputFile() {
  if (closed_) return;
  stream_.close();
  std::error_code ignored;
  std::filesystem::remove(active_, ignored);
}

void OutputFile::check() {
  if (!stream_) throw Error(path_ + ": cannot be written (disk full?)");
}

void OutputFile::write(const std::string& bytes) {
  stream_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  check();
  position_ += bytes.size();
}

void OutputFile::rewrite(std::uint64_t position, const std::string& bytes) {
  stream_.seekp(static_cast<std::streamoff>(position));
  stream_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  stream_.seekp(0, std::ios::end);
  check();
}

void OutputFile::flush() {
  stream_.flush();
  check();
}

void OutputFile::close() {
  stream_.close();
  check();
  std::error_code error;
  std::filesystem::rename(active_, path_, error);
  if (error) throw Error(path_ + ": cannot be written: " + error.message());
  closed_ = true;
}

}  // namespace smartmill
