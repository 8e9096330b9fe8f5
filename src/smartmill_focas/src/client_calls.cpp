// Calls on the data circuit, by their FOCAS names.
#include <algorithm>
#include <cmath>

#include "client_impl.h"

namespace smartmill::focas {
namespace {

constexpr std::size_t NAME_WIDTH = 4;  // [byte]

std::string name(Reader& reader) {
  std::string text = reader.line(NAME_WIDTH);
  text.erase(std::find_if(text.rbegin(), text.rend(), [](char c) { return c > ' '; }).base(), text.end());
  return text;
}

}  // namespace

Status Client::statusInfo() {
  const std::vector<SubReply> replies =
      exchange({SubRequest(OP_STATUS), SubRequest(OP_HDCK), SubRequest(OP_TMMODE)});
  Status status = impl_->decode("cnc_statinfo", Impl::dataOf("cnc_statinfo", replies[0]),
                                [](Reader& reader) { return decodeStatus(reader); });
  // A controller may refuse the other two.
  if (replies[1].code == EW_OK && replies[1].data.size() >= 2) {
    status.hdck = Reader(replies[1].data).i16();
  }
  if (replies[2].code == EW_OK && replies[2].data.size() >= 2) {
    status.tmmode = Reader(replies[2].data).i16();
  }
  return status;
}

std::vector<double> Client::position(PositionKind kind, int axis) {
  const std::string call = "position of kind " + std::to_string(kind);
  const std::size_t expected = axis == -1 ? impl_->axes() : 1;
  std::vector<double> result =
      impl_->values(call, impl_->request(call, SubRequest(OP_POSITION, kind, axis)), expected);
  if (result.size() != expected) {
    throw FocasError(
        call + ": " + std::to_string(result.size()) + " values, expected " + std::to_string(expected),
        EW_LENGTH);
  }
  return result;
}

double Client::actualFeed() {
  return impl_->values("cnc_actf", impl_->request("cnc_actf", SubRequest(OP_ACTUAL_FEED)), 1).front();
}

double Client::actualSpeed() {
  return impl_->values("cnc_acts", impl_->request("cnc_acts", SubRequest(OP_ACTUAL_SPEED)), 1).front();
}

std::vector<double> Client::actualSpeeds(int spindle) {
  const std::vector<SubReply> replies = exchange(
      {SubRequest(OP_LOCK, 1), SubRequest(OP_SPINDLE, SPINDLE_SPEED, spindle), SubRequest(OP_LOCK, 1)});
  return impl_->values("cnc_acts2", Impl::dataOf("cnc_acts2", replies[1]),
                       spindle == -1 ? impl_->spindles() : 1);
}

std::vector<double> Client::spindleLoad(int spindle) {
  const std::vector<SubReply> replies = exchange(
      {SubRequest(OP_LOCK, 1), SubRequest(OP_SPINDLE, SPINDLE_LOAD, spindle), SubRequest(OP_LOCK, 1)});
  return impl_->values("cnc_rdspload", Impl::dataOf("cnc_rdspload", replies[1]),
                       spindle == -1 ? impl_->spindles() : 1);
}

LoadMeter Client::spindleMeter() {
  const std::string call = "cnc_rdspmeter";
  const std::vector<SubReply> replies =
      exchange({SubRequest(OP_LOCK, 1), SubRequest(OP_SPINDLE_NAMES, -1),
                SubRequest(OP_SPINDLE, SPINDLE_METER_LOAD, -1),
                SubRequest(OP_SPINDLE, SPINDLE_METER_SPEED, -1), SubRequest(OP_LOCK, 1)});
  LoadMeter meter;
  meter.load = impl_->values(call, Impl::dataOf(call, replies[2]), impl_->spindles());
  meter.speed = impl_->values(call, Impl::dataOf(call, replies[3]), impl_->spindles());
  meter.names = decodeNames(replies[1], meter.load.size());
  return meter;
}

LoadMeter Client::servoMeter() {
  const std::string call = "cnc_rdsvmeter";
  const std::vector<SubReply> replies = exchange({SubRequest(OP_LOCK, 2), SubRequest(OP_AXIS_NAMES, 0),
                                                  SubRequest(OP_SERVO, 1), SubRequest(OP_LOCK, 2)});
  LoadMeter meter;
  meter.load = impl_->values(call, Impl::dataOf(call, replies[2]), impl_->axes());
  meter.names = decodeNames(replies[1], meter.load.size());
  for (double& load : meter.load) {
    load = std::abs(load);
  }
  return meter;
}

std::vector<double> Client::diagnosis(int number, int axis) {
  constexpr std::ptrdiff_t HEADER = 8;  // [byte] i32 number, i16 axis, u16 type
  const std::string call = "cnc_diagnoss " + std::to_string(number);
  Bytes data = impl_->request(call, SubRequest(OP_DIAGNOSIS, number, number, axis));
  if (static_cast<std::ptrdiff_t>(data.size()) < HEADER || Reader(data).i32() != number) {
    throw FocasError(call + ": expected this number in the reply", EW_LENGTH);
  }
  data.erase(data.begin(), data.begin() + HEADER);
  return impl_->values(call, data, axis == -1 ? impl_->axes() : 1);
}

std::vector<std::string> Client::axisNames() {
  const SubReply reply = exchange({SubRequest(OP_AXIS_NAMES, 0)}).front();
  Impl::dataOf("axis names", reply);
  return decodeNames(reply, impl_->axes());
}

std::optional<double> Client::readMacro(int number) {
  const std::string call = "cnc_rdmacro " + std::to_string(number);
  const double value =
      impl_->values(call, impl_->request(call, SubRequest(OP_READ_MACRO, number, number)), 1).front();
  return std::isnan(value) ? std::nullopt : std::optional<double>(value);
}

void Client::writeMacro(int number, std::optional<double> value) {
  const Value8 coded = Value8::fromMacro(value);
  impl_->request("cnc_wrmacro " + std::to_string(number),
                 SubRequest(OP_WRITE_MACRO, number, number, 0, 0, Writer().value8(coded).data()));
}

std::vector<double> Client::readMacros(int first, int count) {
  const std::string call = "cnc_rdmacror2 " + std::to_string(first);
  const Bytes data = impl_->request(call, SubRequest(OP_READ_MACRO_DOUBLE, first, count));
  return impl_->decode(call, data, [&](Reader& reader) {
    std::vector<double> values(static_cast<std::size_t>(count));
    for (double& value : values) {
      value = reader.f64();
    }
    return values;
  });
}

void Client::writeMacros(int first, const std::vector<double>& values) {
  Writer extra;
  for (double value : values) {
    extra.f64(value);
  }
  impl_->request("cnc_wrmacror2 " + std::to_string(first),
                 SubRequest(OP_WRITE_MACRO_DOUBLE, first, 0, 0, 0, extra.data()));
}

std::uint32_t Client::alarmBits() {
  return impl_->decode("cnc_alarm", impl_->request("cnc_alarm", SubRequest(OP_ALARM)),
                       [](Reader& reader) { return reader.u32(); });
}

std::vector<AlarmMessage> Client::alarmMessages() {
  constexpr int MOST = 10;
  constexpr int TEXT_WIDTH = 64;
  constexpr std::size_t ENTRY = 16 + TEXT_WIDTH;
  const Bytes data = impl_->request("cnc_rdalmmsg2", SubRequest(OP_ALARM_MESSAGES, -1, MOST, 2, TEXT_WIDTH));
  return impl_->decode("cnc_rdalmmsg2", data, [&](Reader& reader) {
    std::vector<AlarmMessage> alarms;
    while (reader.remaining() >= ENTRY) {
      AlarmMessage alarm;
      alarm.number = reader.i32();
      alarm.type = reader.i32();
      alarm.axis = reader.i32();
      const std::int32_t length = reader.i32();
      alarm.text = reader.line(TEXT_WIDTH);
      alarm.text.resize(std::min(alarm.text.size(), static_cast<std::size_t>(std::max(length, 0))));
      alarms.push_back(std::move(alarm));
    }
    return alarms;
  });
}

void Client::programNumber(int* running, int* main_program) {
  impl_->decode("cnc_rdprgnum", impl_->request("cnc_rdprgnum", SubRequest(OP_PROGRAM_NUMBER)),
                [&](Reader& reader) {
                  *running = reader.i32();
                  *main_program = reader.i32();
                  return 0;
                });
}

int Client::sequenceNumber() {
  return impl_->decode("cnc_rdseqnum", impl_->request("cnc_rdseqnum", SubRequest(OP_SEQUENCE_NUMBER)),
                       [](Reader& reader) { return reader.i32(); });
}

std::string Client::executingBlock() {
  constexpr int MOST = 256;
  return impl_->decode("cnc_rdexecprog",
                       impl_->request("cnc_rdexecprog", SubRequest(OP_EXECUTING_BLOCK, MOST)),
                       [](Reader& reader) {
                         reader.skip(4);
                         return reader.text(reader.remaining());
                       });
}

void Client::reset() {
  impl_->request("cnc_reset", SubRequest(OP_RESET));
}
void Client::cycleStart() {
  impl_->request("cnc_start", SubRequest(OP_START));
}

Status decodeStatus(Reader& reader) {
  Status status;
  status.aut = reader.i16();
  status.run = reader.i16();
  status.motion = reader.i16();
  status.mstb = reader.i16();
  status.emergency = reader.i16();
  status.alarm = reader.i16();
  status.edit = reader.i16();
  return status;
}

std::vector<std::string> decodeNames(const SubReply& reply, std::size_t at_most) {
  std::vector<std::string> names;
  Reader reader(reply.data);
  while (reply.code == EW_OK && names.size() < at_most && reader.remaining() >= NAME_WIDTH) {
    names.push_back(name(reader));
  }
  return names;
}

std::vector<double> decodeValues(const SubReply& reply, std::size_t at_most) {
  std::vector<double> values;
  Reader reader(reply.data);
  while (reply.code == EW_OK && values.size() < at_most && reader.remaining() >= 8) {
    values.push_back(reader.value8().toDouble());
  }
  return values;
}

}  // namespace smartmill::focas
