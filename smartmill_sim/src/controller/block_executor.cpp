#include "controller/block_executor.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/nc/orientation.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

constexpr double MINUTE = 60.0;  // [s]

}  // namespace

BlockExecutor::BlockExecutor(const ControllerOptions& options, const Overrides& overrides,
                             Variables& variables, AxesMotion& axes, SpindleControl& spindle)
    : options_(options), overrides_(overrides), variables_(variables), axes_(axes), spindle_(spindle) {
}

void BlockExecutor::reset() {
  modal_ = NcModal();
  spindle_.setSpeed(0.0);
  variables_.clearLocals();
}

void BlockExecutor::start(double time, const NcBlock& block) {
  modal_.update(block);
  if (block.macro) writeVariable(*block.macro, block.macro_value);
  if (block.tool) selectTool(*block.tool);
  if (block.m_code == 6 && selected_tool_ == 0) throw NcAlarm(PS_ILLEGAL_ADDRESS, "M6 WITHOUT T");
  startSpindle(time, block);
  const bool circle = modal_.motion >= 2 && (block.centre[0] || block.centre[1]);
  if (block.moves() || circle) planPath(block);
  block_ = block;
  running_ = true;
  wait_until_ = time + block.dwell.value_or(0.0);
  if (axes_.hasNext()) beginNextSegment(time);
}

int BlockExecutor::proceed(double now, double time) {
  if (axes_.hasNext()) {
    beginNextSegment(time);
    return -1;
  }
  const int m_code = std::exchange(block_.m_code, std::nullopt).value_or(-1);
  if (m_code >= 0) last_m_ = m_code;
  if (std::exchange(changing_, false)) tool_ = selected_tool_;
  if (m_code == 5 || m_code == 6 || m_code == 30 || m_code == 2) {
    spindle_.stop(time);
  } else if (m_code == 19 || m_code == 119) {
    spindle_.orient(time, m_code == 19 ? 0.0 : readVariable(nc::ORIENT_VARIABLE, now).value_or(-1.0));
  } else {
    running_ = false;
  }
  wait_until_ = spindle_.settleTime();
  if (m_code == 6) {
    changing_ = true;
    wait_until_ = std::max(wait_until_, time) + options_.tool_change_time;
  }
  return m_code;
}

void BlockExecutor::halt(double time) {
  changing_ = false;
  axes_.halt(time);
  spindle_.stop(time);
  running_ = false;
}

void BlockExecutor::hold(double now) {
  if (axes_.moving(now)) axes_.setFeed(now, 0.0);
}

void BlockExecutor::resume(double now, double duration) {
  if (running_ && block_.dwell) wait_until_ += duration;
  updateFeed(now);
}

void BlockExecutor::updateFeed(double now) {
  if (!running_ || !(axes_.moving(now) || axes_.held())) return;
  axes_.setFeed(now, feedOf(axes_.segment()));
  wait_until_ = axes_.end();
}

std::optional<double> BlockExecutor::readVariable(int number, double now) const {
  return variables_.read(number, {axes_.target(), axes_.position(now), workPosition(now)});
}

std::array<double, 3> BlockExecutor::workPosition(double now) const {
  std::array<double, 3> at = axes_.position(now);
  for (std::size_t i = 0; i < 3; ++i) at[i] -= variables_.offsets[modal_.work][i];
  return at;
}

void BlockExecutor::writeVariable(int number, std::optional<double> value) {
  if (!Variables::exists(number)) throw NcAlarm(PS_VARIABLE_NUMBER, "VARIABLE NO. OUT OF RANGE");
  if (!Variables::writable(number)) throw NcAlarm(PS_VARIABLE_READ_ONLY, "WRITE PROTECTED VARIABLE");
  variables_.write(number, value);
}

void BlockExecutor::selectTool(int tool) {
  const std::vector<int>& magazine = options_.magazine;
  if (std::find(magazine.begin(), magazine.end(), tool) == magazine.end())
    throw NcAlarm(PS_ILLEGAL_ADDRESS, "T" + std::to_string(tool) + " IS NOT IN THE MAGAZINE");
  selected_tool_ = tool;
}

void BlockExecutor::startSpindle(double time, const NcBlock& block) {
  if (block.speed) spindle_.setSpeed(units::radPerSecFromRpm(*block.speed));
  const int m_code = block.m_code.value_or(0);
  const bool starts = m_code == 3 || m_code == 4;
  if (starts) {
    spindle_.start(m_code == 3);
    last_m_ = m_code;
  }
  if (block.speed || starts) spindle_.follow(time);
}

void BlockExecutor::planPath(const NcBlock& block) {
  AxesMotion::Path path = pathOf(block, modal_, axes_.target(), variables_.offsets[modal_.work], options_);
  if (!path.front().rapid && modal_.feed <= 0.0) throw NcAlarm(PS_FEED_ZERO, "FEED ZERO (COMMAND)");
  if (!path.front().rapid && modal_.per_turn && spindle_.commanded() == 0.0)
    throw NcAlarm(PS_FEED_ZERO, "FEED PER TURN WITHOUT SPINDLE");
  axes_.setPath(std::move(path));
}

/// Feed [m/s], limited by rapid traverse and the centripetal acceleration of a curve.
double BlockExecutor::feedOf(const AxesMotion::Segment& segment) const {
  if (segment.rapid) return overrides_.rapid(options_.axes.rapid);
  const double feed = modal_.feed * modal_.unit();
  const double programmed =
      modal_.per_turn ? feed * std::abs(spindle_.commanded()) / units::TWO_PI : feed / MINUTE;
  return std::min({overrides_.feed(programmed), options_.axes.rapid,
                   segment.move.curveFeed(options_.axes.acceleration).value_or(options_.axes.rapid)});
}

void BlockExecutor::beginNextSegment(double time) {
  axes_.beginNext();
  axes_.setFeed(time, feedOf(axes_.segment()));
  wait_until_ = axes_.end();
}

}  // namespace smartmill::sim
