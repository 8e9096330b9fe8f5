#include "session/session_parameters.h"

#include "smartmill_core/testing/shipped_parameters.h"

namespace smartmill::session {
namespace {

TEST(Parameters, TheShippedFileMatchesTheDeclaration) {
  expectShipped<SessionParameters>("config/session.yaml", "smartmill_launch session_node");
}

}  // namespace
}  // namespace smartmill::session
