#pragma once

#include <functional>
#include <string>
#include <vector>

namespace smartmill::studies {

/// Whether what is found here bears out what a document prints.
enum class Verdict { agrees, better, differs };
const char* nameOf(Verdict verdict);

/// A number of a document beside ours. Texts, as a document's "about 30 %" is no number.
struct Compared {
  std::string what;  ///< with its unit
  std::string seed;  ///< as printed
  std::string ours;  ///< as found in this run
  Verdict verdict;   ///< told by the figure's own rule, never by hand
  std::string why;   ///< of a difference, or what the comparison is worth
};

/// What a figure or table of a document has become.
struct Drawn {
  std::vector<std::string> pictures;  ///< files, in the folder that was given
  std::vector<Compared> rows;
};

/// One figure or table, or a few that show the same run.
struct Figure {
  std::string name;   ///< of the command line and the picture: dunwoody_3_5
  std::string title;  ///< the document's numbers of it, and what it shows
  std::function<Drawn(const std::string& folder, unsigned seed)> draw;
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

/// Agrees within a share of the document's number, or within 1.96 standard deviations of ours.
Compared compareNumber(const std::string& what, double seed, double ours, double ours_std, double share,
                       const std::string& why);

}  // namespace smartmill::studies
