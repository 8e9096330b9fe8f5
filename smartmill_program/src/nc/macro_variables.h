#pragma once

#include <array>
#include <map>
#include <optional>
#include <vector>

namespace smartmill::program {

/// Variables of macro programs: #0 is vacant, #1 to #33 are local to a call by G65, #100 to #199 and #500 to
/// #999 are common.
class MacroVariables {
 public:
  static constexpr int LOCALS = 33;
  using Locals = std::array<std::optional<double>, LOCALS + 1>;

  /// nullopt: vacant. @throws Error for a system variable
  std::optional<double> value(int number) const;
  /// @throws Error for #0 and a system variable
  void set(int number, std::optional<double> value);
  /// Begins and ends a call by G65.
  void enter(const Locals& arguments) { locals_.push_back(arguments); }
  void leave() { locals_.pop_back(); }

 private:
  static void check(int number, int least);

  std::vector<Locals> locals_{1};
  std::map<int, double> common_;
};

}  // namespace smartmill::program
