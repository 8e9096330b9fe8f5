#include "controller/variables.h"

#include "smartmill_core/nc/orientation.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

constexpr int LAST_LOCAL = 33;
constexpr int BLOCK_END = 5001, MACHINE = 5021, WORK = 5041;  // first of three
constexpr int OFFSETS = 5221, OFFSET_STRIDE = 20;

/// Axis of a variable in a group of three; nullopt: not in the group.
std::optional<std::size_t> axisOf(int number, int first) {
  return number >= first && number < first + 3 ? std::optional<std::size_t>(number - first) : std::nullopt;
}

bool isOffset(int number) {
  const int last = OFFSETS + OFFSET_STRIDE * (static_cast<int>(Variables::SYSTEMS) - 1) + 2;
  return number >= OFFSETS && number <= last && (number - OFFSETS) % OFFSET_STRIDE < 3;
}

}  // namespace

bool Variables::exists(int number) {
  return writable(number) || axisOf(number, BLOCK_END) || axisOf(number, MACHINE) || axisOf(number, WORK);
}

bool Variables::writable(int number) {
  return (number >= 1 && number <= LAST_LOCAL) || (number >= 100 && number <= 199) ||
         (number >= 500 && number <= 999) || number == nc::ORIENT_VARIABLE || isOffset(number);
}

std::optional<double> Variables::read(int number, const Positions& positions) const {
  if (isOffset(number)) {
    const int at = number - OFFSETS;
    return offsets[static_cast<std::size_t>(at / OFFSET_STRIDE)]
                  [static_cast<std::size_t>(at % OFFSET_STRIDE)] /
           units::MM;
  }
  for (const auto& [first, point] :
       {std::pair{BLOCK_END, &positions.end}, {MACHINE, &positions.machine}, {WORK, &positions.work}}) {
    if (const std::optional<std::size_t> axis = axisOf(number, first)) return (*point)[*axis] / units::MM;
  }
  const auto found = values_.find(number);
  return found == values_.end() ? std::nullopt : std::optional<double>(found->second);
}

void Variables::write(int number, std::optional<double> value) {
  if (isOffset(number)) {
    const int at = number - OFFSETS;
    offsets[static_cast<std::size_t>(at / OFFSET_STRIDE)][static_cast<std::size_t>(at % OFFSET_STRIDE)] =
        value.value_or(0.0) * units::MM;
  } else if (value) {
    values_[number] = *value;
  } else {
    values_.erase(number);
  }
}

void Variables::clearLocals() {
  values_.erase(values_.begin(), values_.lower_bound(LAST_LOCAL + 1));
}

}  // namespace smartmill::sim
