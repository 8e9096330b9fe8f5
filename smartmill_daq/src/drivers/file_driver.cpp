// A measurement file at the rate at which it was taken, or a pipe of text lines.
#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <system_error>
#include <thread>

#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_daq/drivers/driver.h"
#include "smartmill_recording/import/channel_file.h"
#include "smartmill_recording/import/unit.h"
#include "smartmill_recording/recording_reader.h"

namespace smartmill::daq {
namespace {

namespace import = smartmill::recording;
using SteadyClock = std::chrono::steady_clock;

constexpr double BATCH = 0.005;  // [s] of samples that come together

/// Index of an input among names, or its number from 1. @throws Error naming the names.
std::size_t indexOf(const Channel& channel, const std::vector<std::string>& names, const std::string& file) {
  const auto named = std::find(names.begin(), names.end(), channel.input);
  if (named != names.end()) return static_cast<std::size_t>(named - names.begin());
  std::size_t number = 0;
  const char* const end = channel.input.data() + channel.input.size();
  const auto [last, code] = std::from_chars(channel.input.data(), end, number);
  if (code == std::errc() && last == end && number >= 1 && number <= names.size()) return number - 1;
  throw Error(file + ": no input '" + channel.input + "', expected one of " + joined(names) +
              ", or its number from 1");
}

/// What a file holds, in the order of the inputs.
struct FileSamples {
  std::vector<double> values;  // interleaved
  struct Piece {
    std::uint64_t first_index;  // [1]
    std::size_t begin, samples;
  };
  std::vector<Piece> pieces;          // without samples missing within
  std::optional<double> sample_rate;  // [Hz]
  bool shares = false;
};

FileSamples samplesOfTable(const import::ChannelFile& file, const std::vector<Channel>& channels) {
  FileSamples result;
  result.sample_rate = file.sample_rate;
  std::vector<std::string> names;
  for (const import::FileChannel& channel : file.channels) {
    names.push_back(channel.name);
    const auto unit = import::unitOf(channel.unit);
    if (!result.sample_rate && unit && unit->quantity == import::Quantity::time && channel.values.size() > 1)
      result.sample_rate = static_cast<double>(channel.values.size() - 1) /
                           ((channel.values.back() - channel.values.front()) * unit->si);
  }
  std::size_t samples = 0;
  std::vector<std::pair<const std::vector<double>*, double>> columns;
  for (const Channel& channel : channels) {
    const import::FileChannel& column = file.channels[indexOf(channel, names, file.file)];
    const auto unit = import::unitOf(column.unit);
    columns.emplace_back(&column.values, unit ? unit->si : 1.0);
    if (columns.size() > 1 && column.values.size() != samples)
      throw Error(file.file + ": channel " + column.name + " has another length than the one before it");
    samples = column.values.size();
  }
  result.values.reserve(samples * columns.size());
  for (std::size_t i = 0; i < samples; ++i) {
    for (const auto& [values, factor] : columns) result.values.push_back((*values)[i] * factor);
  }
  result.pieces = {{0, 0, samples}};
  return result;
}

FileSamples samplesOfRecording(const std::string& path, const std::string& topic,
                               const std::vector<Channel>& channels) {
  FileSamples result;
  std::vector<std::size_t> columns;
  RecordingReader reader(path);
  if (!reader.has(topic)) throw Error(path + ": no topic " + topic);
  reader.on<SampleBlock>(topic, [&](const SampleBlock& block, double) {
    if (columns.empty()) {
      for (const Channel& channel : channels) columns.push_back(indexOf(channel, block.channels, path));
      result.sample_rate = block.sample_rate;
    }
    const std::size_t begin = result.values.size() / columns.size();
    if (result.pieces.empty() ||
        result.pieces.back().first_index + result.pieces.back().samples != block.first_index)
      result.pieces.push_back({block.first_index, begin, 0});
    result.pieces.back().samples += block.size();
    for (std::size_t i = 0; i < block.size(); ++i) {
      for (const std::size_t column : columns) result.values.push_back(block.at(i, column));
    }
  });
  reader.run();
  if (result.pieces.empty()) throw Error(path + ": " + topic + " has no samples");
  return result;
}

/// A file that is played at real-time rate.
class FileDriver : public Driver {
 public:
  FileDriver(const DriverSetup& setup, const std::string& path, const std::string& topic, bool repeat)
      : rate_(setup.instrument.sample_rate),
        inputs_(setup.channels.size()),
        batch_(static_cast<std::size_t>(std::ceil(BATCH * rate_))),
        repeat_(repeat) {
    const import::FileKind kind = import::fileKind(path);
    if (kind == import::FileKind::campaign) throw Error(path + ": a campaign, expected a measurement file");
    const bool recording = kind == import::FileKind::bag || kind == import::FileKind::mcap;
    if (recording && topic.empty()) throw Error("options.topic: missing, expected a topic of " + path);
    if (recording) {
      samples_ = samplesOfRecording(path, topic, setup.channels);
    } else {
      import::ChannelFile file = import::readChannelFile(path);
      import::takeSampleRate(file);
      samples_ = samplesOfTable(file, setup.channels);
      samples_.shares = kind == import::FileKind::sound;
    }
  }

