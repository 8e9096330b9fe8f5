#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_loadmeter/database/database.h"

namespace smartmill::loadmeter {

/// By which way the database answers for a tool and a material.
enum class AnswerWay { pair = 0, shear_zone = 1, standard_cuts = 2, other_tool = 3 };
const char* nameOf(AnswerWay way);

/// One way's Ktc and Kte.
struct WayAnswer {
  AnswerWay way{};
  CoefficientSet set;
  int records = 0;  ///< that it rests on
};

/// What to reckon with when this tool is to cut this material.
struct CutAnswer {
  AnswerWay way{};                          ///< the surest one, whose coefficients these are, but for Ktc
  CoefficientSet set;                       ///< Ktc by all ways together, less sure where they contradict
  double ktc_lower = 0.0, ktc_upper = 0.0;  ///< [N/m2] with 95 % probability Ktc lies between, log-normal
  /// [1] largest distance between two ways, over their joint standard deviation; NaN: there is one only
  double surprise = CoefficientRecord::UNKNOWN;
  std::vector<WayAnswer> ways;  ///< all that can answer
  std::string message;          ///< one line
};

/// Answers from everything that was cut: the pair itself; the material's shear zone from other tools (Budak,
/// Altintas, Armarego), forward to this tool's rake and helix, which its records in other materials tell
/// where the query does not; standard cuts: log K = tool + material, fitted to all pairs that have been cut,
/// whose scatter is what one pair departs from it; other tools in the material. @param query tool and
/// material are due. Empty: nothing in this material.
std::optional<CutAnswer> recommendCut(const CoefficientDatabase& database, const CoefficientQuery& query);

}  // namespace smartmill::loadmeter
