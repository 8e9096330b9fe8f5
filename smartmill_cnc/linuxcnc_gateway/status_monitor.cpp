// Copyright (c) SmartMill developers.
// SPDX-License-Identifier: GPL-2.0-or-later
#include "status_monitor.h"

#include <rcs_print.hh>

#include <algorithm>
#include <array>
#include <utility>

namespace smartmill::cnc::linuxcnc {
namespace {

std::array<double, 3> metres(const EmcPose& pose, double units_per_mm) {
  const double scale = units_per_mm > 0.0 ? 1e-3 / units_per_mm : 1e-3;
  return {pose.tran.x * scale, pose.tran.y * scale, pose.tran.z * scale};
}

}  // namespace

StatusMonitor::StatusMonitor(std::string nml_file, const GatewayOptions& options)
    : nml_file_(std::move(nml_file)), options_(options) {
  set_rcs_print_destination(RCS_PRINT_TO_NULL);
}

void StatusMonitor::attach() {
  const Clock::time_point now = Clock::now();
  if (attached_ != Clock::time_point() &&
      now - attached_ < std::chrono::duration<double>(options_.attach_period)) {
    return;
  }
  attached_ = now;
  channels_ = std::make_unique<NmlChannels>(nml_file_);
  if (!channels_->valid()) {
    channels_.reset();
  }
}

void StatusMonitor::poll() {
  if (!channels_ ||
      (!status_.alive && Clock::now() - attached_ > std::chrono::duration<double>(options_.attach_period))) {
    attach();
  }
  if (!channels_) {
    status_.alive = false;
    return;
  }
  channels_->status.peek();
  const std::uint32_t heartbeat = channels_->stat().motion.heartbeat;
  const bool beats = heartbeat != 0 && heartbeat != status_.heartbeat;
  if (beats) {
    readStatus();
    abortOrphan();
  }
  takeErrors();
  checkLiveness(beats);
  detectProgramEnd();
}

/// A program that already runs at the first contact was started through a gateway that has ended.
void StatusMonitor::abortOrphan() {
  if (status_.alive && !std::exchange(contacted_, true) && status_.busy &&
      status_.mode == MachineStatus::Mode::mdi) {
    EMC_TASK_ABORT message;
    channels_->command.write(&message);
  }
}

void StatusMonitor::checkLiveness(bool beats) {
  const double now = std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
  const Liveness::Verdict verdict = liveness_.update(beats, processes_, now);
  status_.starved = liveness_.starved();
  if (verdict == Liveness::Verdict::lives || !status_.alive) {
    return;
  }
  status_.alive = false;
  program_.reset();
  status_.errors =
      verdict == Liveness::Verdict::ended   ? "its task has stopped: one of its processes has ended"
      : verdict == Liveness::Verdict::hangs ? "its task has stopped: no servo cycles are counted"
                                            : "it waits for a processor of an overloaded computer";
}

void StatusMonitor::readStatus() {
  const EMC_STAT& s = channels_->stat();
  const EMC_TRAJ_STAT& t = s.motion.traj;
  // The first heartbeat may be left from an ended controller; a second one confirms a running one.
  if (!status_.alive && status_.heartbeat != 0) {
    status_.alive = true;
    processes_.find({"milltask", "rtapi_app"});
  }
  status_.heartbeat = s.motion.heartbeat;
  status_.state = static_cast<MachineStatus::State>(s.task.state);
  status_.mode = static_cast<MachineStatus::Mode>(s.task.mode);
  status_.busy = s.task.interpState != EMC_TASK_INTERP_IDLE || s.task.execState != EMC_TASK_EXEC_DONE ||
                 s.status == RCS_EXEC || t.queue > 0;
  status_.held = s.task.task_paused != 0 || t.paused;
  status_.homed = true;
  for (int joint = 0; joint < t.joints; ++joint) {
    status_.homed = status_.homed && s.motion.joint[joint].homed;
  }
  status_.in_position = t.inpos;
  status_.dwell_left = s.task.delayLeft;
  status_.line = s.task.motionLine;
  status_.velocity = t.current_vel * (t.linearUnits > 0.0 ? 1e-3 / t.linearUnits : 1e-3);
  status_.position = metres(t.actualPosition, t.linearUnits);
  status_.distance_to_go = metres(t.dtg, t.linearUnits);
  const std::array<double, 3> g5x = metres(s.task.g5x_offset, t.linearUnits);
  const std::array<double, 3> g92 = metres(s.task.g92_offset, t.linearUnits);
  const std::array<double, 3> tool = metres(s.task.toolOffset, t.linearUnits);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    status_.offset[axis] = g5x[axis] + g92[axis] + tool[axis];
  }
}

/// Each message reaches only one reader: all are stored, up to the length of a frame.
void StatusMonitor::takeErrors() {
  for (NMLTYPE type = channels_->error.read(); type > 0; type = channels_->error.read()) {
    const NMLmsg* message = channels_->error.get_address();
    const char* text = type == EMC_OPERATOR_ERROR_TYPE
                           ? static_cast<const EMC_OPERATOR_ERROR*>(message)->error
                       : type == NML_ERROR_TYPE ? static_cast<const NML_ERROR*>(message)->error
                                                : nullptr;
    // Notes arrive as errors and are ignored.
    if (text && std::string(text).rfind("Note:", 0) != 0 && status_.errors.size() < LONGEST_TEXT / 2) {
      std::string line(text);
      std::replace(line.begin(), line.end(), '\n', ' ');
      status_.errors += (status_.errors.empty() ? "" : "; ") + line;
    }
  }
}

/// A program has ended when the task has been idle for some cycles without an error.
void StatusMonitor::detectProgramEnd() {
  if (!program_ || !status_.alive) {
    return;
  }
  const EMC_STAT& s = channels_->stat();
  const bool taken = s.echo_serial_number - *program_ >= 0;
  if (!taken || status_.busy || !status_.in_position) {
    idle_at_.reset();
  } else if (!idle_at_) {
    idle_at_ = status_.heartbeat;
  } else if (status_.heartbeat - *idle_at_ >= options_.settled) {
    program_.reset();
    if (s.status != RCS_ERROR && status_.errors.empty()) {
      status_.done = status_.running;
    }
  }
}

void StatusMonitor::expectProgram(std::int32_t number) {
  status_.running = number;
  status_.done = 0;
  idle_at_.reset();
}

}  // namespace smartmill::cnc::linuxcnc
