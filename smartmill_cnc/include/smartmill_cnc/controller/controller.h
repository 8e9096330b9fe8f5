#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "smartmill_cnc/motion/nc_program.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::cnc {

/// Why a controller did not do what was asked of it.
struct Failure {
  enum class Kind {
    lost,        ///< the connection is gone; only connect() helps
    alarm,       ///< alarm or emergency stop
    wrong_mode,  ///< its panel does not let programs in from outside
    not_yet,     ///< busy or not ready: the same may be taken a moment later
    refused      ///< anything else that it does not do
  };
  Kind kind = Kind::refused;
  std::string message;  ///< one line
};

/// Done, or why not.
class [[nodiscard]] Status {
 public:
  Status() = default;
  Status(Failure failure) : failure_(std::move(failure)) {}
  explicit operator bool() const { return !failure_; }
  const Failure& failure() const { return *failure_; }  ///< only of what is not done
  bool lost() const { return failure_ && failure_->kind == Failure::Kind::lost; }

 private:
  std::optional<Failure> failure_;
};

/// A value, or why there is none.
template <class Value>
class [[nodiscard]] Result {
 public:
  Result(Value value) : content_(std::move(value)) {}
  Result(Failure failure) : content_(std::move(failure)) {}
  explicit operator bool() const { return content_.index() == 0; }
  const Value& operator*() const { return std::get<0>(content_); }
  const Value* operator->() const { return &std::get<0>(content_); }
  const Failure& failure() const { return std::get<1>(content_); }  ///< only without a value

 private:
  std::variant<Value, Failure> content_;
};

/// An alarm as the controller shows it.
struct ControllerAlarm {
  int number = 0;
  int type = 0;  ///< the controller's own kind of alarm
  int axis = 0;  ///< 1-based, 0: none
  std::string text;
};

inline bool operator==(const ControllerAlarm& a, const ControllerAlarm& b) {
  return a.number == b.number && a.type == b.type && a.axis == b.axis && a.text == b.text;
}

/// What a controller tells at one moment.
struct Reading {
  CncState state;                  ///< stamp, connected and armed are the bridge's to fill in
  std::optional<LoadSample> load;  ///< stamp as well; nothing when the controller does not tell loads
  std::vector<ControllerAlarm> alarms;
  std::vector<double> absolute;  ///< [m] positions in workpiece coordinates, order of state.axes
  double increment = 1e-6;       ///< [m] of its positions
  bool at_rest = true;           ///< neither axes move nor a dwell runs
  bool program_done = false;     ///< every block of the program begun last has been executed
};

/// Factors on what a program says.
struct Overrides {
  double feed = 1.0, spindle = 1.0;  ///< [1]
};

/// How much of a program is with the controller.
struct Transfer {
  std::size_t sent = 0, total = 0;  ///< [byte]
  bool complete = false;            ///< nothing waits on this side any more
};

/// A machine's controller as the bridge needs it, whatever wire leads there: its state, its variables, and
/// one program at a time. Nothing throws where an error is to be expected, nothing waits longer than the
/// reply timeout that the implementation was made with. One thread drives it.
class Controller {
 public:
  virtual ~Controller() = default;

  /// Of log lines, for example "controller 127.0.0.1:8193".
  virtual std::string name() const = 0;

  /// @return what the controller says of itself.
  virtual Result<std::string> connect() = 0;
  virtual bool connected() const = 0;
  /// Takes leave.
  virtual void close() = 0;

  /// Every failure of it is Failure::Kind::lost: without its state a machine cannot be driven.
  virtual Result<Reading> read() = 0;

  /// Writes a variable of the controller's programs.
  virtual Status setVariable(int number, double value) = 0;

  /// What the controller's dialect asks of a program; the increment is the one of the last reading.
  virtual DialectOptions dialect() const = 0;
  /// A program that turns the spindle to an angle of tooth 1 [rad] and holds it there.
  virtual std::string orientProgram(double angle) const = 0;

  /// Makes the controller ready to take programs; it stays so until closePrograms() or abort().
  virtual Status openPrograms() = 0;
  virtual bool programsOpen() const = 0;
  /// Whether it still takes programs. After a failure it does not.
  virtual Status checkPrograms() = 0;
  /// Ends this properly.
  virtual Status closePrograms() = 0;
  /// Ends this at once; what the controller has not executed yet it forgets.
  virtual Status abandonPrograms() = 0;

  /// Takes a program that checkProgram() has passed; nothing of it moves before send().
  virtual void begin(const std::string& program) = 0;
  /// Hands over what the controller takes now of the program begun last.
  virtual Status send() = 0;
  virtual Transfer transfer() const = 0;
  /// Stops the axes at once, then abandonPrograms().
  virtual Status abort() = 0;
  /// Whether it lets overrides be written from outside.
  virtual bool takesOverrides() const { return false; }
  /// @return what it took: it may round, or not go as far.
  virtual Result<Overrides> setOverrides(const Overrides& /*wanted*/) {
    return Failure{Failure::Kind::refused, name() + " takes no overrides from outside"};
  }
  /// Feed hold: the axes stand where they are, the program goes on at the machine's own key. Not every wire
  /// has it.
  virtual Status hold() {
    return Failure{Failure::Kind::refused, name() + " takes no feed hold from outside: its own key is due"};
  }
};

}  // namespace smartmill::cnc
