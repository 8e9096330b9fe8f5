#include "smartmill_cnc/controller/focas_controller.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

#include "controller/focas_reader.h"
#include "smartmill_core/error.h"
#include "smartmill_core/require.h"
#include "smartmill_focas/client.h"
#include "smartmill_focas/server.h"

namespace smartmill::cnc {
namespace {

using focas::FocasError;

constexpr int MAX_MARKER = 9999999;  // seven digits are exact in every variable

Failure::Kind kindOf(int code) {
  switch (code) {
    case focas::EW_ALARM:
      return Failure::Kind::alarm;
    case focas::EW_MODE:
      return Failure::Kind::wrong_mode;
    case focas::EW_BUSY:
    case focas::EW_REJECT:
      return Failure::Kind::not_yet;
    default:
      return Failure::Kind::refused;
  }
}

std::string sessionLine(const FocasError& e) {
  switch (e.code()) {
    case focas::EW_REJECT:
      return "the controller does not accept a DNC session yet (press CYCLE START at its panel): " +
             std::string(e.what());
    case focas::EW_BUSY:
      return "another client has a DNC session: " + std::string(e.what());
    case focas::EW_RESET:
      return "the controller was reset";
    default:
      return e.what();
  }
}

std::string endedLine(const FocasError& e) {
  return e.code() == focas::EW_RESET ? sessionLine(e)
                                     : "the controller ended the DNC session: " + std::string(e.what());
}

std::string plainLine(const FocasError& e) {
  return e.what();
}

class FocasController : public Controller {
 public:
  explicit FocasController(const FocasParameters& parameters)
      : parameters_(parameters), reader_(client_, parameters_) {
    parameters_.validate();
  }

  std::string name() const override {
    return "controller " + parameters_.host + ":" + std::to_string(parameters_.port);
  }

  Result<std::string> connect() override {
    open_ = false;
    const Status done = attempt(plainLine, [&] {
      client_.connect(parameters_.host, static_cast<std::uint16_t>(parameters_.port),
                      parameters_.reply_timeout);
      reader_.connected();
    });
    if (!done) {
      return done.failure();
    }
    const focas::ControllerInfo& info = client_.info();
    return "type " + info.cnc_type + info.mt_type + ", series " + info.series;
  }

  bool connected() const override { return client_.connected(); }
  void close() override { client_.close(); }

  Result<Reading> read() override {
    Reading reading;
    try {
      reading = reader_.read();
    } catch (const focas::ConnectionError& e) {
      return lost(e.what());
    } catch (const std::exception& e) {
      return lost(name() + ": " + e.what());
    }
    reading.program_done = reader_.marker() == static_cast<double>(marker_);
    return reading;
  }

  double temperaturePeriod() const override { return parameters_.temperature_period; }

  Result<MachineTemperature> readTemperature(std::string& refused) override {
    MachineTemperature temperature;
    const Status status = attempt(plainLine, [&] { temperature = reader_.readTemperature(refused); });
    if (!status) {
      return status.failure();
    }
    return temperature;
  }

  Status setVariable(int number, double value) override {
    if (number == parameters_.marker_macro) {
      return Failure{Failure::Kind::refused, "#" + std::to_string(number) + " is the bridge's own variable"};
    }
    return attempt(plainLine, [&] { client_.writeMacro(number, value); });
  }

  bool takesOverrides() const override { return parameters_.override_data >= 0; }
  // Not written to G12 and G30 directly: the ladder overwrites them in every scan from the panel's switches.
  Result<Overrides> setOverrides(const Overrides& wanted) override {
    if (!takesOverrides()) {
      return Failure{Failure::Kind::refused,
                     name() + " takes no overrides from outside: parameter override_data is not set"};
    }
    constexpr std::int32_t DATA_TABLE = static_cast<std::int32_t>(focas::PmcArea::d), BYTES = 0;
    const auto percent = [](double factor) {
      return static_cast<std::uint8_t>(std::clamp(std::lround(100.0 * factor), 1L, 254L));
    };
    const focas::Bytes bytes{percent(wanted.feed), percent(wanted.spindle)};
    const Status written = attempt(plainLine, [&] {
      const std::int32_t first = parameters_.override_data;
      focas::SubRequest request(focas::OP_PMC_WRITE, first, first + 1, DATA_TABLE, BYTES, bytes);
      request.c1 = 2;
      const focas::SubReply reply = client_.exchange({request}).front();
      if (reply.code != focas::EW_OK) {
        throw FocasError("pmc_wrpmcrng D" + std::to_string(first) + ": error " + std::to_string(reply.code),
                         reply.code);
      }
    });
    if (!written) {
      return written.failure();
    }
    return Overrides{0.01 * bytes[0], 0.01 * bytes[1]};
  }

