#include "smartmill_program/nc/program_reader.h"

#include <optional>

#include "block.h"
#include "interpreter.h"
#include "macro_statement.h"
#include "program_text.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"

namespace smartmill::program {
namespace {

constexpr std::size_t MAX_DEPTH = 10;         // of subprograms, as on a 30i
constexpr int MAX_REPEATS = 9999;             // L of M98
constexpr std::size_t MAX_BLOCKS = 20000000;  // executed; a program that takes days
constexpr int MAX_JUMPS = 1000000;            // of macros; a loop without end

/// A subprogram in execution.
struct Call {
  std::size_t first, back;                            // lines: its first, that after M98
  int remaining;                                      // further repetitions
  std::optional<MacroVariables::Locals> arguments{};  // of G65
};

/// Executes the lines of a program with its subprograms.
class ProgramRun {
 public:
  ProgramRun(const ProgramText& text, const ReaderOptions& options)
      : text_(text), interpreter_(options, moves_) {}

  std::vector<Move> run(const std::string& name) {
    std::size_t blocks = 0;
    while (!interpreter_.ended()) {
      const bool at_end = at_ == text_.size() || (started_ && text_.begins(at_) && at_ != begin_);
      const std::string line = std::to_string(at_end ? at_ : at_ + 1);
      if (at_end && !started_) throw Error(name + ": no block, expected an NC program");
      if (at_end)
        throw Error(name + ": line " + line + ": the " + (calls_.empty() ? "program" : "subprogram") +
                    " ends in the middle, expected " + (calls_.empty() ? "M30 or M2" : "M99"));
      if (++blocks > MAX_BLOCKS)
        throw Error(name + ": line " + line + ": more than " + std::to_string(MAX_BLOCKS) + " blocks");
      try {
        step(blocks - 1);
      } catch (const Error& error) {
        throw Error(name + ": line " + line + ", " + error.what());
      }
    }
    return std::move(moves_);
  }

 private:
  void step(std::size_t number) {
    const MacroStatement statement = readMacroStatement(text_.line(at_), variables_);
    const std::size_t here = at_++;
    const bool macro = statement.kind != MacroStatement::Kind::none;
    Block block(macro ? std::string() : text_.line(here), [this](int n) { return variables_.value(n); });
    if (!macro && block.hasOnlyNumber()) {
      if (const std::string name = commentIn(text_.line(here)); !name.empty()) interpreter_.setName(name);
    }
    if (block.empty() && !macro) return;
    if (!started_) begin_ = main_ = here;
    started_ = true;
    if (macro) {
      execute(statement, here);
      return;
    }
    const nc::Word* call = block.function(98);
    const nc::Word* back = block.function(99);
    if (call && back) refuse(*back, "M98 and M99 in one block");
    // P and L belong to the call.
    const nc::Word* program = call ? block.take('P') : nullptr;
    const nc::Word* repeats = call ? block.take('L') : nullptr;
    interpreter_.execute(block, number, static_cast<int>(here) + 1);
    block.finish();
    if (call) begin(*call, program, repeats);
    if (back) end(*back);
  }

  void begin(const nc::Word& call, const nc::Word* program, const nc::Word* repeats) {
    if (!program) refuse(call, "M98 without P, expected the number of a subprogram");
    int number = nc::integer(*program), count = repeats ? nc::integer(*repeats, MAX_REPEATS) : 1;
    // P with more than four digits: repetitions and a number of four digits.
    if (!repeats && !text_.find(number) && number > 9999) {
      count = number / 10000;
      number %= 10000;
    }
    enter(call.column, program->column, program->text(), number, count, {});
  }

  /// @param column of the call, and of the word of the subprogram
  void enter(std::size_t column, std::size_t column_of_word, const std::string& word, int number, int count,
             const std::optional<MacroVariables::Locals>& arguments) {
    const auto fail = [](std::size_t at, const std::string& message) {
      throw Error("column " + std::to_string(at) + ": " + message);
    };
    const std::optional<std::size_t> first = text_.find(number);
    if (!first)
      fail(column_of_word, word + ": subprogram O" + std::to_string(number) + " is not in the file");
    if (calls_.size() >= MAX_DEPTH)
      fail(column, "more than " + std::to_string(MAX_DEPTH) + " subprograms within each other");
    if (count == 0) return;
    calls_.push_back({*first, at_, count - 1, arguments});
    if (arguments) variables_.enter(*arguments);
    at_ = begin_ = *first;
  }

