#include "controller/calls/calls.h"

namespace smartmill::sim {
namespace {

/// Variables 1..33, 100..199, 500..999 and 1133, initially vacant; work offsets 5221..5323; read-only
/// positions 5001.., 5021.., 5041.. .
class MacroCalls : public CallsOf<focas::MacroInterface> {
 public:
  using CallsOf::CallsOf;

  focas::EwCode readMacro(int number, std::optional<double>* value) const override {
    if (!Variables::exists(number)) return focas::EW_NUMBER;
    *value = machine_.lock()->variable(number);
    return focas::EW_OK;
  }
  focas::EwCode writeMacro(int number, std::optional<double> value) override {
    if (!Variables::exists(number)) return focas::EW_NUMBER;
    if (!Variables::writable(number)) return focas::EW_PROT;
    machine_.lock()->variables.write(number, value);
    return focas::EW_OK;
  }
};

}  // namespace

std::unique_ptr<focas::MacroInterface> macroCalls(LockedMachine& machine) {
  return std::make_unique<MacroCalls>(machine);
}

}  // namespace smartmill::sim
