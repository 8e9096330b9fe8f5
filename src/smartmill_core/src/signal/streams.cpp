#include "smartmill_core/signal/streams.h"

#include "smartmill_core/error.h"

namespace smartmill {

std::size_t SampleBlock::channel(const std::string& name) const {
  std::string present;
  for (std::size_t c = 0; c < channels.size(); ++c) {
    if (channels[c] == name) return c;
    present += (c ? " " : "") + channels[c];
  }
  throw Error("sample block: channel '" + name + "' is missing (present: " + present + ")");
}

std::vector<double> SampleBlock::column(const std::string& name) const {
  const std::size_t c = channel(name);
  std::vector<double> values(size());
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = at(i, c);
  return values;
}

}  // namespace smartmill
