#pragma once

#include <functional>
#include <string>
#include <vector>

namespace smartmill::studies {

/// Whether a result confirms the printed value of a document.
enum class Verdict { agrees, better, differs };
const char* nameOf(Verdict verdict);

/// A printed value of a document and the one computed here, as texts, since "about 30 %" is no number.
struct Compared {
  std::string what;  ///< with its unit
  std::string seed;  ///< as printed
  std::string ours;  ///< computed in this run
  Verdict verdict;   ///< by the rule of the figure, never by hand
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
Compared compareNumber(const std::string& what, double seed, double ours, double ours_std, double share,
                       const std::string& why);

}  // namespace smartmill::studies
