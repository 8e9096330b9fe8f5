#include "smartmill_core/nc/block_reader.h"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace smartmill::nc {
namespace {

constexpr Dialect PLAIN{"NGXF", " \t", true, false};
constexpr Dialect MACROS{"NGXF", " ", false, true};

std::vector<Word> wordsOf(const std::string& line, const Dialect& dialect, const Variables& variables = {}) {
  BlockReader reader(line, dialect, variables);
  std::vector<Word> words;
  while (const std::optional<Word> word = reader.next()) words.push_back(*word);
  return words;
}

/// The error of a line: of its words or of its assignment.
std::string errorOf(const std::string& line, const Dialect& dialect) {
  try {
    BlockReader reader(line, dialect);
    if (reader.assigns()) reader.assignment();
    while (reader.next()) continue;
  } catch (const SyntaxError& error) {
    return error.what();
  }
  return {};
}

TEST(BlockReader, WordsHaveTheirTextAndColumn) {
  const std::vector<Word> words = wordsOf("n010 (first) g1\tX - 2.50F+.5", PLAIN);
  ASSERT_EQ(words.size(), 4u);
  EXPECT_EQ(words[0].text(), "N010");
  EXPECT_EQ(words[0].column, 1u);
  EXPECT_EQ(integer(words[0], 99), 10);
  EXPECT_EQ(words[1].text(), "G1");
  EXPECT_EQ(words[1].column, 14u);
  EXPECT_EQ(words[2].text(), "X-2.50");
  EXPECT_EQ(words[2].value, -2.5);
  EXPECT_EQ(words[2].column, 17u);
  EXPECT_EQ(words[3].value, 0.5);
  EXPECT_EQ(words[3].column, 25u);
  EXPECT_TRUE(wordsOf("(only a comment)", PLAIN).empty());
}

TEST(BlockReader, FunctionsAndComparisonsOfMacroB) {
  constexpr Dialect MACRO_B{"X", " ", false, true, true};
  const Variables variables = [](int n) { return n == 7 ? std::nullopt : std::optional<double>(10.0 * n); };
  const std::vector<std::pair<std::string, double>> cases{
      {"X[TAN[45]]", 1.0},         {"X[ASIN[0.5]]", 30.0},
      {"X[ACOS[0.5]]", 60.0},      {"X[ATAN[1]]", 45.0},
      {"X[ATAN[-1]/[-1]]", 225.0}, {"X[ABS[-3]]", 3.0},
      {"X[ROUND[2.5]]", 3.0},      {"X[FIX[-2.7]]", -2.0},
      {"X[FUP[2.1]]", 3.0},        {"X[FUP[-2.1]]", -3.0},
      {"X[LN[EXP[2]]]", 2.0},      {"X[17MOD5*2]", 4.0},
      {"X[6AND3]", 2.0},           {"X[6OR3]", 7.0},
      {"X[6XOR3]", 5.0},           {"X[#1EQ10]", 1.0},
      {"X[#1NE10]", 0.0},          {"X[#1GT9+1]", 0.0},
      {"X[#1GE9+1]", 1.0},         {"X[#1LT#2]", 1.0},
      {"X[#2LE#1]", 0.0},          {"X[#7EQ#7]", 1.0},
      {"X[#7EQ0]", 0.0},           {"X[#7LT1]", 1.0},
      {"X[[1LT2]AND[3GT2]]", 1.0}, {"X[[1LT2]AND[3LT2]]", 0.0},
      {"X-[[1LT2]OR[3LT2]]", -1.0}};
  for (const auto& [line, value] : cases) {
    const std::vector<Word> words = wordsOf(line, MACRO_B, variables);
    ASSERT_EQ(words.size(), 1u) << line;
    EXPECT_NEAR(*words[0].value, value, 1e-12) << line;
  }
  EXPECT_EQ(errorOf("X[ASIN[2]]", MACRO_B), "column 3: ASIN of a value outside of its domain");
  EXPECT_EQ(errorOf("X[5MOD0]", MACRO_B), "column 7: division by zero");
  EXPECT_NE(errorOf("X[1EQ1]", MACROS), "");  // not of the controller's dialect
  EXPECT_NE(errorOf("X[TAN[45]]", MACROS), "");
}

TEST(BlockReader, VariablesAndExpressions) {
  const Variables variables = [](int n) { return n == 7 ? std::nullopt : std::optional<double>(10.0 * n); };
  const std::vector<Word> words =
      wordsOf("X#2 X-#[1+1] X##0 X[#2*[3-1]/4] X-[SQRT[16]+SIN[30]] X#7 X[#7+1]", MACROS, variables);
  const std::vector<std::optional<double>> expected{20.0, -20.0, 0.0, 10.0, -4.5, std::nullopt, 1.0};
  ASSERT_EQ(words.size(), expected.size());
  for (std::size_t i = 0; i < words.size(); ++i) {
    ASSERT_EQ(words[i].value.has_value(), expected[i].has_value()) << words[i].text();
    if (expected[i]) {
      EXPECT_NEAR(*words[i].value, *expected[i], 1e-15) << words[i].text();
    }
  }
  EXPECT_EQ(words[3].text(), "X[#2*[3-1]/4]");
}

TEST(BlockReader, Assignments) {
  BlockReader plain("#0005 = -3.50", PLAIN);
  ASSERT_TRUE(plain.assigns());
  const Assignment five = plain.assignment();
  EXPECT_EQ(five.variable, 5);
  EXPECT_EQ(five.value, -3.5);
  EXPECT_EQ(five.written_variable + "=" + five.written_value, "0005=-3.50");
  BlockReader macro("N20 #[1+1]=2*3", MACROS);
  ASSERT_TRUE(macro.assigns());
  const Assignment two = macro.assignment();
  EXPECT_EQ(two.sequence, 20);
  EXPECT_EQ(two.variable, 2);
  EXPECT_EQ(two.value, 6.0);
  // Without expressions a sequence number does not precede an assignment; N#1 is a word.
  EXPECT_FALSE(BlockReader("N20 #2=6", PLAIN).assigns());
  EXPECT_FALSE(BlockReader("N#1", MACROS).assigns());
}

TEST(BlockReader, ErrorsNameColumnAndExpectation) {
  struct Case {
    const char* line;
    const Dialect& dialect;
    const char* error;
  };
  for (const Case& c : {Case{"G1 (a) Q3 X1", PLAIN, "column 8: unknown word Q3, expected N, G, X or F"},
                        Case{"G1 X1..2", PLAIN, "column 4: X1..2, expected a number"},
                        Case{"X1234567890123", PLAIN, "column 1: X1234567890123, expected at most 12 digits"},
                        Case{"G1 WHILE", MACROS, "column 4: WHILE is not supported"},
                        Case{"X1 (a", PLAIN, "column 4: comment is not closed, expected ')'"},
                        Case{"(a (b) X1", PLAIN, "column 4: '(' in a comment, expected ')' first"},
                        Case{"(a (b) X1", MACROS, ""}, Case{"X1)", PLAIN, "column 3: ')' without '('"},
                        Case{"X1)", MACROS, "column 3: unknown word ), expected N, G, X or F"},
                        Case{"X#1", PLAIN, "column 1: X, expected a number"},
                        Case{"#1=#2", PLAIN, "column 1: #1=, expected a number"},
                        Case{"#1.5=2", PLAIN, "column 1: #1.5, expected an integer from 0 to 99999999"},
                        Case{"#+1=2", PLAIN, "column 4: malformed block, expected #n=value"},
                        Case{"#1=2 X1", PLAIN, "column 6: malformed block, expected #n=value"},
                        Case{"#1=1/0", MACROS, "column 6: division by zero"},
                        Case{"#1=SQRT[-1]", MACROS, "column 8: square root of a negative number"},
                        Case{"X[1", MACROS, "column 4: malformed expression"},
                        Case{"X[[[[[[1]]]]]]", MACROS, "column 8: malformed expression"}}) {
    EXPECT_EQ(errorOf(c.line, c.dialect), c.error) << c.line;
  }
}

TEST(BlockReader, IntegersAreChecked) {
  EXPECT_EQ(integer({'G', 90.0, "90", 1}), 90);
  for (const std::optional<double> value : std::vector<std::optional<double>>{-1.0, 1.5, 1e9, std::nullopt}) {
    EXPECT_THROW(integer({'G', value, "", 1}), SyntaxError);
  }
}

}  // namespace
}  // namespace smartmill::nc
