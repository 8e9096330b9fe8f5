#include "smartmill_recording/import/unit.h"

#include <vector>

#include "smartmill_core/units.h"

namespace smartmill::recording {
namespace {

constexpr double STANDARD_GRAVITY = 9.80665;     // [m/s2] BIPM, The International System of Units
constexpr double POUND_FORCE = 4.4482216152605;  // [N] NIST SP 811, appendix B.8
constexpr double INCH = 0.0254;                  // [m] the same

struct Symbol {
  const char* text;
  Unit unit;
};

// The first ones of a quantity are those that messages name.
const std::vector<Symbol>& symbols() {
  static const std::vector<Symbol> all{{"s", {Quantity::time, 1.0}},
                                       {"ms", {Quantity::time, 1e-3}},
                                       {"us", {Quantity::time, 1e-6}},
                                       {"sec", {Quantity::time, 1.0}},
                                       {"seconds", {Quantity::time, 1.0}},
                                       {"N", {Quantity::force, 1.0}},
                                       {"kN", {Quantity::force, 1e3}},
                                       {"mN", {Quantity::force, 1e-3}},
                                       {"daN", {Quantity::force, 10.0}},
                                       {"lbf", {Quantity::force, POUND_FORCE}},
                                       {"newton", {Quantity::force, 1.0}},
                                       {"m/s2", {Quantity::acceleration, 1.0}},
                                       {"g", {Quantity::acceleration, STANDARD_GRAVITY}},
                                       {"mm/s2", {Quantity::acceleration, 1e-3}},
                                       {"mg", {Quantity::acceleration, 1e-3 * STANDARD_GRAVITY}},
                                       {"m/s^2", {Quantity::acceleration, 1.0}},
                                       {"m/s**2", {Quantity::acceleration, 1.0}},
                                       {"m/s/s", {Quantity::acceleration, 1.0}},
                                       {"m s^-2", {Quantity::acceleration, 1.0}},
                                       {"mm/s^2", {Quantity::acceleration, 1e-3}},
                                       {"G", {Quantity::acceleration, STANDARD_GRAVITY}},
                                       {"m_s2", {Quantity::acceleration, 1.0}},
                                       {"m", {Quantity::length, 1.0}},
                                       {"mm", {Quantity::length, units::MM}},
                                       {"um", {Quantity::length, units::UM}},
                                       {"nm", {Quantity::length, 1e-9}},
                                       {"inch", {Quantity::length, INCH}},
                                       {"rad", {Quantity::angle, 1.0}},
                                       {"deg", {Quantity::angle, units::PI / 180.0}},
                                       {"V", {Quantity::voltage, 1.0}},
                                       {"mV", {Quantity::voltage, 1e-3}},
                                       {"Hz", {Quantity::frequency, 1.0}},
                                       {"kHz", {Quantity::frequency, 1e3}},
                                       {"S/s", {Quantity::frequency, 1.0}},
                                       {"full_scale", {Quantity::full_scale, 1.0}}};
  return all;
}

// The micro sign, the Greek mu, a raised 2 and the degree sign, in UTF-8 and in Latin-1.
std::string plain(const std::string& symbol) {
  static const std::vector<std::pair<std::string, std::string>> signs{
      {"\xC2\xB5", "u"}, {"\xCE\xBC", "u"}, {"\xC2\xB2", "2"}, {"\xC2\xB0", "deg"},
      {"\xB5", "u"},     {"\xB2", "2"},     {"\xB0", "deg"}};
  std::string text = symbol;
  for (const auto& [sign, letters] : signs) {
    for (std::size_t at = text.find(sign); at != std::string::npos; at = text.find(sign))
      text.replace(at, sign.size(), letters);
  }
  return text;
}

}  // namespace

std::optional<Unit> unitOf(const std::string& symbol) {
  const std::string text = plain(symbol);
  for (const Symbol& known : symbols()) {
    if (text == known.text) return known.unit;
  }
  return std::nullopt;
}

std::string unitsFor(Quantity quantity) {
  constexpr std::size_t MOST = 5;
  std::vector<std::string> names;
  for (const Symbol& known : symbols()) {
    if (known.unit.quantity == quantity && names.size() < MOST) names.push_back(known.text);
  }
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i)
    text += (i == 0 ? "" : i + 1 < names.size() ? ", " : " or ") + names[i];
  return text;
}

}  // namespace smartmill::recording
