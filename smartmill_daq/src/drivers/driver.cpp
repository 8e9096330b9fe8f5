#include "smartmill_daq/drivers/driver.h"

#include <charconv>

#include "drivers/driver_list.h"
#include "smartmill_core/formatted.h"

namespace smartmill::daq {

const std::vector<DriverKind>& driverKinds() {
  static const std::vector<DriverKind> kinds = driverList();
  return kinds;
}

std::unique_ptr<Driver> makeDriver(const std::string& file, const Instrument& instrument,
                                   const std::optional<StrictYaml>& options) {
  std::vector<std::string> built;
  for (const DriverKind& kind : driverKinds()) {
    if (kind.make) built.push_back(kind.name);
    if (kind.name != instrument.driver) continue;
    if (!kind.make)
      throw Error(file + ": driver: " + kind.name +
                  " was not built, its library is missing; ./setup --with-instruments");
    std::unique_ptr<Driver> driver;
    try {
      driver = kind.make({instrument, instrument.channels(), options});
    } catch (const Error& error) {
      const std::string what = error.what();
      throw Error(what.rfind(file + ":", 0) == 0 ? what : file + ": " + what);
    }
    if (options) options->finish();
    return driver;
  }
  throw Error(file + ": driver: '" + instrument.driver + "' is not one of " + joined(built));
}

std::vector<std::size_t> inputNumbers(const std::vector<Channel>& channels, std::size_t most) {
  std::vector<std::size_t> numbers;
  for (const Channel& channel : channels) {
    std::size_t number = 0;
    const char* const end = channel.input.data() + channel.input.size();
    const auto [last, code] = std::from_chars(channel.input.data(), end, number);
    if (code != std::errc() || last != end || number < 1 || number > most)
      throw Error("channel " + channel.name + ": input: '" + channel.input +
                  "', expected a number from 1 to " + std::to_string(most));
    numbers.push_back(number - 1);
  }
  return numbers;
}

}  // namespace smartmill::daq
