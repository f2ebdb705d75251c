// SPDX-License-Identifier: Apache-2.0
#include "cli/web_server.hpp"

#include <fmt/format.h>

#include <atomic>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <chrono>
#include <string_view>
#include <thread>
#include <utility>

#include "palpate/core/error.hpp"

namespace palpate::cli {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
namespace net = boost::asio;
using net::ip::tcp;

constexpr std::size_t largest_request = 8192;  // bytes; a page of a browser asks with some hundred
constexpr int most_connections = 32;
constexpr auto patience = std::chrono::seconds(15);  // with a slow or silent other side

http::response<http::string_body> respond(http::status status, const http::request<http::empty_body>& request,
                                          WebServer::Content content) {
  http::response<http::string_body> response{status, request.version()};
  response.set(http::field::content_type, content.type);
  response.set(http::field::cache_control, "no-store");
  response.set(http::field::x_frame_options, "DENY");
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Referrer-Policy", "no-referrer");  // the address holds the token
  response.set("Cross-Origin-Resource-Policy", "same-origin");
  if (status == http::status::method_not_allowed) response.set(http::field::allow, "GET, HEAD");
  response.keep_alive(request.keep_alive());
  const std::size_t size = content.body.size();
  if (request.method() != http::verb::head) response.body() = std::move(content.body);
  response.content_length(size);
  return response;
}

/// One connection: request after request until the other side leaves. Lives as long as something is under way.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(tcp::socket socket, const WebServer::Answer& answer, std::atomic<int>& count)
      : stream_(std::move(socket)), answer_(answer), count_(count) {
    ++count_;
  }
  ~Connection() { --count_; }

  void read() {
    parser_.emplace();
    parser_->header_limit(largest_request);
    stream_.expires_after(patience);
    // The header says all; who sends a body as well is answered and left.
    http::async_read_header(stream_, buffer_, *parser_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (error) return;
      const bool whole = self->parser_->is_done();
      self->write(self->parser_->release(), whole);
    });
  }

 private:
  void write(const http::request<http::empty_body>& request, bool may_go_on) {
    auto response = std::make_shared<http::response<http::string_body>>(answer(request));
    if (!may_go_on) response->keep_alive(false);
    stream_.expires_after(patience);
    http::async_write(stream_, *response, [self = shared_from_this(), response](beast::error_code error, std::size_t) {
      if (!error && response->keep_alive()) self->read();
    });
  }

  http::response<http::string_body> answer(const http::request<http::empty_body>& request) const {
    if (request.method() != http::verb::get && request.method() != http::verb::head) {
      return respond(http::status::method_not_allowed, request, {"text/plain", "this page can only be read\n"});
    }
    const std::string target(request.target());
    auto content = answer_(target.substr(0, target.find('?')));
    if (!content) return respond(http::status::not_found, request, {"text/plain", "there is nothing here\n"});
    return respond(http::status::ok, request, std::move(*content));
  }

  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{2 * largest_request};
  std::optional<http::request_parser<http::empty_body>> parser_;
  const WebServer::Answer& answer_;
  std::atomic<int>& count_;
};

}  // namespace

struct WebServer::Impl {
  explicit Impl(Answer given) : answer(std::move(given)) {}

  void listen(const std::string& address, int port) {
    const std::string where = fmt::format("{}:{}", address, port);
    beast::error_code error;
    const auto ip = net::ip::make_address(address, error);
    if (error) throw Error("is no address; give numbers as in 127.0.0.1 or ::1", address);
    const tcp::endpoint endpoint(ip, static_cast<unsigned short>(port));
    acceptor.open(endpoint.protocol(), error);
    if (!error) acceptor.set_option(net::socket_base::reuse_address(true), error);
    if (!error) acceptor.bind(endpoint, error);
    if (!error) acceptor.listen(net::socket_base::max_listen_connections, error);
    if (error == net::error::address_in_use) {
      throw Error("another program has this port; give another one, or 0 for one that is free", where);
    }
    if (error == net::error::access_denied) {
      throw Error("this port is for the administrator; give one above 1023, or 0 for one that is free", where);
    }
    if (error) throw Error("cannot listen here: " + error.message(), where);
  }

  void accept() {
    acceptor.async_accept([this](beast::error_code error, tcp::socket socket) {
      if (error == net::error::operation_aborted) return;
      if (error) {  // say, no more files may be open: that passes, and must not be asked in a circle
        pause.expires_after(std::chrono::milliseconds(200));
        pause.async_wait([this](beast::error_code stopped) { stopped ? void() : accept(); });
        return;
      }
      // Too many: the socket closes as it goes out of scope.
      if (connections < most_connections) {
        std::make_shared<Connection>(std::move(socket), answer, connections)->read();
      }
      accept();
    });
  }

  void run() {
    while (!context.stopped()) {
      try {
        context.run();
      } catch (const std::exception&) {
        // One connection's fault (say, no memory for its answer) ends that connection, not the work that is shown.
      }
    }
  }

  Answer answer;
  std::atomic<int> connections{0};
  net::io_context context{1};
  tcp::acceptor acceptor{context};
  net::steady_timer pause{context};
  std::thread thread;
};

WebServer::WebServer(const std::string& address, int port, Answer answer) : impl_(std::make_unique<Impl>(std::move(answer))) {
  impl_->listen(address, port);
  impl_->accept();
  impl_->thread = std::thread([impl = impl_.get()] { impl->run(); });
}

WebServer::~WebServer() {
  impl_->context.stop();
  impl_->thread.join();
}

int WebServer::port() const { return impl_->acceptor.local_endpoint().port(); }

}  // namespace palpate::cli
