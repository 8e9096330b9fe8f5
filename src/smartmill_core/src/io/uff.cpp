#include "smartmill_core/io/uff.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/io/text_file.h"

namespace smartmill {
namespace {

constexpr const char* MARK = "    -1";
constexpr int HEAD_LINES = 11;
constexpr int REAL_SINGLE = 2, REAL_DOUBLE = 4, COMPLEX_SINGLE = 5, COMPLEX_DOUBLE = 6;

std::string trimmed(const std::string& text) {
  const std::size_t first = text.find_first_not_of(" \t\r\n"), last = text.find_last_not_of(" \t\r\n");
  return first == std::string::npos ? "" : text.substr(first, last - first + 1);
}

/// Reads the file's bytes line by line.
class Bytes {
 public:
  explicit Bytes(const std::string& file) : file_(file), text_(readText(file)) {}

  bool done() const { return at_ >= text_.size(); }
  std::string line() {
    if (done()) fail("ends too early");
    std::size_t end = text_.find('\n', at_);
    if (end == std::string::npos) end = text_.size();
    std::string line = text_.substr(at_, end - at_);
    at_ = std::min(text_.size(), end + 1);
    if (!line.empty() && line.back() == '\r') line.pop_back();
    return line;
  }
  const char* take(std::size_t count) {
    if (text_.size() - at_ < count) fail("ends too early");
    at_ += count;
    return text_.data() + at_ - count;
  }
  /// The text up to the next mark, which is skipped.
  std::string untilMark() {
    std::string all;
    while (!done()) {
      const std::string next = line();
      if (trimmed(next) == "-1") return all;
      all += next + "\n";
    }
    fail("the end mark is missing");
  }
  void begin() { ++dataset_; }
  [[noreturn]] void fail(const std::string& what) const {
    throw Error(file_ + ": dataset " + std::to_string(dataset_) + ": " + what);
  }

 private:
  std::string file_, text_;
  std::size_t at_ = 0;
  int dataset_ = 0;
};

/// Numbers of a line; words between them are skipped.
std::vector<double> numbersOf(const std::string& text) {
  std::vector<double> numbers;
  const char* at = text.c_str();
  while (*at) {
    char* end = nullptr;
    const double value = std::strtod(at, &end);
    if (end == at) {
      ++at;
      continue;
    }
    numbers.push_back(value);
    at = end;
  }
  return numbers;
}

int field(const std::string& line, std::size_t from, std::size_t width) {
  return from < line.size() ? std::atoi(line.substr(from, width).c_str()) : 0;
}

struct Head {
  UffFunction function;
  int data_type = 0;
  std::size_t count = 0;
  bool even = true;
  double first = 0.0, step = 0.0;

