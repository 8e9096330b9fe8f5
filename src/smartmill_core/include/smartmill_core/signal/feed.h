#pragma once

#include <string>

namespace smartmill {

/// Connects a topic to a pipeline. @param source the Inputs of a node or a RecordingReader. @tparam Data core
/// type of the topic
template <class Data, class Source, class Pipeline>
void feed(Source& source, const std::string& topic, Pipeline& pipeline) {
  source.template on<Data>(topic, [&pipeline](const Data& data, double) { pipeline.push(data); });
}

}  // namespace smartmill
