#pragma once

#include "smartmill_hammer/sequence/hammer_sequence.h"

namespace smartmill {

class ParameterReader;

namespace hammer {

struct NodeParameters;

/// Reads every key of launch/config/hammer.yaml. @throws Error naming key and value.
void readParameters(ParameterReader& reader, HammerParameters& parameters, NodeParameters& node);

}  // namespace hammer
}  // namespace smartmill
