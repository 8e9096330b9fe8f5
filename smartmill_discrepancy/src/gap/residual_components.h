#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "gap/spindle_lines.h"
#include "smartmill_discrepancy/gap/structure.h"

namespace smartmill::discrepancy {

/// Part of a span with one condition: the time in cut of a cut, otherwise all samples.
struct ChannelSegment {
  const TestData* test;
  const ChannelSpan* span;
  std::vector<double> values;
  std::vector<double> angle;  ///< unwrapped; empty without spindle angle
  double rate;
  std::optional<SpindleLines> lines;  ///< with spindle angle
};

enum class ComponentKind { level, trend, decay, order, frequency };

struct Component {
  ComponentKind kind = ComponentKind::level;
  double location_value = 0.0;  ///< order, Hz or time constant
  double squares = 0.0;         ///< over all segments
  std::size_t freedom = 0;
  double trials = 1.0;  ///< independent locations tried
};

/// The segments of a channel; none from slow means and chattering cuts.
std::vector<ChannelSegment> segmentsOf(const TwinRunner& runner, const std::vector<double>& residual,
                                       const std::string& channel, const ComponentOptions& options);

/// All components of a channel, each fitted separately.
std::vector<Component> componentsOf(const std::vector<ChannelSegment>& segments,
                                    const ComponentOptions& options);

/// Removes a component from every segment. @return its finding
Finding removeComponent(const Component& component, const std::string& channel,
                        std::vector<ChannelSegment>& segments);

}  // namespace smartmill::discrepancy
