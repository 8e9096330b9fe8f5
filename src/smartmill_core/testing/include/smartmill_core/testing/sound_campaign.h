#pragma once

#include <algorithm>
#include <cmath>
#include <string>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/io/sound_file.h"

namespace smartmill {

/// For tests of any package. Converts tests of a campaign to sound files: forces and hammer in WAV files of
/// 24 bits, read back through campaign.yaml. @param keep selects tests by name
template <typename Keep>
Campaign asSoundFiles(const Campaign& campaign, const std::string& folder, Keep keep) {
  Campaign sound;
  sound.folder = folder;
  sound.model_file = campaign.modelPath();
  for (CampaignTest test : campaign.tests) {
    if (!keep(test)) continue;
    const Record record = readRecord(campaign, test);
    SoundFile file;
    file.sample_rate = test.sample_rate;
    test.channels.clear();
    for (const char* name : {"fx", "fy", "fz", "hammer"}) {
      if (!record.has(name)) continue;
      double full = 0.0;
      for (const double v : record.column(name)) full = std::max(full, std::ceil(std::abs(v)));
      file.channels.push_back(record.column(name));
      for (double& v : file.channels.back()) v /= full + 1.0;
      test.channels[name] = std::to_string(file.channels.size()) + "=" + std::to_string(full + 1.0);
    }
    test.file = test.name + ".wav";
    test.file_format = "sound";
    writeWav(file, folder + "/" + test.file);
    sound.tests.push_back(test);
  }
  writeCampaign(sound, folder);
  return readCampaign(folder);
}

}  // namespace smartmill
