#include "smartmill_focas/recording.h"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <fstream>
#include <ostream>
#include <sstream>

#include "smartmill_focas/describe.h"

namespace smartmill::focas {
namespace {

constexpr const char* FORMAT = "# smartmill-focas-session/1";

int digitOf(char c) {
  if (c >= '0' && c <= '9') {
    return c - '0';
  }
  return c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1;
}

/// Removes the next word from the text and returns it.
std::string_view takeWord(std::string_view& text) {
  constexpr const char* BLANK = " \t\r\v\f";
  text.remove_prefix(std::min(text.find_first_not_of(BLANK), text.size()));
  const std::string_view word = text.substr(0, text.find_first_of(BLANK));
  text.remove_prefix(word.size());
  return word;
}

/// Parses the whole word as a number. @return success
template <class Number>
bool isNumber(std::string_view word, Number* value) {
  const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), *value);
  return code == std::errc() && end == word.data() + word.size();
}

RecordedFrame parseLine(std::string_view line) {
  RecordedFrame recorded;
  const std::string_view time = takeWord(line), connection = takeWord(line), direction = takeWord(line),
                         digits = takeWord(line);
  if (!isNumber(time, &recorded.time) || !isNumber(connection, &recorded.connection) ||
      (direction != ">" && direction != "<") || digits.empty() || digits.size() % 2 != 0 ||
      !takeWord(line).empty()) {
    throw WireError("expected TIME CONNECTION > HEX (or <)");
  }
  recorded.from_client = direction == ">";
  Bytes bytes;
  for (std::size_t i = 0; i < digits.size(); i += 2) {
    const int high = digitOf(digits[i]), low = digitOf(digits[i + 1]);
    if (high < 0 || low < 0) {
      throw WireError("'" + std::string(digits.substr(i, 2)) +
                      "', expected a byte of two hexadecimal digits");
    }
    bytes.push_back(static_cast<std::uint8_t>(16 * high + low));
  }
  FrameReader reader;
  reader.append(bytes.data(), bytes.size());
  std::optional<Frame> frame = reader.next();
  if (!frame || reader.buffered() != 0) {
    throw WireError("expected one complete frame");
  }
  recorded.frame = std::move(*frame);
  return recorded;
}

/// Makes a call and ignores its refusal, but not a lost connection.
template <class Call>
void callIgnoringRefusal(const Call& call) {
  try {
    call();
  } catch (const ConnectionError&) {
    throw;
  } catch (const FocasError&) {
    // The refusal is recorded.
  }
}

Bytes path(const std::string& folder) {
  return Writer().text(folder, 256).data();
}

SubRequest pmcRead(int first, int last, int area) {
  SubRequest request(OP_PMC_READ, first, last, area, 0);
  request.c1 = 2;
  return request;
}

}  // namespace

std::string describe(const RecordedFrame& recorded) {
  char head[48];
  std::snprintf(head, sizeof head, "%9.4f %d %s ", recorded.time, recorded.connection,
                recorded.from_client ? ">" : "<");
  return head + describe(recorded.frame);
}

void beginRecording(std::ostream& out) {
  out << FORMAT << "\n";
}

void append(std::ostream& out, const RecordedFrame& recorded) {
  const Frame& f = recorded.frame;
  out << "# " << describe(recorded) << "\n";
  char head[48];
  std::snprintf(head, sizeof head, "%.6f %d %s ", recorded.time, recorded.connection,
                recorded.from_client ? ">" : "<");
  out << head;
  for (const std::uint8_t byte : encodeFrame(f.type, f.direction, f.body, f.version)) {
    static const char* const DIGITS = "0123456789abcdef";
    out << DIGITS[byte >> 4] << DIGITS[byte & 15];
  }
  out << "\n";
}

std::vector<RecordedFrame> readRecording(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return parseRecording(text.str(), file);
}

std::vector<RecordedFrame> parseRecording(std::string_view text, const std::string& file) {
  std::vector<RecordedFrame> frames;
  for (int number = 1; number == 1 || !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (number == 1) {
      if (line != FORMAT) {
        throw WireError(file + ": expected a file of format smartmill-focas-session/1");
      }
      continue;
    }
    if (line.empty() || line[0] == '#') {
      continue;
    }
    try {
      frames.push_back(parseLine(line));
    } catch (const WireError& e) {
      throw WireError(file + ":" + std::to_string(number) + ": " + e.what());
    }
  }
  return frames;
}

void askEverything(Client& client) {
  callIgnoringRefusal([&] { client.statusInfo(); });
  callIgnoringRefusal([&] {
    client.exchange({SubRequest(OP_STATUS2), SubRequest(OP_HDCK), SubRequest(OP_TMMODE)});
  });
  for (const PositionKind kind :
       {POSITION_MACHINE, POSITION_ABSOLUTE, POSITION_RELATIVE, POSITION_DISTANCE}) {
    callIgnoringRefusal([&] { client.position(kind); });
  }
  callIgnoringRefusal([&] { client.actualFeed(); });
  callIgnoringRefusal([&] { client.actualSpeed(); });
  callIgnoringRefusal([&] { client.actualSpeeds(); });
  callIgnoringRefusal([&] { client.spindleLoad(); });
  callIgnoringRefusal([&] { client.spindleMeter(); });
  callIgnoringRefusal([&] { client.servoMeter(); });
  callIgnoringRefusal([&] { client.exchange({SubRequest(OP_SERVO, 3)}); });
  callIgnoringRefusal([&] { client.readMacro(100); });
  callIgnoringRefusal([&] { client.readMacros(500, 10); });
  callIgnoringRefusal([&] { client.alarmBits(); });
  callIgnoringRefusal([&] { client.alarmMessages(); });
  callIgnoringRefusal([&] {
    int running = 0, main_program = 0;
    client.programNumber(&running, &main_program);
  });
  callIgnoringRefusal([&] { client.sequenceNumber(); });
  callIgnoringRefusal([&] { client.executingBlock(); });
  callIgnoringRefusal([&] {
    client.exchange({SubRequest(OP_MAIN_PROGRAM), SubRequest(OP_EXECUTING_PROGRAM), SubRequest(OP_FOLDER, 1),
                     SubRequest(OP_CLOCK, 0), SubRequest(OP_CLOCK, 1), SubRequest(OP_CNC_ID)});
  });
  callIgnoringRefusal([&] {
    const Bytes folder = path("//CNC_MEM/USER/PATH1/");
    client.exchange({SubRequest(OP_FOLDER_COUNT, 0, 0, 0, 0, folder)});
    client.exchange({SubRequest(OP_FOLDER_LIST, 0, 10, 0, 1, folder)});
  });
  for (const int number : {1020, 1320, 1321, 1420, 3741}) {
    const int axis = number < 3000 ? -1 : 0;
    callIgnoringRefusal([&] { client.exchange({SubRequest(OP_PARAMETER, number, number, axis)}); });
  }
  for (const int number : {300, 308, 410, 445}) {
    const int axis = number < 400 ? -1 : 0;
    callIgnoringRefusal([&] { client.exchange({SubRequest(OP_DIAGNOSIS, number, number, axis)}); });
  }
  for (const int area : {0, 1, 3}) {
    callIgnoringRefusal([&] { client.exchange({pmcRead(0, 49, area)}); });
  }
}

}  // namespace smartmill::focas
