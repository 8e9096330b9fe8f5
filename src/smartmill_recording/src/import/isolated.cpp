#include "import/isolated.h"

#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstring>

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "smartmill_core/error.h"

namespace smartmill::recording {
namespace {

constexpr rlim_t LONGEST = 300;  // [s] of processor time
constexpr std::size_t PIECE = 1 << 16;

class Writer {
 public:
  void bytes(const void* data, std::size_t size) { text_.append(static_cast<const char*>(data), size); }
  void number(double value) { bytes(&value, sizeof value); }
  void size(std::size_t value) {
    const auto wide = static_cast<std::uint64_t>(value);
    bytes(&wide, sizeof wide);
  }
  void word(const std::string& word) {
    size(word.size());
    bytes(word.data(), word.size());
  }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

class Reader {
 public:
  Reader(const std::string& text, const std::string& file) : text_(text), file_(file) {}
  void bytes(void* data, std::size_t size) {
    within(size);
    if (size > 0) std::memcpy(data, text_.data() + at_, size);
    at_ += size;
  }
  double number() {
    double value = 0.0;
    bytes(&value, sizeof value);
    return value;
  }
  std::size_t size() {
    std::uint64_t value = 0;
    bytes(&value, sizeof value);
    return static_cast<std::size_t>(value);
  }
  std::string word() {
    std::string word(within(size()), '\0');
    bytes(word.data(), word.size());
    return word;
  }
  std::size_t within(std::size_t size) const {
    if (size > text_.size() - at_) throw Error(file_ + ": the process that reads it ended too early");
    return size;
  }

 private:
  const std::string &text_, &file_;
  std::size_t at_ = 0;
};

void write(const ChannelFile& f, Writer& to) {
  to.word(f.kind);
  to.size(f.channels.size());
  for (const FileChannel& c : f.channels) {
    to.word(c.name);
    to.word(c.unit);
    to.size(c.values.size());
    to.bytes(c.values.data(), c.values.size() * sizeof(double));
  }
  to.size(f.numbers.size());
  for (const auto& [name, value] : f.numbers) {
    to.word(name);
    to.number(value);
  }
  to.size(f.words.size());
  for (const auto& [name, word] : f.words) {
    to.word(name);
    to.word(word);
  }
  to.number(f.sample_rate.value_or(0.0));
  to.word(f.sample_rate_from);
  to.size(f.notes.size());
  for (const std::string& note : f.notes) to.word(note);
}

ChannelFile read(const std::string& file, Reader& from) {
  ChannelFile f;
  f.file = file;
  f.kind = from.word();
  for (std::size_t left = from.size(); left > 0; --left) {
    FileChannel c;
    c.name = from.word();
    c.unit = from.word();
    const std::size_t count = from.size();
    from.within(count * sizeof(double));
    c.values.resize(count);
    from.bytes(c.values.data(), count * sizeof(double));
    f.channels.push_back(std::move(c));
  }
  for (std::size_t left = from.size(); left > 0; --left) {
    const std::string name = from.word();
    f.numbers[name] = from.number();
  }
  for (std::size_t left = from.size(); left > 0; --left) {
    const std::string name = from.word();
    f.words[name] = from.word();
  }
  const double rate = from.number();
  if (rate > 0.0) f.sample_rate = rate;
  f.sample_rate_from = from.word();
  for (std::size_t left = from.size(); left > 0; --left) f.notes.push_back(from.word());
  return f;
}

bool writeAll(int to, const std::string& text) {
  for (std::size_t at = 0; at < text.size();) {
    const ssize_t written = ::write(to, text.data() + at, text.size() - at);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    at += static_cast<std::size_t>(written);
  }
  return true;
}

/// The other process: 'f' and the file, or 'e' and an error.
[[noreturn]] void answer(int to, const std::string& file,
                         const std::function<ChannelFile(const std::string&)>& reader) {
  for (const int signal : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL}) std::signal(signal, SIG_DFL);
  std::signal(SIGPIPE, SIG_IGN);
  const rlimit no_core{0, 0}, time{LONGEST, LONGEST};
  setrlimit(RLIMIT_CORE, &no_core);
  setrlimit(RLIMIT_CPU, &time);
  const int nothing = open("/dev/null", O_WRONLY);
  if (nothing >= 0) dup2(nothing, STDERR_FILENO);
  bool written = false;
  try {
    Writer text;
    text.bytes("f", 1);
    write(reader(file), text);
    written = writeAll(to, text.text());
  } catch (const Error& error) {
    written = writeAll(to, std::string("e") + error.what());
  } catch (...) {  // no memory: the process ends without an answer
  }
  _exit(written ? 0 : 1);
}

}  // namespace

ChannelFile readIsolated(const std::string& file,
                         const std::function<ChannelFile(const std::string&)>& reader) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) throw Error(file + ": cannot be read: no pipe");
  const pid_t child = fork();
  if (child < 0) {
    close(ends[0]);
    close(ends[1]);
    throw Error(file + ": cannot be read: no process");
  }
  if (child == 0) {
    close(ends[0]);
    answer(ends[1], file, reader);
  }
  close(ends[1]);
  std::string text;
  std::string piece(PIECE, '\0');
  for (;;) {
    const ssize_t got = ::read(ends[0], piece.data(), piece.size());
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) break;
    text.append(piece, 0, static_cast<std::size_t>(got));
  }
  close(ends[0]);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  const bool done = WIFEXITED(status) && WEXITSTATUS(status) == 0;
  if (done && !text.empty() && text[0] == 'e') throw Error(text.substr(1));
  if (done && !text.empty()) {
    text.erase(0, 1);
    Reader from(text, file);
    return read(file, from);
  }
  throw Error(file + ": damaged: its library cannot read it");
}

}  // namespace smartmill::recording
