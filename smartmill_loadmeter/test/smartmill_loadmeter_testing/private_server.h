#pragma once

#include <sys/types.h>

#include <string>

namespace smartmill::loadmeter {

/// For tests and studies: a PostgreSQL of its own in a folder of /tmp, reached by a socket in it and by
/// nothing else; gone with its object. Nobody but a login named "locked" is asked for a password.
class PrivateServer {
 public:
  /// Whether its programs are installed (./setup --with-fleet).
  static bool available();

  /// @param durable what it acknowledges survives kill().
  /// @param folder for its data, which must be there; empty: one of its own, removed with it
  explicit PrivateServer(bool durable = false, const std::string& folder = "");
  ~PrivateServer();
  PrivateServer(const PrivateServer&) = delete;
  PrivateServer& operator=(const PrivateServer&) = delete;

  /// @param login "owner" may do everything. @param password empty: none is told
  std::string url(const std::string& login, const std::string& password = "",
                  const std::string& database = "postgres") const;
  void makeDatabase(const std::string& name);
  /// Runs SQL as somebody. @return whether all of it was done
  bool run(const std::string& login, const std::string& database, const std::string& sql) const;
  void start();
  void stop();
  void kill();  ///< with SIGKILL, its children with it; the next start() recovers

 private:
  int execute(const std::string& command) const;

  bool durable_, own_;
  std::string folder_;
};

}  // namespace smartmill::loadmeter
