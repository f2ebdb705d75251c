// SPDX-License-Identifier: Apache-2.0
// A small web server for reading: answers GET and HEAD with what a function says, on its own thread.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

namespace palpate::cli {

class WebServer {
 public:
  struct Content {
    std::string type;  ///< e.g. "application/json"
    std::string body;
  };
  /// Path of the request ("/a/b", without query) to what it answers; nothing: not found. Called on the server's thread.
  using Answer = std::function<std::optional<Content>(const std::string& path)>;

  /// Listens from here on. @param port  0: one that is free
  /// @throws Error when the port is taken, or the address is none of this machine
  WebServer(const std::string& address, int port, Answer answer);
  /// Stops; what is not sent by then is lost.
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  int port() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::cli