  void open() override {
    begin_ = SteadyClock::now();
    sent_ = piece_ = done_ = 0;
  }
  bool read(RawBatch* batch, double timeout) override {
    if (ended()) return false;
    const FileSamples::Piece& piece = samples_.pieces[piece_];
    const std::size_t samples = std::min(batch_, piece.samples - done_);
    const std::uint64_t index = piece.first_index - samples_.pieces.front().first_index + done_;
    const auto due = begin_ + std::chrono::duration_cast<SteadyClock::duration>(std::chrono::duration<double>(
                                  static_cast<double>(index + samples + sent_) / rate_));
    const auto latest = SteadyClock::now() + std::chrono::duration_cast<SteadyClock::duration>(
                                                 std::chrono::duration<double>(timeout));
    std::this_thread::sleep_until(std::min(due, latest));
    if (due > latest) return false;
    const auto first = samples_.values.begin() + static_cast<std::ptrdiff_t>((piece.begin + done_) * inputs_);
    batch->values.assign(first, first + static_cast<std::ptrdiff_t>(samples * inputs_));
    batch->first_index = sent_ + index;
    batch->sample_rate = samples_.sample_rate;
    done_ += samples;
    if (done_ == piece.samples) {
      ++piece_;
      done_ = 0;
    }
    if (piece_ == samples_.pieces.size() && repeat_) {
      piece_ = 0;
      sent_ += index + samples;
    }
    return true;
  }
  void close() override {}
  bool shareOfRange() const override { return samples_.shares; }
  bool ended() const override { return piece_ == samples_.pieces.size(); }

 private:
  double rate_;
  std::size_t inputs_, batch_;
  bool repeat_;
  FileSamples samples_;
  SteadyClock::time_point begin_;
  std::uint64_t sent_ = 0;  // samples of earlier rounds
  std::size_t piece_ = 0, done_ = 0;
};

/// Lines of numbers as they come, from a named pipe or from standard input ("-").
class PipeDriver : public Driver {
 public:
  PipeDriver(const DriverSetup& setup, std::string path)
      : channels_(setup.channels), path_(std::move(path)) {}
  ~PipeDriver() override { closePipe(); }