  bool complex() const { return data_type == COMPLEX_SINGLE || data_type == COMPLEX_DOUBLE; }
  bool isDouble() const { return data_type == REAL_DOUBLE || data_type == COMPLEX_DOUBLE; }
};

Head readHead(Bytes& bytes) {
  Head head;
  std::vector<std::string> lines;
  for (int i = 0; i < HEAD_LINES; ++i) lines.push_back(bytes.line());
  UffFunction& f = head.function;
  f.name = trimmed(lines[0]);
  f.type = field(lines[5], 0, 5);
  f.response_node = field(lines[5], 41, 10);
  f.response_direction = field(lines[5], 51, 4);
  f.reference_node = field(lines[5], 66, 10);
  f.reference_direction = field(lines[5], 76, 4);
  std::replace(lines[6].begin(), lines[6].end(), 'D', 'E');
  const std::vector<double> form = numbersOf(lines[6]);
  if (form.size() < 5) bytes.fail("its seventh line is not a data format");
  if (!(std::abs(form[0]) < 1e6)) bytes.fail("its seventh line has no data type");
  head.data_type = static_cast<int>(form[0]);
  if (head.data_type != REAL_SINGLE && head.data_type != REAL_DOUBLE && !head.complex())
    bytes.fail("data type " + std::to_string(head.data_type) + " is not supported");
  if (!(form[1] >= 1.0 && form[1] < 1e9)) bytes.fail("it states " + std::to_string(form[1]) + " values");
  head.count = static_cast<std::size_t>(form[1]);
  head.even = form[2] != 0.0;
  head.first = form[3];
  head.step = form[4];
  f.numerator = field(lines[8], 0, 10);
  f.denominator = field(lines[9], 0, 10);
  f.unit = lines[8].size() > 47 ? trimmed(lines[8].substr(47)) : "";
  return head;
}

// Values in the order of the file: abscissa if uneven, real part, imaginary part if complex.
void fill(Head& head, const std::vector<double>& numbers, const Bytes& bytes) {
  const std::size_t each = (head.even ? 1u : 2u) + (head.complex() ? 1u : 0u);
  if (numbers.size() < each * head.count)
    bytes.fail(std::to_string(numbers.size()) + " numbers, expected " + std::to_string(each * head.count));
  UffFunction& f = head.function;
  for (std::size_t i = 0; i < head.count; ++i) {
    const double* v = numbers.data() + each * i;
    f.abscissa.push_back(head.even ? head.first + static_cast<double>(i) * head.step : *v++);
    f.value.emplace_back(v[0], head.complex() ? v[1] : 0.0);
    if (!std::isfinite(std::abs(f.value.back())) || !std::isfinite(f.abscissa.back()))
      bytes.fail("value " + std::to_string(i + 1) + " is not finite");
  }
}

template <typename Float>
double fromBytes(const char* from, bool swap) {
  char raw[sizeof(Float)];
  std::memcpy(raw, from, sizeof raw);
  if (swap) std::reverse(raw, raw + sizeof raw);
  Float value;
  std::memcpy(&value, raw, sizeof raw);
  return value;
}

UffFunction readText58(Bytes& bytes) {
  Head head = readHead(bytes);
  std::string text = bytes.untilMark();
  std::replace(text.begin(), text.end(), 'D', 'E');
  fill(head, numbersOf(text), bytes);
  return head.function;
}

UffFunction readBinary58(Bytes& bytes, const std::string& first) {
  // " 58b", byte order (1 little, 2 big), number format (2: IEEE 754), header lines, number of bytes that
  // follow
  const std::vector<double> form = numbersOf(first.substr(std::min(first.size(), first.find('b') + 1)));
  if (form.size() < 4 || form[1] != 2.0) bytes.fail("its first line does not state IEEE numbers");
  Head head = readHead(bytes);
  const std::size_t size = head.isDouble() ? 8 : 4;
  if (!(form[3] >= 0.0 && form[3] < 1e12)) bytes.fail("its first line has no length");
  const auto length = static_cast<std::size_t>(form[3]);
  const char* data = bytes.take(length);
  const bool swap = form[0] == 2.0;
  std::vector<double> numbers;
  // An uneven abscissa has single precision with single values, double precision with double values.
  for (std::size_t at = 0; at + size <= length; at += size)
    numbers.push_back(size == 8 ? fromBytes<double>(data + at, swap) : fromBytes<float>(data + at, swap));
  fill(head, numbers, bytes);
  bytes.untilMark();
  return head.function;
}

std::string headOf(const UffFunction& f, bool even) {
  const bool frequency = f.type != uff::TIME_RESPONSE;
  std::string text = f.name.substr(0, 80) + "\nNONE\nNONE\nNONE\nNONE\n";
  text += formatted("%5d%10d%5d%10d %-10s%10d%4d %-10s%10d%4d\n", f.type, 0, 0, 0, "NONE", f.response_node,
                    f.response_direction, "NONE", f.reference_node, f.reference_direction);
  text +=
      formatted("%10d%10zu%10d%13.5E%13.5E%13.5E\n", frequency ? COMPLEX_DOUBLE : REAL_DOUBLE, f.value.size(),
                even ? 1 : 0, f.abscissa.front(), even ? f.abscissa[1] - f.abscissa[0] : 0.0, 0.0);
  const auto axis = [&text](int kind, const char* label, const std::string& unit) {
    text +=
        formatted("%10d%5d%5d%5d %-20s %-20s\n", kind, 0, 0, 0, label, unit.empty() ? "NONE" : unit.c_str());
  };
  axis(frequency ? uff::FREQUENCY : uff::TIME, frequency ? "Frequency" : "Time", frequency ? "Hz" : "s");
  axis(f.numerator, "NONE", f.unit);
  axis(f.denominator, "NONE", "NONE");
  axis(0, "NONE", "NONE");
  return text;
}

// Whether start and increment in the header reproduce the abscissa.
bool evenlySpaced(const UffFunction& f) {
  if (f.abscissa.size() < 2) return false;
  const double from = std::stod(formatted("%.5E", f.abscissa[0]));
  const double by = std::stod(formatted("%.5E", f.abscissa[1] - f.abscissa[0]));
  for (std::size_t i = 0; i < f.abscissa.size(); ++i) {
    if (std::abs(from + by * static_cast<double>(i) - f.abscissa[i]) > 1e-6 * by) return false;
  }
  return true;
}

}  // namespace

bool isUff(const std::string& file) {
  const std::string text = readText(file).substr(0, 200);
  const std::size_t end = text.find('\n');
  return end != std::string::npos && trimmed(text.substr(0, end)) == "-1";
}

std::vector<UffFunction> readUff(const std::string& file) {
  Bytes bytes(file);
  std::vector<UffFunction> functions;
  while (!bytes.done()) {
    if (trimmed(bytes.line()) != "-1") continue;
    if (bytes.done()) break;
    bytes.begin();
    const std::string first = bytes.line();
    const int number = std::atoi(first.c_str());
    if (number == 58 && first.find('b') != std::string::npos) {
      functions.push_back(readBinary58(bytes, first));
    } else if (number == 58) {
      functions.push_back(readText58(bytes));
    } else {
      bytes.untilMark();
    }
  }
  if (functions.empty()) throw Error(file + ": contains no dataset 58");
  return functions;
}

void writeUff(const std::vector<UffFunction>& functions, const std::string& file, bool binary) {
  std::string text;
  for (const UffFunction& f : functions) {
    if (f.abscissa.size() < 2 || f.abscissa.size() != f.value.size())
      throw Error(file + ": " + f.name + ": expected two values or more, one per abscissa");
    const bool even = evenlySpaced(f), complex = f.type != uff::TIME_RESPONSE;
    std::vector<double> numbers;
    for (std::size_t i = 0; i < f.value.size(); ++i) {
      if (!even) numbers.push_back(f.abscissa[i]);
      numbers.push_back(f.value[i].real());
      if (complex) numbers.push_back(f.value[i].imag());
    }
    text += std::string(MARK) + "\n";
    if (binary) {
      text += formatted("    58b%6d%6d%12d%12zu%6d%6d%12d%12d\n", 1, 2, HEAD_LINES, 8 * numbers.size(), 0, 0,
                        0, 0);
      text += headOf(f, even);
      text.append(reinterpret_cast<const char*>(numbers.data()), 8 * numbers.size());
      text += "\n";
    } else {
      text += "    58\n" + headOf(f, even);
      // An uneven abscissa has 13 columns, values have 20.
      const std::size_t each = (even ? 1u : 2u) + (complex ? 1u : 0u), in_line = even ? 4u : each;
      for (std::size_t i = 0; i < numbers.size(); ++i) {
        text += formatted(!even && i % each == 0 ? "%13.7E" : "%20.11E", numbers[i]);
        if ((i + 1) % in_line == 0 || i + 1 == numbers.size()) text += "\n";
      }
    }
    text += std::string(MARK) + "\n";
  }
  writeText(file, text);
}

}  // namespace smartmill
