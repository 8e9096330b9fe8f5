#include "feed_words.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <string_view>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"

namespace smartmill::program {
namespace {

constexpr int DIGITS = 4;        // of a planned feed: 0.1 %
constexpr int MOST_DIGITS = 12;  // of a number (value_reader.cpp)

std::string withoutTrailingZeros(std::string number) {
  if (number.find('.') == std::string::npos) return number;
  number.erase(number.find_last_not_of('0') + 1);
  if (number.back() == '.') number.pop_back();
  return number;
}

bool isBlank(char c) {
  return std::string_view(" \t\n\v\f\r\0", 7).find(c) != std::string_view::npos;
}

/// Where a word and the words of a line are.
struct WordPlaces {
  std::size_t number = std::string::npos, number_end = 0;  // behind the letter to the last character
  bool commented = false;                                  // a comment within it
  std::size_t end = 0;                                     // behind the last word
  bool blanks = false;                                     // between words
};

// As the lexer: comments in parentheses, and behind ';'.
WordPlaces placesIn(const std::string& line, char letter) {
  WordPlaces places;
  bool comment = false, in_word = false, comment_in_word = false, blank = false;
  int depth = 0;  // of brackets
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (c == '(' || c == ')') {
      comment = c == '(';
      comment_in_word = comment_in_word || in_word;
      continue;
    }
    if (comment) continue;
    if (c == ';') break;
    if (isBlank(c)) {
      blank = blank || places.end > 0;
      continue;
    }
    places.blanks = places.blanks || blank;
    const bool number =
        depth > 0 || (c >= '0' && c <= '9') || std::string_view(".+-#[").find(c) != std::string_view::npos;
    depth += (c == '[') - (c == ']');
    in_word = in_word && number;
    if (depth == 0 && std::toupper(static_cast<unsigned char>(c)) == letter) {
      in_word = true;
      comment_in_word = false;
      places.number = i + 1;
      places.number_end = i + 1;
    } else if (in_word) {
      places.commented = places.commented || comment_in_word;
      places.number_end = i + 1;
    }
    places.end = i + 1;
  }
  return places;
}

}  // namespace

std::vector<std::string> linesOf(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size() - 1) + 1;
    lines.push_back(text.substr(at, end - at));
    at = end;
  }
  return lines;
}

std::string feedNumberUpTo(double value) {
  if (!(value >= 1e-8)) return "0";
  const int decimals = DIGITS - 1 - static_cast<int>(std::floor(std::log10(value)));
  const double scale = std::pow(10.0, decimals);
  // The relative 1e-12 is rounding: a limit of 600 is F600.
  const double floored = std::floor(value * scale * (1.0 + 1e-12)) / scale;
  return withoutTrailingZeros(formatted("%.*f", std::max(0, decimals), floored));
}

std::string feedNumberOf(double value) {
  const int before = std::max(1, static_cast<int>(std::floor(std::log10(value))) + 1);  // the point
  return withoutTrailingZeros(formatted("%.*f", std::max(0, MOST_DIGITS - before), value));
}

ProgramWords::ProgramWords(const std::string& text) : lines_(linesOf(text)) {
}

bool ProgramWords::has(int line, char letter) const {
  return placesIn(lines_.at(static_cast<std::size_t>(line - 1)), letter).number != std::string::npos;
}

void ProgramWords::set(int line, char letter, const std::string& number) {
  std::string& text = lines_.at(static_cast<std::size_t>(line - 1));
  const WordPlaces places = placesIn(text, letter);
  if (places.number == std::string::npos) {
    text.insert(places.end, (places.blanks ? " " : "") + (letter + number));
    return;
  }
  if (places.commented)
    throw Error("line " + std::to_string(line) + ": a comment within the " + letter +
                " word, expected it behind the word");
  text.replace(places.number, places.number_end - places.number, number);
}

std::string ProgramWords::text() const {
  std::string text;
  for (const std::string& line : lines_) text += line;
  return text;
}

}  // namespace smartmill::program