  DialectOptions dialect() const override {
    DialectOptions options;
    options.marker_macro = parameters_.marker_macro;
    options.decimals = reader_.decimals();
    return options;
  }

  std::string orientProgram(double angle) const override {
    return cnc::orientProgram(angle, parameters_.orient_macro);
  }

  Status openPrograms() override {
    const Status started = attempt(sessionLine, [&] { client_.dncStart(); });
    if (!started) {
      return started;
    }
    // The marker of an earlier session must not end the first program.
    const Status cleared = attempt(plainLine, [&] { client_.writeMacro(parameters_.marker_macro, 0.0); });
    if (!cleared) {
      return cleared.lost() ? cleared : attempt(plainLine, [&] {
        client_.dncCancel();
        throw FocasError(cleared.failure().message, focas::EW_FUNC);
      });
    }
    open_ = first_piece_ = true;
    marker_ = 0;
    return {};
  }

  bool programsOpen() const override { return open_ && client_.connected(); }

  Status checkPrograms() override {
    if (client_.dncDeaf()) {
      // The controller would run the text in its buffer; a reset through the data circuit stops it.
      const Status reset = attempt(plainLine, [&] { client_.reset(); });
      return lost("connection to the " + name() + " lost: no reply on its DNC circuit; " +
                  (reset ? "it was reset" : "it could not be reset: USE THE PANEL"));
    }
    const Status status = attempt(endedLine, [&] { client_.dncCheck(); });
    open_ = open_ && status;
    return status;
  }

  Status closePrograms() override {
    if (!std::exchange(open_, false)) {
      return {};
    }
    return attempt(plainLine, [&] {
      const std::string text = "M30\n%\n";
      if (client_.dncSend(text.data(), text.size()) == text.size()) {
        client_.dncEnd();
      } else {
        client_.dncCancel();
      }
    });
  }

  void begin(const std::string& program) override {
    marker_ = marker_ >= MAX_MARKER ? 1 : marker_ + 1;
    // A control skips all text before the first end of block.
    text_ = (std::exchange(first_piece_, false) ? "\n" : "") + program + "#" +
            std::to_string(parameters_.marker_macro) + "=" + std::to_string(marker_) + "\n";
    sent_ = 0;
    complete_ = false;
  }

  Status send() override {
    const Status status = attempt(sessionLine, [&] {
      sent_ += client_.dncSend(text_.data() + sent_, text_.size() - sent_);
      complete_ = sent_ == text_.size() && client_.dncFlush() == 0;
    });
    open_ = open_ && status;
    return status;
  }

  Transfer transfer() const override { return {sent_, text_.size(), complete_}; }

  Status abandonPrograms() override {
    open_ = false;
    return attempt(plainLine, [&] { client_.dncCancel(); });
  }

  Status abort() override {
    // The DNC cancel alone may be delayed behind text in the stream. Not every controller permits a reset;
    // then the cancel must suffice.
    const Status reset = attempt(plainLine, [&] { client_.reset(); });
    return reset.lost() ? reset : abandonPrograms();
  }

 private:
  Failure lost(const std::string& why) {
    client_.drop();
    open_ = false;
    return {Failure::Kind::lost, why};
  }

  /// Calls the client and converts its exceptions to failures. @param line message of a FocasError
  template <class Line, class Call>
  Status attempt(Line line, Call&& call) {
    try {
      call();
      return {};
    } catch (const focas::ConnectionError& e) {
      return lost(e.what());
    } catch (const FocasError& e) {
      return Failure{kindOf(e.code()), line(e)};
    } catch (const std::exception& e) {
      return lost(e.what());
    }
  }

  FocasParameters parameters_;
  focas::Client client_;
  FocasReader reader_;
  bool open_ = false, first_piece_ = false, complete_ = false;
  int marker_ = 0;
  std::string text_;
  std::size_t sent_ = 0;  // [byte]
};

}  // namespace

void FocasParameters::validate() const {
  if (host.empty()) {
    throw Error("host: empty, expected a name or address");
  }
  checkBounds(*this);
  require(marker_macro != orient_macro, "marker_macro", marker_macro, "another variable than orient_macro");
}

std::unique_ptr<Controller> makeFocasController(const FocasParameters& parameters) {
  return std::make_unique<FocasController>(parameters);
}

}  // namespace smartmill::cnc
