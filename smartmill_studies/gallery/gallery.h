#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace smartmill::studies {

/// Where the two sides of a comparison come from. The kinds are counted apart: only the first is evidence.
enum class Kind {
  reproduced,      ///< the reference shares neither code nor input with what is tested
  restated,        ///< a constant, an identity, or an input that is put in and found again
  another_machine  ///< figures of another rig: shown next to ours, without a verdict
};
constexpr Kind KINDS[] = {Kind::reproduced, Kind::restated, Kind::another_machine};
/// "reproduced", "restated", "another machine"
const char* nameOf(Kind kind);

/// Whether a result confirms the printed value of a document.
enum class Verdict { agrees, better, differs, shown };
const char* nameOf(Verdict verdict);

/// A printed value of a document and the one computed here, as texts, since "about 30 %" is no number.
struct Compared {
  /// @throws std::logic_error when another machine has a verdict, or a restated number is called better.
  Compared(Kind kind, std::string what, std::string seed, std::string ours, Verdict verdict, std::string why);

  Kind kind;         ///< by the origin of both sides, stated with every number: there is no default
  std::string what;  ///< with its unit
  std::string seed;  ///< as printed
  std::string ours;  ///< computed in this run
  Verdict verdict;   ///< by the rule of the figure, never by hand; shown: of another machine
  std::string why;   ///< reason of a difference, or limits of the comparison
};

/// Result of reproducing a figure or table of a document.
struct Drawn {
  std::vector<std::string> pictures;  ///< files in the output folder
  std::vector<Compared> rows;
};

/// One figure or table, or several of the same run.
struct Figure {
  std::string name;   ///< for command line and picture: dunwoody_3_5
  std::string title;  ///< its numbers in the document, and its content
  std::function<Drawn(const std::string& folder, unsigned seed)> draw;
  /// The same with fewer machines or speeds, for the test; empty: draw is fast enough.
  std::function<Drawn(const std::string& folder, unsigned seed)> draw_small = nullptr;
};

/// In the order of the documents.
std::vector<Figure> allFigures();

std::vector<Figure> loadMeterFigures();      ///< Dunwoody chapter 3
std::vector<Figure> hammerFigures();         ///< Dunwoody chapter 4
std::vector<Figure> dynamometerFigures();    ///< Dunwoody chapter 5
std::vector<Figure> chartFigures();          ///< Dunwoody chapter 6
std::vector<Figure> turningFigures();        ///< Kim
std::vector<Figure> spindleSensorFigures();  ///< Burzoni
std::vector<Figure> plateFigures();          ///< Bachrathy and Stepan
std::vector<Figure> motorFigures();          ///< Cheng and Venuvinod

/// Agrees within a share of the printed value, or within 1.96 standard deviations of ours.
Compared compareNumber(Kind kind, const std::string& what, double seed, double ours, double ours_std,
                       double share, const std::string& why);

/// Numbers of one kind by verdict.
struct KindCount {
  std::size_t agree = 0, better = 0, differ = 0, shown = 0;
};
KindCount countOf(const std::vector<Compared>& rows, Kind kind);
/// One line: "reproduced: 5 agree, 2 are better, 1 differs".
std::string summaryOf(const std::vector<Compared>& rows, Kind kind);

}  // namespace smartmill::studies
