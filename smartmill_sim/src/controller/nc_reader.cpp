#include "controller/nc_reader.h"

#include <cctype>
#include <cmath>
#include <cstdlib>

#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

constexpr std::size_t MAX_DIGITS = 12;
constexpr int MAX_DEPTH = 5;  // of brackets, as on a 30i
constexpr double MAX_WHOLE = 99999999.0;

[[noreturn]] void badFormat() {
  throw NcAlarm(PS_MACRO_FORMAT, "ILLEGAL EXPRESSION FORMAT");
}

}  // namespace

void illegalAddress(const std::string& what) {
  throw NcAlarm(PS_ILLEGAL_ADDRESS, "IMPROPER NC ADDRESS " + what);
}

bool NcReader::accept(const std::string& word) {
  if (text_.compare(position_, word.size(), word) != 0) return false;
  position_ += word.size();
  return true;
}

std::optional<double> NcReader::value(const std::string& address) {
  const std::size_t sign = peek() == '-' || peek() == '+' ? 1 : 0;
  const char first = position_ + sign < text_.size() ? text_[position_ + sign] : '\0';
  if (first != '#' && first != '[') return literal(address);
  const bool minus = sign == 1 && next() == '-';
  const std::optional<double> content = first == '#' ? variable() : std::optional<double>(bracket());
  return content && minus ? std::optional<double>(-*content) : content;
}

std::optional<int> NcReader::integer(const std::string& address) {
  const std::optional<double> content = value(address);
  if (!content) return std::nullopt;
  if (!(*content >= 0.0 && *content <= MAX_WHOLE) || *content != std::floor(*content))
    illegalAddress(address);
  return static_cast<int>(*content);
}

int NcReader::number(const std::string& address) {
  const std::optional<int> content = integer(address);
  if (!content) illegalAddress(address);
  return *content;
}

std::optional<double> NcReader::expression() {
  std::optional<double> sum = product();
  while (peek() == '+' || peek() == '-') {
    const double sign = next() == '-' ? -1.0 : 1.0;
    sum = sum.value_or(0.0) + sign * product().value_or(0.0);
  }
  if (sum && !std::isfinite(*sum)) throw NcAlarm(PS_ILLEGAL_ARGUMENT, "ILLEGAL ARGUMENT");
  return sum;
}

std::optional<double> NcReader::product() {
  std::optional<double> result = term();
  while (peek() == '*' || peek() == '/') {
    const bool division = next() == '/';
    const double factor = term().value_or(0.0);
    if (division && factor == 0.0) throw NcAlarm(PS_DIVIDED_BY_ZERO, "DIVIDED BY ZERO");
    result = division ? result.value_or(0.0) / factor : result.value_or(0.0) * factor;
  }
  return result;
}

std::optional<double> NcReader::term() {
  if (peek() == '-' || peek() == '+') {
    const double sign = next() == '-' ? -1.0 : 1.0;
    if (peek() == '-' || peek() == '+') badFormat();
    return sign * term().value_or(0.0);
  }
  if (peek() == '#') return variable();
  if (peek() == '[') return bracket();
  if (accept("SIN[")) {
    --position_;
    return std::sin(bracket() * units::PI / 180.0);
  }
  if (accept("COS[")) {
    --position_;
    return std::cos(bracket() * units::PI / 180.0);
  }
  if (accept("SQRT[")) {
    --position_;
    const double content = bracket();
    if (content < 0.0) throw NcAlarm(PS_ILLEGAL_ARGUMENT, "ILLEGAL ARGUMENT");
    return std::sqrt(content);
  }
  if (std::isdigit(static_cast<unsigned char>(peek())) == 0 && peek() != '.') badFormat();
  return literal("#=");
}

std::optional<double> NcReader::variable() {
  next();
  std::optional<double> index;
  if (peek() == '#' || peek() == '[') {
    if (++depth_ > MAX_DEPTH) badFormat();
    index = peek() == '#' ? variable() : std::optional<double>(bracket());
    --depth_;
  } else {
    index = literal("#");
  }
  if (!index || *index < 0.0 || *index > MAX_WHOLE || *index != std::floor(*index)) badFormat();
  return variables_ ? variables_(static_cast<int>(*index)) : std::nullopt;
}

double NcReader::bracket() {
  if (next() != '[' || ++depth_ > MAX_DEPTH) badFormat();
  const double content = expression().value_or(0.0);
  if (next() != ']') badFormat();
  --depth_;
  return content;
}

/// Sign, digits, at most one point; no exponent.
double NcReader::literal(const std::string& address) {
  const std::size_t start = position_;
  position_ += !done() && (peek() == '-' || peek() == '+') ? 1 : 0;
  std::size_t digits = 0, points = 0;
  for (; !done(); ++position_) {
    if (std::isdigit(static_cast<unsigned char>(text_[position_])) != 0) {
      ++digits;
    } else if (text_[position_] == '.') {
      ++points;
    } else {
      break;
    }
  }
  const std::string written = text_.substr(start, position_ - start);
  if (digits == 0 || points > 1) illegalAddress(address + written);
  if (digits > MAX_DIGITS) throw NcAlarm(PS_TOO_MANY_DIGITS, "TOO MANY DIGITS " + address);
  return std::strtod(written.c_str(), nullptr);
}

}  // namespace smartmill::sim
