#include "smartmill_discrepancy/results/explanation.h"

namespace smartmill::discrepancy {

const char* nameOf(Verdict verdict) {
  switch (verdict) {
    case Verdict::no_disagreement:
      return "no_disagreement";
    case Verdict::explained:
      return "explained";
    case Verdict::partly_explained:
      return "partly_explained";
    case Verdict::unknown_effect:
      break;
  }
  return "unknown_effect";
}

}  // namespace smartmill::discrepancy
