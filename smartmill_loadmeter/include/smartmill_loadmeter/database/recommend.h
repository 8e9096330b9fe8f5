#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_loadmeter/database/database.h"

namespace smartmill::loadmeter {

/// Method by which coefficients are estimated for a tool and a material. Values as in RecommendCut.srv.
enum class EstimationMethod { pair = 0, shear_zone = 1, standard_cuts = 2, other_tool = 3 };
const char* nameOf(EstimationMethod method);

/// Ktc and Kte by one method.
struct MethodEstimate {
  EstimationMethod method{};
  CoefficientSet set;
  int records = 0;  ///< used
};

/// Recommended coefficients for a tool in a material.
struct CutRecommendation {
  EstimationMethod method{};                ///< most certain method; all coefficients but Ktc are its own
  CoefficientSet set;                       ///< Ktc by all methods combined, less certain where they disagree
  double ktc_lower = 0.0, ktc_upper = 0.0;  ///< [N/m2] 95 % interval of Ktc, log-normal
  /// [1] largest difference from the most certain method over the joint standard deviation; NaN: one method
  /// only
  double disagreement = CoefficientRecord::UNKNOWN;
  std::vector<MethodEstimate> estimates;  ///< of all applicable methods
  std::string message;                    ///< one line
};

/// Combines all applicable methods:
/// - the records of the pair;
/// - the material's shear zone from other tools (Budak, Altintas, Armarego), evaluated for this tool's rake
/// and helix, from the query or from its records in other materials;
/// - standard cuts: log K = tool + material, fitted to all pairs, with the scatter of single pairs about it;
/// - other tools in the material.
/// @param query requires tool and material. Empty: no record in this material.
std::optional<CutRecommendation> recommendCut(const CoefficientDatabase& database,
                                              const CoefficientQuery& query);

}  // namespace smartmill::loadmeter
