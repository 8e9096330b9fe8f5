#pragma once

#include <sys/types.h>

#include <string>

namespace smartmill::loadmeter {

/// For tests and studies: private PostgreSQL server in a temporary folder, reached only by a socket in it and
/// removed with the object. Only the login "locked" requires a password.
class PrivateServer {
 public:
  /// Whether PostgreSQL is installed (./setup --with-fleet).
  static bool available();

  /// @param durable acknowledged transactions survive kill().
  /// @param folder existing folder for its data; empty: a temporary one
  explicit PrivateServer(bool durable = false, const std::string& folder = "");
  ~PrivateServer();
  PrivateServer(const PrivateServer&) = delete;
  PrivateServer& operator=(const PrivateServer&) = delete;

  /// @param login "owner" has all rights. @param password empty: none
  std::string url(const std::string& login, const std::string& password = "",
                  const std::string& database = "postgres") const;
  void makeDatabase(const std::string& name);
  /// Runs SQL as a login. @return whether it succeeded
  bool run(const std::string& login, const std::string& database, const std::string& sql) const;
  void start();
  void stop();
  void kill();  ///< kills it and its children; the next start() recovers

 private:
  int execute(const std::string& command) const;

  bool durable_, own_;
  std::string folder_;
};

}  // namespace smartmill::loadmeter
