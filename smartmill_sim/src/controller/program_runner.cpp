#include "controller/program_runner.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

constexpr double MINUTE = 60.0;           // [s]
constexpr std::size_t TEXT_AHEAD = 4096;  // [byte] of the indicated program text

}  // namespace

ProgramRunner::ProgramRunner(const ControllerOptions& options, const Overrides& overrides,
                             Variables& variables, AxesMotion& axes, SpindleControl& spindle)
    : options_(options), overrides_(overrides), variables_(variables), axes_(axes), spindle_(spindle) {
}

void ProgramRunner::begin(int number) {
  modal_ = NcModal();
  spindle_.setSpeed(0.0);
  indicated_.program = number_ = number;
  variables_.clearLocals();
}

void ProgramRunner::load(const std::string& text) {
  from_memory_ = true;
  append(text);
}

void ProgramRunner::endText() {
  if (buffer_.size() > 0) buffer_.append("\n");
}

std::size_t ProgramRunner::space() const {
  return options_.buffer_size - std::min(options_.buffer_size, buffer_.size());
}

void ProgramRunner::halt(double time) {
  axes_.halt(time);
  spindle_.stop(time);
  running_ = held_ = stopped_ = from_memory_ = false;
  indicated_.program = 0;
  buffer_.clear();
  indicated_.block.clear();
}

void ProgramRunner::advance(double now, double end) {
  now_ = time_ = now;
  while (!held_ && !stopped_ && (running_ || takeBlock())) {
    if (!running_) continue;
    if (wait_until_ > end) break;
    time_ = std::max(time_, wait_until_);
    continueBlock();
  }
}

void ProgramRunner::hold(double now) {
  if (held_ || !busy()) return;
  held_ = true;
  held_since_ = now;
  if (axes_.moving(now)) axes_.setFeed(now, 0.0);
}

bool ProgramRunner::resume(double now) {
  if (!held_) return std::exchange(stopped_, false);
  held_ = false;
  if (running_ && block_.dwell) wait_until_ += now - held_since_;
  updateFeed(now);
  return true;
}

void ProgramRunner::updateFeed(double now) {
  if (held_ || !running_ || !(axes_.moving(now) || axes_.held())) return;
  axes_.setFeed(now, feedOf(axes_.segment()));
  wait_until_ = axes_.end();
}

std::optional<double> ProgramRunner::readVariable(int number, double now) const {
  return variables_.read(number, {axes_.target(), axes_.position(now), workPosition(now)});
}

std::array<double, 3> ProgramRunner::workPosition(double now) const {
  std::array<double, 3> at = axes_.position(now);
  for (std::size_t i = 0; i < 3; ++i) at[i] -= variables_.offsets[modal_.work][i];
  return at;
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
  start(parseBlock(*line, [this](int number) {
    if (number != Variables::VACANT && !Variables::exists(number))
      throw NcAlarm(PS_VARIABLE_NUMBER, "VARIABLE NO. OUT OF RANGE");
    return readVariable(number, now_);
  }));
  return true;
}

void ProgramRunner::start(const NcBlock& block) {
  indicated_.program = block.program.value_or(indicated_.program);
  indicated_.sequence = block.sequence.value_or(indicated_.sequence);
  modal_.update(block);
  if (block.macro) writeVariable(*block.macro, block.macro_value);
  startSpindle(block);
  const bool circle = modal_.motion >= 2 && (block.centre[0] || block.centre[1]);
  if (block.moves() || circle) planPath(block);
  block_ = block;
  running_ = true;
  ++indicated_.blocks;
  wait_until_ = time_ + block.dwell.value_or(0.0);
  if (axes_.hasNext()) beginNextSegment();
}

void ProgramRunner::writeVariable(int number, std::optional<double> value) {
  if (!Variables::exists(number)) throw NcAlarm(PS_VARIABLE_NUMBER, "VARIABLE NO. OUT OF RANGE");
  if (!Variables::writable(number)) throw NcAlarm(PS_VARIABLE_READ_ONLY, "WRITE PROTECTED VARIABLE");
  variables_.write(number, value);
}

void ProgramRunner::startSpindle(const NcBlock& block) {
  if (block.speed) spindle_.setSpeed(units::radPerSecFromRpm(*block.speed));
  const int m_code = block.m_code.value_or(0);
  const bool starts = m_code == 3 || m_code == 4;
  if (starts) {
    spindle_.start(m_code == 3);
    indicated_.m_code = m_code;
  }
  if (block.speed || starts) spindle_.follow(time_);
}

void ProgramRunner::planPath(const NcBlock& block) {
  AxesMotion::Path path =
      pathOf(block, modal_, axes_.target(), variables_.offsets[modal_.work], options_.axes);
  if (!path.front().rapid && modal_.feed <= 0.0) throw NcAlarm(PS_FEED_ZERO, "FEED ZERO (COMMAND)");
  if (!path.front().rapid && modal_.per_turn && spindle_.commanded() == 0.0)
    throw NcAlarm(PS_FEED_ZERO, "FEED PER TURN WITHOUT SPINDLE");
  axes_.setPath(std::move(path));
}

/// Feed [m/s], limited by rapid traverse and the centripetal acceleration of a curve.
double ProgramRunner::feedOf(const AxesMotion::Segment& segment) const {
  const MachineAxes& axes = options_.axes;
  if (segment.rapid) return overrides_.rapid(axes.rapid);
  const double feed = modal_.feed * modal_.unit();
  const double programmed =
      modal_.per_turn ? feed * std::abs(spindle_.commanded()) / units::TWO_PI : feed / MINUTE;
  return std::min({overrides_.feed(programmed), axes.rapid,
                   segment.move.curveFeed(axes.acceleration).value_or(axes.rapid)});
}

void ProgramRunner::beginNextSegment() {
  axes_.beginNext();
  axes_.setFeed(time_, feedOf(axes_.segment()));
  wait_until_ = axes_.end();
}

/// The wait of the block is over: its next segment, its M word after the motion, or its end.
void ProgramRunner::continueBlock() {
  if (axes_.hasNext()) return beginNextSegment();
  const int m_code = block_.m_code.value_or(-1);
  block_.m_code.reset();
  if (m_code >= 0) indicated_.m_code = m_code;
  const bool ends = m_code == 30 || m_code == 2;
  if (m_code == 5 || ends) {
    spindle_.stop(time_);
  } else if (m_code == 19 || m_code == 119) {
    spindle_.orient(time_, m_code == 19 ? 0.0 : readVariable(Variables::ORIENT, now_).value_or(-1.0));
  } else {
    running_ = false;
    stopped_ = m_code == 0;
    indicated_.block.clear();
  }
  if (ends) {
    begin(number_);
    if (std::exchange(from_memory_, false)) buffer_.clear();
  }
  wait_until_ = spindle_.settleTime();
}

}  // namespace smartmill::sim
