#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace smartmill::exchange {

/// The machine does not provide the value now.
struct Unavailable {
  bool operator==(const Unavailable&) const { return true; }
};

/// Values by key, in the order of the keys' declaration.
using DataSet = std::vector<std::pair<std::string, double>>;

/// One active warning or fault of a condition.
struct Activation {
  bool fault = true;  ///< false: warning
  std::string code;   ///< native code, unique among the activations of an item
  std::string text;   ///< one line
  bool operator==(const Activation& other) const {
    return fault == other.fault && code == other.code && text == other.text;
  }
};
/// All that is active of a condition; empty: normal.
using Activations = std::vector<Activation>;

/// Text of an event, with the type of the asset if it is about one.
struct Text {
  std::string text, asset_type = {};
  bool operator==(const Text& other) const { return text == other.text && asset_type == other.asset_type; }
};

using Value = std::variant<Unavailable, double, Text, DataSet, Activations>;

/// A value of a data item at a time.
struct Observation {
  std::size_t item = 0;  ///< index in catalogue()
  double time = 0.0;     ///< [s] since 1970
  Value value;
};

/// The value of a finite number, otherwise Unavailable.
Value numberOrNone(double value);

/// As all protocols print it: nine significant digits.
std::string numberText(double value);

/// Time in UTC with microseconds, 2026-11-27T13:31:46.123456Z. @param time [s] since 1970, 0 to the year 9999
std::string timeText(double time);

/// One change of a condition, as MTConnect reports it.
struct ConditionChange {
  enum class Level { unavailable, normal, warning, fault } level = Level::unavailable;
  std::string code, text;  ///< a normal with a code clears that activation, one without clears all
};

/// The changes that lead from one value of a condition to the next.
std::vector<ConditionChange> changesOf(const Value& before, const Value& after);

}  // namespace smartmill::exchange
