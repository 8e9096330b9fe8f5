#include "call_table.h"

#include <exception>

#include "calls.h"

namespace smartmill::focas {
namespace {

constexpr std::uint16_t FIRST_OF_PMC = 0x8000;  // opcodes from here on are requested of the PMC

}  // namespace

void CallTable::add(Opcode opcode, Call call) {
  calls_[opcode] = std::move(call);
}

void CallTable::addReply(Opcode opcode, std::function<void(const SubRequest&, Writer&)> call) {
  add(opcode, [call = std::move(call)](const SubRequest& request, Writer& out) {
    call(request, out);
    return EW_OK;
  });
}

SubReply CallTable::answer(const SubRequest& request) const {
  SubReply reply;
  reply.c1 = request.c1;
  reply.c2 = request.c2;
  reply.c3 = request.c3;
  const auto found = calls_.find(request.c3);
  const int device = request.c3 >= FIRST_OF_PMC ? 2 : 1;
  Writer out;
  int code = EW_FUNC;
  try {
    if (request.c1 != 1 && request.c1 != 2) {
      code = EW_FUNC;
    } else if (request.c2 != 1) {
      code = EW_PATH;
    } else if (found != calls_.end() && request.c1 == device) {
      code = found->second(request, out);
    }
  } catch (const WireError&) {
    code = EW_LENGTH;
  } catch (const std::exception&) {
    code = EW_SYSTEM;
  }
  reply.code = static_cast<std::int16_t>(code);
  if (code == EW_OK) {
    reply.data = out.data();
  }
  return reply;
}

CallTable callsOf(const ControllerInterface& controller, const SysInfo& info) {
  CallTable table;
  addStateCalls(controller.state, info, table);
  addAxesCalls(controller.axes, info, table);
  addMacroCalls(controller.macros, table);
  addDataCalls(controller.data, info, table);
  addProgramCalls(controller.programs, table);
  return table;
}

void putDateTime(const DateTime& at, Writer& out) {
  for (const int part : {at.year, at.month, at.day, at.hour, at.minute, at.second}) {
    out.u16(static_cast<std::uint16_t>(part));
  }
}

}  // namespace smartmill::focas
