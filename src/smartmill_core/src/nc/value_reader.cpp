#include "smartmill_core/nc/value_reader.h"

#include <cmath>
#include <cstdlib>
#include <utility>

#include "smartmill_core/nc/syntax_error.h"
#include "smartmill_core/units.h"

namespace smartmill::nc {
namespace {

using Kind = SyntaxError::Kind;

constexpr std::size_t MAX_DIGITS = 12;
constexpr int MAX_DEPTH = 5;  // of brackets, as on a 30i

double degrees(double radians) {
  return radians * 180.0 / units::PI;
}

/// Operand of AND, OR and XOR.
long bits(std::optional<double> value) {
  return std::lround(value.value_or(0.0));
}

struct Function {
  const char* name;
  double (*of)(double);  // not finite: outside of its domain
};
constexpr Function FUNCTIONS[] = {{"TAN", [](double x) { return std::tan(x * units::PI / 180.0); }},
                                  {"ASIN", [](double x) { return degrees(std::asin(x)); }},
                                  {"ACOS", [](double x) { return degrees(std::acos(x)); }},
                                  {"ABS", [](double x) { return std::abs(x); }},
                                  {"ROUND", [](double x) { return std::round(x); }},
                                  {"FIX", [](double x) { return std::trunc(x); }},
                                  {"FUP", [](double x) { return x < 0.0 ? std::floor(x) : std::ceil(x); }},
                                  {"EXP", [](double x) { return std::exp(x); }},
                                  {"LN", [](double x) { return std::log(x); }}};

}  // namespace

ValueReader::ValueReader(Cursor& cursor, const Dialect& dialect, Variables variables)
    : cursor_(cursor),
      expressions_(dialect.expressions),
      macros_(dialect.expressions && dialect.macros),
      variables_(std::move(variables)) {
}

void ValueReader::refuse() const {
  throw SyntaxError(Kind::expression, cursor_.column(), "", "",
                    expressions_ ? "malformed expression" : "malformed block, expected #n=value");
}

std::optional<double> ValueReader::wordValue(const std::string& address, std::size_t column) {
  const char first = cursor_.peek(isSign(cursor_.peek()) ? 1 : 0);
  if (!expressions_ || (first != '#' && first != '[')) return number(address, column);
  const bool minus = isSign(cursor_.peek()) && cursor_.take() == '-';
  const std::optional<double> content = first == '#' ? variable() : std::optional<double>(bracket());
  return content && minus ? std::optional<double>(-*content) : content;
}

std::optional<double> ValueReader::assignedValue(const std::string& address, std::size_t column) {
  return expressions_ ? sum() : number(address, column);
}

double ValueReader::number(const std::string& address, std::size_t column) {
  const std::size_t start = cursor_.position();
  if (isSign(cursor_.peek())) cursor_.take();
  std::size_t digits = 0, points = 0;
  while (isDigit(cursor_.peek()) || cursor_.peek() == '.') ++(cursor_.take() == '.' ? points : digits);
  const std::string written = cursor_.since(start);
  if (digits == 0 || points > 1)
    throw SyntaxError(Kind::number, column, address, written, address + written + ", expected a number");
  if (digits > MAX_DIGITS)
    throw SyntaxError(Kind::digits, column, address, written,
                      address + written + ", expected at most " + std::to_string(MAX_DIGITS) + " digits");
  return std::strtod(written.c_str(), nullptr);
}

std::optional<double> ValueReader::sum() {
  const std::size_t column = cursor_.column();
  std::optional<double> result = product();
  for (;;) {
    if (isSign(cursor_.peek())) {
      const double sign = cursor_.take() == '-' ? -1.0 : 1.0;
      result = result.value_or(0.0) + sign * product().value_or(0.0);
    } else if (macros_ && cursor_.accept("XOR")) {
      result = static_cast<double>(bits(result) ^ bits(product()));
    } else if (macros_ && cursor_.accept("OR")) {
      result = static_cast<double>(bits(result) | bits(product()));
    } else {
      break;
    }
  }
  if (result && !std::isfinite(*result))
    throw SyntaxError(Kind::argument, column, "", "", "the value of the expression is not finite");
  return result;
}

std::optional<double> ValueReader::product() {
  std::optional<double> result = term();
  for (;;) {
    if (macros_ && cursor_.accept("AND")) {
      result = static_cast<double>(bits(result) & bits(term()));
      continue;
    }
    if (macros_ && cursor_.accept("MOD")) {
      const std::size_t column = cursor_.column();
      const double divisor = term().value_or(0.0);
      if (divisor == 0.0) throw SyntaxError(Kind::division, column, "", "", "division by zero");
      result = std::fmod(result.value_or(0.0), divisor);
      continue;
    }
    if (cursor_.peek() != '*' && cursor_.peek() != '/') break;
    const bool division = cursor_.take() == '/';
    const std::size_t column = cursor_.column();
    const double factor = term().value_or(0.0);
    if (division && factor == 0.0) throw SyntaxError(Kind::division, column, "", "", "division by zero");
    result = division ? result.value_or(0.0) / factor : result.value_or(0.0) * factor;
  }
  return result;
}

std::optional<double> ValueReader::term() {
  if (isSign(cursor_.peek())) {
    const double sign = cursor_.take() == '-' ? -1.0 : 1.0;
    if (isSign(cursor_.peek())) refuse();
    return sign * term().value_or(0.0);
  }
  if (cursor_.peek() == '#') return variable();
  if (cursor_.peek() == '[') return bracket();
  if (cursor_.accept("SIN")) return std::sin(bracket() * units::PI / 180.0);
  if (cursor_.accept("COS")) return std::cos(bracket() * units::PI / 180.0);
  if (cursor_.accept("SQRT")) {
    const std::size_t column = cursor_.column();
    const double content = bracket();
    if (content < 0.0) throw SyntaxError(Kind::argument, column, "", "", "square root of a negative number");
    return std::sqrt(content);
  }
  if (macros_) {
    if (const std::optional<double> value = function()) return value;
  }
  if (!isDigit(cursor_.peek()) && cursor_.peek() != '.') refuse();
  return number("#=", cursor_.column());
}

std::optional<double> ValueReader::function() {
  const std::size_t column = cursor_.column();
  if (cursor_.accept("ATAN")) return arcTangent();
  for (const Function& function : FUNCTIONS) {
    if (!cursor_.accept(function.name)) continue;
    const double value = function.of(bracket());
    if (!std::isfinite(value))
      throw SyntaxError(Kind::argument, column, "", "",
                        std::string(function.name) + " of a value outside of its domain");
    return value;
  }
  return std::nullopt;
}

// ATAN[y]/[x] is 0 to 360 degrees, ATAN[y] -90 to 90.
double ValueReader::arcTangent() {
  const double y = bracket();
  if (!cursor_.startsWith("/[")) return degrees(std::atan(y));
  cursor_.take();
  const double angle = degrees(std::atan2(y, bracket()));
  return angle < 0.0 ? angle + 360.0 : angle;
}

// A vacant variable equals another one only, and is 0 for the other comparisons.
bool ValueReader::compare(std::optional<double> left) {
  for (const bool equal : {true, false}) {
    if (!cursor_.accept(equal ? "EQ" : "NE")) continue;
    return (left == sum()) == equal;
  }
  const double a = left.value_or(0.0);
  if (cursor_.accept("GT")) return a > sum().value_or(0.0);
  if (cursor_.accept("GE")) return a >= sum().value_or(0.0);
  if (cursor_.accept("LT")) return a < sum().value_or(0.0);
  if (cursor_.accept("LE")) return a <= sum().value_or(0.0);
  refuse();
}

std::optional<double> ValueReader::variable() {
  const std::size_t column = cursor_.column();
  cursor_.take();
  std::optional<double> index;
  if (cursor_.peek() == '#' || cursor_.peek() == '[') {
    if (++depth_ > MAX_DEPTH) refuse();
    index = cursor_.peek() == '#' ? variable() : std::optional<double>(bracket());
    --depth_;
  } else {
    index = number("#", column);
  }
  if (!index || *index < 0.0 || *index > LARGEST_INTEGER || *index != std::floor(*index)) refuse();
  return variables_ ? variables_(static_cast<int>(*index)) : std::nullopt;
}

double ValueReader::bracket() {
  if (cursor_.take() != '[' || ++depth_ > MAX_DEPTH) refuse();
  const std::optional<double> first = sum();
  const double content = macros_ && cursor_.peek() != ']' ? compare(first) : first.value_or(0.0);
  if (cursor_.take() != ']') refuse();
  --depth_;
  return content;
}

}  // namespace smartmill::nc
