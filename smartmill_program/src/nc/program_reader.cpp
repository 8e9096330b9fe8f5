#include "smartmill_program/nc/program_reader.h"

#include <optional>

#include "block.h"
#include "interpreter.h"
#include "program_text.h"
#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"

namespace smartmill::program {
namespace {

constexpr std::size_t MAX_DEPTH = 10;         // of subprograms, as on a 30i
constexpr int MAX_REPEATS = 9999;             // L of M98
constexpr std::size_t MAX_BLOCKS = 20000000;  // executed; a program that takes days

/// A subprogram in execution.
struct Call {
  std::size_t first, back;  // lines: its first, that after M98
  int remaining;            // further repetitions
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
    Block block(text_.line(at_));
    const std::size_t here = at_++;
    if (block.empty()) return;
    if (!started_) begin_ = main_ = here;
    started_ = true;
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
    const std::optional<std::size_t> first = text_.find(number);
    if (!first)
      refuse(*program, program->text() + ": subprogram O" + std::to_string(number) + " is not in the file");
    if (calls_.size() >= MAX_DEPTH)
      refuse(call, "more than " + std::to_string(MAX_DEPTH) + " subprograms within each other");
    if (count == 0) return;
    calls_.push_back({*first, at_, count - 1});
    at_ = begin_ = *first;
  }

  void end(const nc::Word& back) {
    if (calls_.empty()) refuse(back, "M99 in the main program, expected M30 or M2");
    Call& call = calls_.back();
    if (call.remaining > 0) {
      --call.remaining;
      at_ = call.first;
      return;
    }
    at_ = call.back;
    calls_.pop_back();
    begin_ = calls_.empty() ? main_ : calls_.back().first;
  }

  const ProgramText& text_;
  std::vector<Move> moves_;
  Interpreter interpreter_;
  std::vector<Call> calls_;
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
