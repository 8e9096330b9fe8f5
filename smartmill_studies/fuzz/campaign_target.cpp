#include "fuzz/input_file.h"
#include "fuzz/targets.h"
#include "smartmill_core/campaign/campaign.h"

namespace smartmill::fuzz {

void campaign(const std::uint8_t* data, std::size_t size) {
  const std::string& file = inputFile(data, size);
  readOrRefuse([&] { readCampaignWithPaths(file); });
}

}  // namespace smartmill::fuzz
