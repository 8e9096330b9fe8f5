#include "smartmill_focas/describe.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

namespace smartmill::focas {
namespace {

constexpr std::size_t MOST_TEXT = 60;    // [byte] of a text, at most
constexpr std::size_t MOST_VALUES = 12;  // of a list, at most

/// Layout of the data of a reply.
enum class Layout { words, longs, values, doubles, names, text, numbered, hexadecimal };

struct Call {
  const char* name;
  Layout layout;
};

const std::map<std::uint16_t, Call>& calls() {
  static const std::map<std::uint16_t, Call> CALLS{
      {OP_START, {"start", Layout::words}},
      {OP_RESET, {"reset", Layout::words}},
      {OP_SEARCH_PROGRAM, {"search", Layout::words}},
      {OP_DELETE_PROGRAM, {"delete", Layout::words}},
      {OP_PROGRAM_LIST, {"rdprogdir", Layout::hexadecimal}},
      {OP_PARAMETER_LEGACY, {"rdparam (legacy)", Layout::hexadecimal}},
      {OP_READ_MACRO, {"rdmacro", Layout::values}},
      {OP_WRITE_MACRO, {"wrmacro", Layout::words}},
      {OP_SYSTEM_INFO, {"sysinfo", Layout::text}},
      {OP_STATUS, {"statinfo", Layout::words}},
      {OP_ALARM, {"alarm", Layout::longs}},
      {OP_PROGRAM_NUMBER, {"rdprgnum", Layout::longs}},
      {OP_SEQUENCE_NUMBER, {"rdseqnum", Layout::longs}},
      {OP_REWIND, {"rewind", Layout::words}},
      {OP_EXECUTING_BLOCK, {"rdexecprog", Layout::text}},
      {OP_ALARM_MESSAGES, {"rdalmmsg2", Layout::text}},
      {OP_ACTUAL_FEED, {"actf", Layout::values}},
      {OP_ACTUAL_SPEED, {"acts", Layout::values}},
      {OP_POSITION, {"position", Layout::values}},
      {OP_DIAGNOSIS_LEGACY, {"diagnoss (legacy)", Layout::hexadecimal}},
      {OP_BLOCK_COUNT, {"rdblkcount", Layout::longs}},
      {OP_DNC_DIAGNOSIS, {"rddncdgndt", Layout::words}},
      {OP_SPINDLE, {"spindle", Layout::values}},
      {OP_CLOCK, {"gettimer", Layout::words}},
      {OP_SET_CLOCK, {"settimer", Layout::words}},
      {OP_SERVO, {"servo", Layout::values}},
      {OP_OPERATION_MODE, {"rdopmode", Layout::words}},
      {OP_UNITS, {"units", Layout::words}},
      {OP_AXIS_NAMES, {"axis names", Layout::names}},
      {OP_SPINDLE_NAMES, {"spindle names", Layout::names}},
      {OP_PARAMETER, {"rdparam", Layout::numbered}},
      {OP_DIAGNOSIS, {"diagnoss", Layout::numbered}},
      {OP_TMMODE, {"tmmode", Layout::words}},
      {OP_DISPLAY_FLAGS, {"display flags", Layout::longs}},
      {OP_LOCK, {"count", Layout::words}},
      {OP_READ_MACRO_DOUBLE, {"rdmacror2", Layout::doubles}},
      {OP_WRITE_MACRO_DOUBLE, {"wrmacror2", Layout::words}},
      {OP_FOLDER, {"pdf_rdcurdir", Layout::text}},
      {OP_FOLDER_LIST, {"rdpdf_alldir", Layout::hexadecimal}},
      {OP_FOLDER_COUNT, {"rdpdf_subdirn", Layout::longs}},
      {OP_MAIN_PROGRAM, {"pdf_rdmain", Layout::text}},
      {OP_SELECT_PROGRAM, {"pdf_slctmain", Layout::words}},
      {OP_EXECUTING_PROGRAM, {"exeprgname", Layout::text}},
      {OP_HDCK, {"hdck", Layout::words}},
      {OP_STATUS2, {"statinfo2", Layout::words}},
      {OP_CNC_ID, {"rdcncid", Layout::longs}},
      {OP_PMC_READ, {"pmc_rdpmcrng", Layout::hexadecimal}},
      {OP_PMC_WRITE, {"pmc_wrpmcrng", Layout::words}},
  };
  return CALLS;
}

std::string number(double value) {
  if (std::isnan(value)) {
    return "vacant";
  }
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

std::string inHex(const std::uint8_t* data, std::size_t size) {
  std::string text;
  char digits[4];
  for (std::size_t i = 0; i < size; ++i) {
    std::snprintf(digits, sizeof digits, "%02x", data[i]);
    text += digits;
  }
  return text;
}

/// Printable characters as they are, line ends as |, runs of zeros as one blank.
std::string inText(const Bytes& data) {
  std::string text;
  for (const std::uint8_t byte : data) {
    if (text.size() >= MOST_TEXT) {
      return text + " ...";
    }
    if (byte == '\n') {
      text += '|';
    } else if (byte >= ' ' && byte < 0x7f) {
      text += static_cast<char>(byte);
    } else if (!text.empty() && text.back() != ' ') {
      text += ' ';
    }
  }
  return text;
}

template <class Next>
std::string listed(std::size_t count, Next next) {
  std::string text;
  for (std::size_t i = 0; i < std::min(count, MOST_VALUES); ++i) {
    text += (i == 0 ? "" : " ") + next();
  }
  return count > MOST_VALUES ? text + " ... (" + std::to_string(count) + ")" : text;
}

std::string contentOf(Layout layout, const Bytes& data) {
  Reader reader(data);
  switch (layout) {
    case Layout::words:
      return listed(data.size() / 2, [&] { return std::to_string(reader.i16()); });
    case Layout::longs:
      return listed(data.size() / 4, [&] { return std::to_string(reader.i32()); });
    case Layout::values:
      return listed(data.size() / 8, [&] { return number(reader.value8().toDouble()); });
    case Layout::doubles:
      return listed(data.size() / 8, [&] { return number(reader.f64()); });
    case Layout::names:
      return listed(data.size() / 4, [&] { return reader.line(4); });
    case Layout::text:
      return "\"" + inText(data) + "\"";
    case Layout::numbered:
      if (data.size() >= 16) {
        const std::string no = std::to_string(reader.i32()), axis = std::to_string(reader.i16());
        reader.skip(2);
        return "no " + no + " axis " + axis + ": " +
               listed((data.size() - 8) / 8, [&] { return number(reader.value8().toDouble()); });
      }
      return inHex(data.data(), data.size());
    case Layout::hexadecimal:
      return std::to_string(data.size()) + " bytes " +
             inHex(data.data(), std::min<std::size_t>(data.size(), 24)) + (data.size() > 24 ? "..." : "");
  }
  return {};
}

std::string nameOf(std::uint16_t opcode) {
  const auto found = calls().find(opcode);
  if (found != calls().end()) {
    return found->second.name;
  }
  char text[16];
  std::snprintf(text, sizeof text, "opcode %x", opcode);
  return text;
}

std::string requestLine(const SubRequest& request) {
  std::size_t used = request.v.size();
  while (used > 0 && request.v[used - 1] == 0) {
    --used;
  }
  std::string text = nameOf(request.c3) + "(";
  for (std::size_t i = 0; i < used; ++i) {
    text += (i == 0 ? "" : ",") + std::to_string(request.v[i]);
  }
  text += ")";
  if (request.c2 != 1) {
    text += " path " + std::to_string(request.c2);
  }
  return request.extra.empty() ? text : text + " +" + std::to_string(request.extra.size()) + " bytes";
}

std::string replyLine(const SubReply& reply) {
  std::string text = nameOf(reply.c3) + " = ";
  if (reply.code != EW_OK) {
    return text + ewName(reply.code) + " (" + std::to_string(reply.code) + "), detail " +
           std::to_string(reply.detail);
  }
  const auto found = calls().find(reply.c3);
  return text +
         (reply.data.empty()
              ? "OK"
              : contentOf(found != calls().end() ? found->second.layout : Layout::hexadecimal, reply.data));
}

template <class Packets, class Line>
std::string joined(const Packets& packets, Line line) {
  std::string text;
  for (const auto& packet : packets) {
    text += (text.empty() ? "" : "; ") + line(packet);
  }
  return text.empty() ? "nothing" : text;
}

std::string typeName(std::uint8_t type) {
  static const std::map<std::uint8_t, const char*> NAMES{{FRAME_OPEN, "open"},
                                                         {FRAME_CLOSE, "close"},
                                                         {FRAME_DOWNLOAD_START, "download start"},
                                                         {FRAME_DOWNLOAD_DATA, "download"},
                                                         {FRAME_DOWNLOAD_END, "download end"},
                                                         {FRAME_UPLOAD_START, "upload start"},
                                                         {FRAME_UPLOAD_DATA, "upload"},
                                                         {FRAME_UPLOAD_END, "upload end"},
                                                         {FRAME_DNC_START, "dnc start"},
                                                         {FRAME_DNC_DATA, "dnc"},
                                                         {FRAME_DNC_END, "dnc end"},
                                                         {FRAME_DNC_CANCEL, "dnc end with result"},
                                                         {FRAME_DATA, "data"}};
  const auto found = NAMES.find(type);
  return found != NAMES.end() ? found->second : "frame type " + std::to_string(type);
}

}  // namespace

std::string describe(const Frame& frame) {
  const std::string type = typeName(frame.type);
  try {
    if (frame.direction == DIR_ERROR) {
      const ErrorBody error = decodeErrorBody(frame.body);
      return type + " refused: " + ewName(error.code) + " (" + std::to_string(error.code) + "), detail " +
             std::to_string(error.detail1);
    }
    if (frame.is(FRAME_DATA, DIR_REQUEST)) {
      return joined(decodeRequests(frame.body), requestLine);
    }
    if (frame.is(FRAME_DATA, DIR_REPLY)) {
      return joined(decodeReplies(frame.body), replyLine);
    }
    if (frame.is(FRAME_OPEN, DIR_REPLY)) {
      const OpenReply reply = decodeOpenReply(frame.body);
      return "opened: version " + std::to_string(frame.version) + ", " + std::to_string(reply.axes) +
             " axes, " + std::to_string(reply.spindles) + " spindles, " + std::to_string(reply.paths) +
             " paths";
    }
    if (frame.is(FRAME_OPEN, DIR_REQUEST) && frame.body.size() >= 2) {
      return "open circuit " + std::to_string(Reader(frame.body).u16());
    }
  } catch (const WireError& e) {
    return type + ": " + e.what();
  }
  if (frame.direction == DIR_STREAM) {
    return type + " " + std::to_string(frame.body.size()) + " bytes \"" + inText(frame.body) + "\"";
  }
  const std::string suffix = frame.direction == DIR_REQUEST ? "" : " answered";
  return type + suffix + (frame.body.empty() ? "" : " (" + std::to_string(frame.body.size()) + " bytes)");
}

}  // namespace smartmill::focas
