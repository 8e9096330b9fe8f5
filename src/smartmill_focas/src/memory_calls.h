#pragma once

#include <optional>
#include <string>

#include "smartmill_focas/controller_interface.h"

namespace smartmill::focas {

/// Answers requests for stored data of a controller: parameters, diagnosis numbers, clock, PMC, programs.
class MemoryCalls {
 public:
  MemoryCalls(ControllerInterface& controller, const SysInfo& info) : controller_(controller), info_(info) {}

  /// @return EwCode; empty: another opcode. @throws WireError on short arguments.
  std::optional<int> call(const SubRequest& request, Writer& out);

 private:
  std::optional<int> programCall(const SubRequest& request, Writer& out);
  int numbered(const SubRequest& request, bool parameters, bool legacy, Writer& out) const;
  int clock(const SubRequest& request, Writer& out) const;
  int setClock(const SubRequest& request);
  int readPmc(const SubRequest& request, Writer& out) const;
  int writePmc(const SubRequest& request);
  int programList(const SubRequest& request, Writer& out) const;
  int folderCount(const SubRequest& request, Writer& out) const;
  int folderList(const SubRequest& request, Writer& out) const;
  int selectProgram(const SubRequest& request);

  ControllerInterface& controller_;
  const SysInfo& info_;
};

/// O number of a program's name or path ("O1234", "//CNC_MEM/USER/PATH1/O1234", "1234"); empty: no number.
std::optional<int> programNumber(const std::string& name);

}  // namespace smartmill::focas
