#include "smartmill_core/cutting/contact_arc.h"

#include <cstdio>

#include "smartmill_core/error.h"

namespace smartmill {

void validate(const ContactArc& arc) {
  if (arc.entry >= 0.0 && arc.exit > arc.entry && arc.exit <= units::TWO_PI + 1e-9 && arc.depth > 0.0) return;
  char text[160];
  std::snprintf(text, sizeof text, "contact from %g to %g rad over %g m is impossible", arc.entry, arc.exit,
                arc.depth);
  throw Error(text);
}

}  // namespace smartmill
