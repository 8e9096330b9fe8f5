// Macro variables.
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "calls.h"

namespace smartmill::focas {
namespace {

constexpr int MAX_MACROS = 1000;  // in one request

int read(const MacroInterface& macros, const SubRequest& request, Writer& out) {
  const int first = request.v[0];
  const std::int64_t count = static_cast<std::int64_t>(request.v[1]) - first + 1;
  if (count < 1 || count > MAX_MACROS) {
    return EW_NUMBER;
  }
  for (int i = 0; i < static_cast<int>(count); ++i) {
    std::optional<double> value;
    const int code = macros.readMacro(first + i, &value);
    if (code != EW_OK) {
      return code;
    }
    out.value8(Value8::fromMacro(value));
  }
  return EW_OK;
}

int write(MacroInterface& macros, const SubRequest& request) {
  Reader reader(request.extra);
  const Value8 value = reader.value8();
  if (value.vacant()) {
    return macros.writeMacro(request.v[0], std::nullopt);
  }
  const double number = value.toDouble();
  return std::isfinite(number) ? macros.writeMacro(request.v[0], number) : EW_DATA;
}

int readDoubles(const MacroInterface& macros, const SubRequest& request, Writer& out) {
  const int count = request.v[1];
  if (count < 1 || count > MAX_MACROS || request.v[0] > std::numeric_limits<std::int32_t>::max() - count) {
    return EW_NUMBER;
  }
  for (int i = 0; i < count; ++i) {
    std::optional<double> value;
    const int code = macros.readMacro(request.v[0] + i, &value);
    if (code != EW_OK) {
      return code;
    }
    out.f64(value.value_or(std::numeric_limits<double>::quiet_NaN()));
  }
  return EW_OK;
}

int writeDoubles(MacroInterface& macros, const SubRequest& request) {
  constexpr std::size_t DOUBLE = 8;  // [byte]
  const int count = static_cast<int>(request.extra.size() / DOUBLE);
  if (request.extra.size() % DOUBLE != 0 || count < 1 || count > MAX_MACROS ||
      request.v[0] > std::numeric_limits<std::int32_t>::max() - count) {
    return EW_LENGTH;
  }
  // All of them or none.
  Reader reader(request.extra);
  std::vector<std::optional<double>> contents;
  for (int i = 0; i < count; ++i) {
    const double value = reader.f64();
    if (std::isinf(value)) {
      return EW_DATA;
    }
    contents.push_back(std::isnan(value) ? std::nullopt : std::optional<double>(value));
    std::optional<double> former;
    const int code = macros.readMacro(request.v[0] + i, &former);
    if (code != EW_OK) {
      return code;
    }
  }
  for (int i = 0; i < count; ++i) {
    const int code = macros.writeMacro(request.v[0] + i, contents[static_cast<std::size_t>(i)]);
    if (code != EW_OK) {
      return code;
    }
  }
  return EW_OK;
}

}  // namespace

void addMacroCalls(MacroInterface& macros, CallTable& table) {
  table.add(OP_READ_MACRO, [&](const SubRequest& r, Writer& out) { return read(macros, r, out); });
  table.add(OP_WRITE_MACRO, [&](const SubRequest& r, Writer&) { return write(macros, r); });
  table.add(OP_READ_MACRO_DOUBLE,
            [&](const SubRequest& r, Writer& out) { return readDoubles(macros, r, out); });
  table.add(OP_WRITE_MACRO_DOUBLE, [&](const SubRequest& r, Writer&) { return writeDoubles(macros, r); });
}

}  // namespace smartmill::focas
