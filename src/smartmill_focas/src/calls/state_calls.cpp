// Identification, state, alarms and the running program.
#include <algorithm>
#include <cstdint>
#include <string>

#include "calls.h"

namespace smartmill::focas {
namespace {

constexpr std::size_t PATH_WIDTH = 256;    // [byte]
constexpr std::size_t PROGRAM_WIDTH = 36;  // [byte]
constexpr int MAX_BLOCK_TEXT = 4096;       // [byte]
constexpr int MAX_MESSAGE_TEXT = 256;      // [byte]

void putStatus(const Status& s, Writer& out) {
  out.i16(s.aut).i16(s.run).i16(s.motion).i16(s.mstb).i16(s.emergency).i16(s.alarm).i16(s.edit);
}

void putSystemInfo(const SysInfo& info, Writer& out) {
  const std::size_t axes = info.axes.size();
  const std::string count = (axes < 10 ? "0" : "") + std::to_string(axes);
  out.u16(2).u16(32).text(info.cnc_type, 2, ' ').text(info.mt_type, 2, ' ');
  out.text(info.series, 4, ' ').text(info.version, 4, ' ').text(count, 2, ' ');
}

void putAlarmMessages(const StateInterface& state, const SubRequest& request, Writer& out) {
  const std::size_t width = static_cast<std::size_t>(std::clamp(request.v[3], 0, MAX_MESSAGE_TEXT));
  int remaining = request.v[1];
  for (const AlarmMessage& alarm : state.alarmMessages()) {
    if (remaining <= 0) {
      break;
    }
    if (request.v[0] != -1 && request.v[0] != alarm.type) {
      continue;
    }
    --remaining;
    out.i32(alarm.number).i32(alarm.type).i32(alarm.axis);
    out.i32(static_cast<std::int32_t>(std::min(alarm.text.size(), width))).text(alarm.text, width);
  }
}

void putExecutingBlock(const StateInterface& state, const SubRequest& request, Writer& out) {
  const std::string text = state.programText();
  const int max_size = std::clamp(request.v[0], 0, MAX_BLOCK_TEXT);
  out.i32(state.blockCount()).text(text, std::min(text.size(), static_cast<std::size_t>(max_size)));
}

void addProgramState(StateInterface& state, CallTable& table) {
  table.addReply(OP_PROGRAM_NUMBER, [&](const SubRequest&, Writer& out) {
    out.i32(state.runningProgram()).i32(state.mainProgram());
  });
  table.addReply(OP_SEQUENCE_NUMBER,
                 [&](const SubRequest&, Writer& out) { out.i32(state.sequenceNumber()); });
  table.addReply(OP_BLOCK_COUNT, [&](const SubRequest&, Writer& out) { out.i32(state.blockCount()); });
  table.addReply(OP_EXECUTING_PROGRAM, [&](const SubRequest&, Writer& out) {
    const int number = state.runningProgram();
    out.i32(number).text("O" + std::to_string(number), PROGRAM_WIDTH);
  });
  table.addReply(OP_MAIN_PROGRAM,
                 [&](const SubRequest&, Writer& out) { out.text(state.programPath(), PATH_WIDTH); });
  table.addReply(OP_EXECUTING_BLOCK,
                 [&](const SubRequest& request, Writer& out) { putExecutingBlock(state, request, out); });
}

}  // namespace

void addStateCalls(StateInterface& state, const SysInfo& info, CallTable& table) {
  table.addReply(OP_SYSTEM_INFO, [&](const SubRequest&, Writer& out) { putSystemInfo(info, out); });
  table.addReply(OP_CNC_ID, [&](const SubRequest&, Writer& out) {
    for (const std::uint32_t word : info.cnc_id) {
      out.u32(word);
    }
  });
  table.addReply(OP_STATUS, [&](const SubRequest&, Writer& out) { putStatus(state.status(), out); });
  table.addReply(OP_STATUS2, [&](const SubRequest&, Writer& out) {
    // ODBST2 without hdck and tmmode, which have separate requests: the seven values of statinfo, then
    // warning, o3dchk, ext_opt and restart.
    putStatus(state.status(), out);
    out.zeros(8);
  });
  table.addReply(OP_HDCK, [&](const SubRequest&, Writer& out) { out.i16(state.status().hdck); });
  table.addReply(OP_TMMODE, [&](const SubRequest&, Writer& out) { out.i16(state.status().tmmode); });
  table.addReply(OP_OPERATION_MODE, [&](const SubRequest&, Writer& out) { out.i16(state.status().aut); });
  table.addReply(OP_ALARM, [&](const SubRequest&, Writer& out) { out.u32(state.alarmBits()); });
  table.addReply(OP_ALARM_MESSAGES,
                 [&](const SubRequest& request, Writer& out) { putAlarmMessages(state, request, out); });
  table.addReply(OP_DNC_DIAGNOSIS,
                 [](const SubRequest&, Writer& out) { out.i16(0).i16(0).text("", 16).zeros(10); });
  addProgramState(state, table);
}

}  // namespace smartmill::focas
