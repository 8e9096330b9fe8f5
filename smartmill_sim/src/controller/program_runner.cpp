#include "controller/program_runner.h"

#include <algorithm>
#include <utility>

namespace smartmill::sim {
namespace {

constexpr std::size_t TEXT_AHEAD = 4096;  // [byte] of the indicated program text

}  // namespace

void ProgramRunner::begin(int number) {
  executor_.reset();
  indicated_.program = number_ = number;
}

void ProgramRunner::load(const std::string& text) {
  from_memory_ = true;
  append(text);
}

void ProgramRunner::endText() {
  if (buffer_.size() > 0) buffer_.append("\n");
}

std::size_t ProgramRunner::space() const {
  return buffer_size_ - std::min(buffer_size_, buffer_.size());
}

void ProgramRunner::halt(double time) {
  executor_.halt(time);
  held_ = stopped_ = from_memory_ = false;
  indicated_.program = 0;
  buffer_.clear();
  indicated_.block.clear();
}

void ProgramRunner::advance(double now, double end) {
  now_ = time_ = now;
  while (!held_ && !stopped_ && (executor_.running() || takeBlock())) {
    if (!executor_.running()) continue;
    if (executor_.waitUntil() > end) break;
    time_ = std::max(time_, executor_.waitUntil());
    finishWait();
  }
}

void ProgramRunner::hold(double now) {
  if (held_ || !busy()) return;
  held_ = true;
  held_since_ = now;
  executor_.hold(now);
}

bool ProgramRunner::resume(double now) {
  if (!held_) return std::exchange(stopped_, false);
  held_ = false;
  executor_.resume(now, now - held_since_);
  return true;
}

void ProgramRunner::updateFeed(double now) {
  if (!held_) executor_.updateFeed(now);
}

std::string ProgramRunner::text() const {
  const std::string preview = buffer_.preview(TEXT_AHEAD);
  return indicated_.block.empty() ? preview : indicated_.block + "\n" + preview;
}

/// Starts the next block. @return whether there was one
bool ProgramRunner::takeBlock() {
  const std::optional<std::string> line = buffer_.takeLine();
  if (!line) {
    from_memory_ = false;
    if (space() > 0) return false;
    throw NcAlarm(PS_TOO_MANY_DIGITS, "BLOCK LONGER THAN THE BUFFER");
  }
  indicated_.block = *line;
  if (line->empty()) return true;
  const NcBlock block = parseBlock(*line, [this](int number) {
    if (number != Variables::VACANT && !Variables::exists(number))
      throw NcAlarm(PS_VARIABLE_NUMBER, "VARIABLE NO. OUT OF RANGE");
    return executor_.readVariable(number, now_);
  });
  indicated_.program = block.program.value_or(indicated_.program);
  indicated_.sequence = block.sequence.value_or(indicated_.sequence);
  executor_.start(time_, block);
  ++indicated_.blocks;
  return true;
}

/// The wait of the running block is over.
void ProgramRunner::finishWait() {
  const int m_code = executor_.proceed(now_, time_);
  if (!executor_.running()) {
    stopped_ = m_code == 0;
    indicated_.block.clear();
  }
  if (m_code != 30 && m_code != 2) return;
  begin(number_);
  if (std::exchange(from_memory_, false)) buffer_.clear();
}

}  // namespace smartmill::sim
