#include "fuzz/input_file.h"
#include "fuzz/targets.h"
#include "smartmill_core/io/uff.h"

namespace smartmill::fuzz {

void uff(const std::uint8_t* data, std::size_t size) {
  const std::string& file = inputFile(data, size);
  readOrRefuse([&] { readUff(file); });
}

}  // namespace smartmill::fuzz
