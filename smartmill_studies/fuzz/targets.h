#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>

namespace smartmill::fuzz {

/// Each target accepts any bytes. A fault throws something other than an error of the reader, or is found by
/// the sanitizers.
using Target = std::function<void(const std::uint8_t* data, std::size_t size)>;

void replies(const std::uint8_t* data, std::size_t size);   ///< frames as a client reads them
void requests(const std::uint8_t* data, std::size_t size);  ///< frames as a server answers them
void gateway(const std::uint8_t* data, std::size_t size);   ///< frames of LinuxCNC's gateway and stream
void daq(const std::uint8_t* data, std::size_t size);       ///< frames of samples of the driver tcp
void nc(const std::uint8_t* data, std::size_t size);  ///< NC text: the bridge's check, the control's run
void recording(const std::uint8_t* data, std::size_t size);  ///< file of a FOCAS session
void model(const std::uint8_t* data, std::size_t size);      ///< machine model file
void campaign(const std::uint8_t* data, std::size_t size);   ///< campaign file
void dynoware(const std::uint8_t* data, std::size_t size);   ///< Kistler DynoWare's text
void uff(const std::uint8_t* data, std::size_t size);        ///< universal files 58 and 58b
void bag(const std::uint8_t* data, std::size_t size);        ///< recorded ROS bag
void mcap(const std::uint8_t* data, std::size_t size);       ///< recorded MCAP file
/// A line as --channels takes it, then a text table of a measurement
void channels(const std::uint8_t* data, std::size_t size);
void import_plan(const std::uint8_t* data, std::size_t size);  ///< import.yaml
void agent(const std::uint8_t* data, std::size_t size);        ///< target of a request to the MTConnect agent
void shdr(const std::uint8_t* data, std::size_t size);         ///< lines of a client of the SHDR adapter

/// By name; the corpus of each is the folder NAME of corpus.tar.gz.
inline const std::map<std::string, Target>& targets() {
  static const std::map<std::string, Target> TARGETS{{"replies", replies},
                                                     {"requests", requests},
                                                     {"daq", daq},
                                                     {"nc", nc},
                                                     {"recording", recording},
                                                     {"model", model},
                                                     {"campaign", campaign},
                                                     {"dynoware", dynoware},
                                                     {"uff", uff},
                                                     {"gateway", gateway},
                                                     {"bag", bag},
                                                     {"mcap", mcap},
                                                     {"channels", channels},
                                                     {"import_plan", import_plan},
                                                     {"agent", agent},
                                                     {"shdr", shdr}};
  return TARGETS;
}

}  // namespace smartmill::fuzz
