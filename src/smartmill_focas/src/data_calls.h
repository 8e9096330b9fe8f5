#pragma once

#include "macro_calls.h"
#include "memory_calls.h"
#include "smartmill_focas/controller_interface.h"

namespace smartmill::focas {

/// Answers the requests of data PDUs from a controller.
class DataCalls {
 public:
  explicit DataCalls(ControllerInterface& controller)
      : controller_(controller),
        info_(controller.sysInfo()),
        memory_(controller, info_),
        macros_(controller) {}
  DataCalls(const DataCalls&) = delete;
  DataCalls& operator=(const DataCalls&) = delete;

  const SysInfo& sysInfo() const { return info_; }
  /// Does not throw: unknown calls return EW_FUNC, malformed arguments EW_LENGTH, EW_NUMBER or EW_ATTRIB.
  SubReply answer(const SubRequest& request);

 private:
  int call(const SubRequest& request, Writer& out);
  bool answerState(const SubRequest& request, Writer& out) const;
  bool answerProgram(const SubRequest& request, Writer& out) const;
  bool answerMachine(const SubRequest& request, Writer& out) const;
  int spindleNames(const SubRequest& request, Writer& out) const;
  int position(const SubRequest& request, Writer& out) const;
  int spindle(const SubRequest& request, Writer& out) const;
  int servo(const SubRequest& request, Writer& out) const;
  int alarmMessages(const SubRequest& request, Writer& out) const;
  void status(const Status& status, Writer& out) const;
  void axisNames(const SubRequest& request, Writer& out) const;
  void units(const SubRequest& request, Writer& out) const;

  ControllerInterface& controller_;
  SysInfo info_;
  MemoryCalls memory_;
  MacroCalls macros_;
};

}  // namespace smartmill::focas