  void execute(const MacroStatement& statement, std::size_t here) {
    using Kind = MacroStatement::Kind;
    const std::string place = "column " + std::to_string(statement.column) + ": ";
    const std::string number = std::to_string(statement.number);
    switch (statement.kind) {
      case Kind::assignment:
        variables_.set(statement.number, statement.value);
        break;
      case Kind::jump:
        jumpTo(findSequence(here, statement.number), place, "GOTO" + number + ": N" + number);
        break;
      case Kind::loop_begin:
        if (!statement.enters)
          jumpTo(findLoop(here, 1, loopEndOf, statement.number, 1), place, "DO" + number + ": END" + number);
        break;
      case Kind::loop_end:
        jumpTo(findLoop(here, -1, loopBeginOf, statement.number, 0), place, "END" + number + ": DO" + number);
        break;
      case Kind::call:
        enter(statement.column, statement.column, "P" + number, statement.number, statement.repeats,
              statement.locals);
        break;
      case Kind::nothing:
      case Kind::none:
        break;
    }
  }

  void jumpTo(const std::optional<std::size_t>& line, const std::string& place, const std::string& what) {
    if (!line) throw Error(place + what + " is not in the program");
    if (++jumps_ > MAX_JUMPS)
      throw Error(place + "more than " + std::to_string(MAX_JUMPS) + " jumps, expected a loop that ends");
    at_ = *line;
  }

  /// Whether a line belongs to the program in execution.
  bool isInside(std::size_t line) const {
    return line < text_.size() && !(text_.begins(line) && line != begin_);
  }

  // As a control: forwards to the end of the program, then from its beginning.
  std::optional<std::size_t> findSequence(std::size_t here, int number) const {
    for (std::size_t line = here + 1; isInside(line); ++line)
      if (sequenceOf(text_.line(line)) == number) return line;
    for (std::size_t line = begin_; line <= here; ++line)
      if (sequenceOf(text_.line(line)) == number) return line;
    return std::nullopt;
  }

  /// The next line of a loop's other end in a direction, plus `behind` lines.
  std::optional<std::size_t> findLoop(std::size_t here, int direction, int (*of)(const std::string&),
                                      int number, std::size_t behind) const {
    for (std::size_t line = here; line != begin_ || direction > 0;) {
      line += static_cast<std::size_t>(direction);
      if (!isInside(line)) break;
      if (of(text_.line(line)) == number) return line + behind;
    }
    return std::nullopt;
  }

  void end(const nc::Word& back) {
    if (calls_.empty()) refuse(back, "M99 in the main program, expected M30 or M2");
    Call& call = calls_.back();
    if (call.remaining > 0) {
      --call.remaining;
      at_ = call.first;
      if (call.arguments) {
        variables_.leave();
        variables_.enter(*call.arguments);
      }
      return;
    }
    at_ = call.back;
    if (call.arguments) variables_.leave();
    calls_.pop_back();
    begin_ = calls_.empty() ? main_ : calls_.back().first;
  }

  const ProgramText& text_;
  std::vector<Move> moves_;
  Interpreter interpreter_;
  std::vector<Call> calls_;
  MacroVariables variables_;
  int jumps_ = 0;
  bool started_ = false;  // after the first block
  std::size_t at_ = 0, begin_ = 0,
              main_ = 0;  // next line; first line of the program in execution, of the main one
};

}  // namespace

std::vector<Move> interpretProgram(const std::string& text, const std::string& name,
                                   const ReaderOptions& options) {
  const ProgramText lines(text, name);
  ProgramRun run(lines, options);
  return run.run(name);
}

std::vector<Move> readProgram(const std::string& file, const ReaderOptions& options) {
  return interpretProgram(readText(file), file, options);
}

}  // namespace smartmill::program
