#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>

#include "controller/program_runner.h"

namespace smartmill::sim {

/// A DNC session: program text that a client sends while it runs.
class DncSession {
 public:
  /// @param program must outlive the session
  explicit DncSession(ProgramRunner& program) : program_(program) {}

  bool isOpen() const { return open_; }
  void open() {
    open_ = true;
    abort_ = focas::EW_OK;
    program_.begin(0);
  }
  /// The machine stops for a reason, which the client receives.
  void abort(focas::EwCode why) {
    if (std::exchange(open_, false)) abort_ = why;
  }
  /// @return number of bytes taken; data of a closed session is discarded
  std::size_t receive(const char* data, std::size_t size) {
    if (!open_) return size;
    const std::size_t taken = std::min(size, program_.space());
    program_.append({data, taken});
    return taken;
  }
  focas::EwCode close() {
    if (abort_ != focas::EW_OK) return takeAbortCode();
    if (!std::exchange(open_, false)) return focas::EW_FUNC;
    program_.endText();
    return focas::EW_OK;
  }
  /// Why the session ended, once.
  focas::EwCode takeAbortCode() { return std::exchange(abort_, focas::EW_OK); }

 private:
  ProgramRunner& program_;
  bool open_ = false;
  focas::EwCode abort_ = focas::EW_OK;
};

}  // namespace smartmill::sim
