// Parameters, diagnosis numbers, clock and PMC.
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "calls.h"

namespace smartmill::focas {
namespace {

constexpr std::size_t MAX_AXIS = 32;       // slots of a parameter or diagnosis number
constexpr std::size_t MAX_NUMBERED = 200;  // in one reply: they must fit a frame
constexpr int ALL_AXES = -1;
constexpr int MAX_PMC_BYTES = 60000;

/// The type codes of diagnosis numbers differ from those of parameters: 0 byte, 1 word, 2 double word, 3
/// bits.
int diagnosisType(NumberedType type) {
  switch (type) {
    case NumberedType::bits:
      return 3;
    case NumberedType::byte:
      return 0;
    case NumberedType::word:
      return 1;
    default:
      return 2;
  }
}

/// Each number: i32 number, i16 axis, u16 type, then MAX_AXIS slots of 8 bytes (30i) or 4 (legacy). The value
/// of a single axis is in the first slot.
int numbered(const DataInterface& data, const SysInfo& info, bool parameters, bool legacy,
             const SubRequest& request, Writer& out) {
  const int axis = request.v[2];
  const int axes = static_cast<int>(info.axes.size());
  if (request.v[0] < 0 || request.v[1] < request.v[0]) {
    return EW_NUMBER;
  }
  if (axis < ALL_AXES || axis > axes) {
    return EW_ATTRIB;
  }
  const std::vector<NumberedValue> entries =
      parameters ? data.parameters(request.v[0], request.v[1]) : data.diagnoses(request.v[0], request.v[1]);
  if (entries.empty()) {
    return EW_NUMBER;
  }
  const std::size_t count = std::min(entries.size(), MAX_NUMBERED);
  for (std::size_t i = 0; i < count; ++i) {
    const NumberedValue& entry = entries[i];
    if (count == 1 && entry.of_axis && axis == 0) {
      return EW_ATTRIB;  // a number with one value per axis requires an axis
    }
    std::vector<double> values = entry.values;
    if (entry.of_axis && axis > 0) {
      values = {values.at(static_cast<std::size_t>(axis - 1))};
    }
    out.i32(entry.number).i16(static_cast<std::int16_t>(entry.of_axis ? axis : 0));
    out.u16(
        static_cast<std::uint16_t>(parameters ? static_cast<int>(entry.type) : diagnosisType(entry.type)));
    values.resize(MAX_AXIS, 0.0);
    for (const double value : values) {
      const Value8 coded = Value8::fromDouble(value, entry.type == NumberedType::real ? entry.decimals : 0);
      if (legacy) {
        out.i32(coded.value);
      } else {
        out.value8(coded);
      }
    }
  }
  return EW_OK;
}

int clock(const DataInterface& data, const SubRequest& request, Writer& out) {
  if (request.v[0] != 0 && request.v[0] != 1) {
    return EW_DATA;
  }
  const std::optional<DateTime> now = data.dateTime();
  if (!now) {
    return EW_FUNC;
  }
  putDateTime(*now, out);  // always the date in the first half, the time in the second
  return EW_OK;
}

int setClock(DataInterface& data, const SubRequest& request) {
  std::optional<DateTime> now = data.dateTime();
  if (!now) {
    return EW_FUNC;
  }
  Reader reader(request.extra);
  std::array<int, 6> parts{};
  for (int& part : parts) {
    part = reader.u16();
  }
  if (request.v[0] == 0) {
    now->year = parts[0];
    now->month = parts[1];
    now->day = parts[2];
  } else if (request.v[0] == 1) {
    now->hour = parts[3];
    now->minute = parts[4];
    now->second = parts[5];
  } else {
    return EW_DATA;
  }
  const bool good = now->year >= 1970 && now->year <= 2099 && now->month >= 1 && now->month <= 12 &&
                    now->day >= 1 && now->day <= 31 && now->hour <= 23 && now->minute <= 59 &&
                    now->second <= 59;
  return good ? int{data.setDateTime(*now)} : int{EW_DATA};
}

/// Bytes of an element: byte, word or double word.
int elementOf(const SubRequest& request) {
  return 1 << request.v[3];
}

int pmcFault(const SubRequest& request) {
  const int first = request.v[0], last = request.v[1], area = request.v[2], type = request.v[3];
  if (area < 0 || area > static_cast<int>(PmcArea::d) || type < 0 || type > 2) {
    return EW_ATTRIB;
  }
  if (first < 0 || last < first || last - first >= MAX_PMC_BYTES) {
    return EW_NUMBER;
  }
  return (last - first + 1) % elementOf(request) == 0 ? EW_OK : EW_LENGTH;
}

/// Words and double words are big-endian on the wire and little-endian in the PMC.
Bytes withSwappedElements(Bytes bytes, int element) {
  for (auto at = bytes.begin(); at != bytes.end(); at += element) {
    std::reverse(at, at + element);
  }
  return bytes;
}

int readPmc(const DataInterface& data, const SubRequest& request, Writer& out) {
  if (const int fault = pmcFault(request); fault != EW_OK) {
    return fault;
  }
  Bytes bytes;
  const int code = data.readPmc(static_cast<PmcArea>(request.v[2]), request.v[0], request.v[1], &bytes);
  if (code == EW_OK) {
    out.bytes(withSwappedElements(bytes, elementOf(request)));
  }
  return code;
}

int writePmc(DataInterface& data, const SubRequest& request) {
  if (const int fault = pmcFault(request); fault != EW_OK) {
    return fault;
  }
  const int first = request.v[0], last = request.v[1];
  if (request.extra.size() != static_cast<std::size_t>(last - first + 1)) {
    return EW_LENGTH;
  }
  return data.writePmc(static_cast<PmcArea>(request.v[2]), first,
                       withSwappedElements(request.extra, elementOf(request)));
}

}  // namespace

void addDataCalls(DataInterface& data, const SysInfo& info, CallTable& table) {
  const auto add = [&](Opcode opcode, bool parameters, bool legacy) {
    table.add(opcode, [&data, &info, parameters, legacy](const SubRequest& r, Writer& out) {
      return numbered(data, info, parameters, legacy, r, out);
    });
  };
  add(OP_PARAMETER, true, false);
  // A 31i-B refuses the legacy opcode; clients for the 16i use it on the 30i.
  if (info.cnc_type != "31") {
    add(OP_PARAMETER_LEGACY, true, true);
  }
  add(OP_DIAGNOSIS, false, false);
  add(OP_DIAGNOSIS_LEGACY, false, true);
  table.add(OP_CLOCK, [&](const SubRequest& r, Writer& out) { return clock(data, r, out); });
  table.add(OP_SET_CLOCK, [&](const SubRequest& r, Writer&) { return setClock(data, r); });
  table.add(OP_PMC_READ, [&](const SubRequest& r, Writer& out) { return readPmc(data, r, out); });
  table.add(OP_PMC_WRITE, [&](const SubRequest& r, Writer&) { return writePmc(data, r); });
}

}  // namespace smartmill::focas