  void open() override {
    closePipe();
    descriptor_ =
        path_ == "-" ? ::dup(STDIN_FILENO) : ::open(path_.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (descriptor_ < 0) throw DeviceLost(path_ + ": " + std::generic_category().message(errno));
    text_.clear();
    columns_.clear();
    line_ = 0;
    any_ = false;
  }

  bool read(RawBatch* batch, double timeout) override {
    pollfd wait{descriptor_, POLLIN, 0};
    if (::poll(&wait, 1, static_cast<int>(timeout * 1e3)) <= 0) return false;
    std::array<char, 1U << 16U> buffer;  // NOLINT(cppcoreguidelines-pro-type-member-init): read fills it
    const ssize_t got = ::read(descriptor_, buffer.data(), buffer.size());
    if (got < 0 && (errno == EAGAIN || errno == EINTR)) return false;
    if (got < 0) throw DeviceLost(path_ + ": " + std::generic_category().message(errno));
    if (got == 0) return atEnd();
    any_ = true;
    text_.append(buffer.data(), static_cast<std::size_t>(got));
    if (text_.size() > LONGEST_TEXT) throw MalformedData(path_ + ": a line of more than a megabyte");
    std::size_t begin = 0;
    for (std::size_t end = text_.find('\n'); end != std::string::npos; end = text_.find('\n', begin)) {
      readLine(text_.substr(begin, end - begin), batch);
      begin = end + 1;
    }
    text_.erase(0, begin);
    return !batch->values.empty();
  }
  void close() override { closePipe(); }
  bool ended() const override { return ended_; }

 private:
  static constexpr std::size_t LONGEST_TEXT = 1U << 20U;  // [byte]

  bool atEnd() {
    if (path_ == "-") {
      ended_ = true;
      return false;
    }
    if (any_) throw DeviceLost(path_ + ": its writer has closed it");
    std::this_thread::sleep_for(std::chrono::milliseconds(5));  // a named pipe without a writer yet
    return false;
  }

  void readLine(std::string line, RawBatch* batch) {
    ++line_;
    std::replace_if(
        line.begin(), line.end(), [](char c) { return c == ',' || c == ';' || c == '\t' || c == '\r'; }, ' ');
    std::vector<std::string> cells;
    std::vector<double> numbers;
    for (std::size_t at = line.find_first_not_of(' '); at != std::string::npos;) {
      const std::size_t end = std::min(line.find(' ', at), line.size());
      cells.push_back(line.substr(at, end - at));
      double number = 0.0;
      const auto [last, code] = std::from_chars(line.data() + at, line.data() + end, number);
      if (code == std::errc() && last == line.data() + end) numbers.push_back(number);
      at = line.find_first_not_of(' ', end);
    }
    if (cells.empty()) return;
    const bool names = line_ == 1 && numbers.empty();
    if (numbers.size() != cells.size() && !names)
      throw MalformedData(path_ + ": line " + std::to_string(line_) + ": not a row of numbers");
    if (columns_.empty()) {
      if (!names) {
        for (std::size_t i = 0; i < cells.size(); ++i) cells[i] = std::to_string(i + 1);
      }
      for (const Channel& channel : channels_) columns_.push_back(indexOf(channel, cells, path_));
      width_ = cells.size();
      if (names) return;
    }
    if (numbers.size() != width_)
      throw MalformedData(path_ + ": line " + std::to_string(line_) + ": " + std::to_string(numbers.size()) +
                          " values, " + std::to_string(width_) + " expected");
    for (const std::size_t column : columns_) batch->values.push_back(numbers[column]);
  }

  void closePipe() {
    if (descriptor_ >= 0) ::close(descriptor_);
    descriptor_ = -1;
  }

  std::vector<Channel> channels_;
  std::string path_, text_;
  int descriptor_ = -1;
  std::vector<std::size_t> columns_;
  std::size_t width_ = 0, line_ = 0;
  bool any_ = false, ended_ = false;
};

std::unique_ptr<Driver> make(const DriverSetup& setup) {
  if (!setup.options) throw Error("options: missing, expected the path of a file or pipe");
  const StrictYaml& options = *setup.options;
  std::string path = options.word("path");
  if (path != "-" && path.front() != '/')
    path = (std::filesystem::path(options.file()).parent_path() / path).string();
  const std::string topic = options.has("topic") ? options.word("topic") : "";
  const bool repeat = options.has("repeat") && options.oneOf("repeat", {"true", "false"}) == "true";
  std::error_code failed;
  if (path == "-" || std::filesystem::is_fifo(path, failed)) return std::make_unique<PipeDriver>(setup, path);
  return std::make_unique<FileDriver>(setup, path, topic, repeat);
}

}  // namespace

DriverKind fileDriver() {
  return {"file",
          make,
          {{"path", "measurement file, named pipe, or - for standard input"},
           {"topic", "of a recording, for example daq/dynamometer"},
           {"repeat", "true: the file is played again and again"}}};
}

}  // namespace smartmill::daq
