#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace smartmill::session {

/// Actions of a session that need not be repeated when it is continued, in the order of their start.
class SessionProgress {
 public:
  struct Action {
    std::string name;          ///< of the step
    std::string holder;        ///< node whose memory contains the result; empty: every node restores it
    std::uint32_t starts = 0;  ///< of the holder in this launch, at the start of the action
    bool lane = false;         ///< cuts a lane of the stock
    bool done = false;
    std::string detail;  ///< result in words
  };

  /// What the session is about: tool, material, sensor. Another session does not continue it.
  std::string subject;
  /// Summary of the session so far, as JSON.
  std::string summary;

  void begin(const std::string& name, const std::string& holder, std::uint32_t starts, bool lane);
  /// Ends the last action.
  void end(const std::string& detail);
  /// A holder that has been restarted has lost the results of its earlier starts.
  void restarted(const std::string& holder, std::uint32_t starts);
  std::vector<std::string> holders() const;

  /// The first action of this name with a result, which is used up by this; later ones of the name remain.
  std::optional<Action> take(const std::string& name);
  /// Lanes that were cut, in whole or in part, without a result that remains.
  std::size_t lostLanes() const;
  bool cutLanes() const;  ///< any lane was cut

  std::string text() const;  ///< JSON
  /// @throws Error if the text is not that of text().
  static SessionProgress of(const std::string& text);

 private:
  struct Entry {
    Action action;
    bool taken = false;
  };
  std::vector<Entry> entries_;
};

}  // namespace smartmill::session
