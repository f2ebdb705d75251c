// label: unit
// SPDX-License-Identifier: Apache-2.0
// The live view's server, spoken to over bare sockets: friendly, mistaken and hostile.
#include "cli/live_view.hpp"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "palpate/core/error.hpp"

namespace palpate::cli::live_view_test {
namespace {

using testing::HasSubstr;
using testing::StartsWith;
using namespace std::chrono_literals;

struct Where {
  std::string address, token;
  int port = 0;
};

Where parts_of(const std::string& url) {
  const std::size_t colon = url.rfind(':'), slash = url.find('/', colon);
  return {url.substr(7, colon - 7), url.substr(slash + 1, url.size() - slash - 2), std::stoi(url.substr(colon + 1))};
}

/// Sends bytes, reads until the other side closes or is silent for two seconds. Empty: nobody answered the call.
std::string exchange(const std::string& address, int port, const std::string& bytes) {
  const int handle = socket(AF_INET, SOCK_STREAM, 0);
  const timeval patience{2, 0};
  setsockopt(handle, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(port));
  inet_pton(AF_INET, address.c_str(), &to.sin_addr);
  std::string answer;
  if (connect(handle, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0) {
    if (send(handle, bytes.data(), bytes.size(), MSG_NOSIGNAL) >= 0) {
      std::array<char, 65536> buffer;
      for (ssize_t count; (count = recv(handle, buffer.data(), buffer.size(), 0)) > 0;) {
        answer.append(buffer.data(), static_cast<std::size_t>(count));
      }
    }
  }
  close(handle);
  return answer;
}

std::string ask(const Where& where, const std::string& path, const std::string& method = "GET") {
  return exchange(where.address, where.port, method + " " + path + " HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
}

std::string body_of(const std::string& answer) {
  const std::size_t end = answer.find("\r\n\r\n");
  return end == std::string::npos ? "" : answer.substr(end + 4);
}

class LiveViewTest : public testing::Test {
 protected:
  LiveView view_{"127.0.0.1", 0, "cube", "<html>the page</html>"};
  Where where_ = parts_of(view_.url());
  std::string root_ = "/" + where_.token + "/";
  nlohmann::json state() { return nlohmann::json::parse(body_of(ask(where_, root_ + "state"))); }
};

TEST_F(LiveViewTest, ServesPageStateAndData) {
  EXPECT_THAT(view_.url(), StartsWith("http://127.0.0.1:"));
  const std::string page = ask(where_, root_);
  EXPECT_THAT(page, StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(page, HasSubstr("text/html"));
  EXPECT_THAT(page, HasSubstr("no-referrer"));
  EXPECT_EQ(body_of(page), "<html>the page</html>");
  EXPECT_EQ(state()["version"], 0);
  view_.progress("fit", 0.25);
  view_.update([] { return std::string("{\"so\": \"far\"}"); });
  const auto now = state();
  EXPECT_EQ(now["stage"], "fitting");
  EXPECT_EQ(now["share"], 0.25);
  EXPECT_EQ(now["title"], "cube");
  EXPECT_EQ(now["finished"], false);
  EXPECT_EQ(now["version"], 1);
  EXPECT_EQ(body_of(ask(where_, root_ + "data")), "{\"so\": \"far\"}");
  const std::string head = ask(where_, root_ + "data", "HEAD");
  EXPECT_THAT(head, HasSubstr("Content-Length: 13"));
  EXPECT_EQ(body_of(head), "");
}

TEST_F(LiveViewTest, TellsNothingWithoutTheToken) {
  std::string nearly = where_.token;
  nearly.back() = nearly.back() == '0' ? '1' : '0';
  const std::string other = parts_of(LiveView("127.0.0.1", 0, "", "").url()).token;
  EXPECT_EQ(where_.token.size(), 32u);
  EXPECT_NE(other, where_.token);
  std::string first;
  for (const std::string& path : {std::string("/"), std::string("/state"), std::string("/data"), "/" + nearly + "/",
                                  "/" + nearly + "/data", "/" + other + "/state", "/" + where_.token.substr(0, 31) + "/data",
                                  std::string("//") + where_.token + "/", "/" + where_.token, std::string("/report.html")}) {
    const std::string answer = ask(where_, path);
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 404")) << path;
    if (first.empty()) first = answer;
    EXPECT_EQ(answer, first) << path;  // a nearly right guess looks like any other
  }
}

TEST_F(LiveViewTest, ServesNoFileAndNoOtherPath) {
  for (const std::string path : {"../../etc/passwd", "..%2f..%2fetc%2fpasswd", "/etc/passwd", "data/../../state/x", "data/", "state ",
                                 "%2e%2e/", "....//", "data%00"}) {
    const std::string answer = ask(where_, root_ + path);
    EXPECT_THAT(answer, testing::Not(StartsWith("HTTP/1.1 200"))) << path;
    EXPECT_THAT(answer, testing::Not(HasSubstr("root:"))) << path;
  }
}

TEST_F(LiveViewTest, NothingCanBeWritten) {
  for (const std::string method : {"POST", "PUT", "DELETE", "PATCH", "OPTIONS"}) {
    EXPECT_THAT(ask(where_, root_ + "state", method), StartsWith("HTTP/1.1 405")) << method;
  }
  const std::string with_body = exchange(where_.address, where_.port,
                                         "POST " + root_ + "state HTTP/1.1\r\nHost: x\r\nContent-Length: 5000000\r\n\r\n" +
                                             std::string(100000, 'x'));
  EXPECT_THAT(with_body, testing::AnyOf(StartsWith("HTTP/1.1 405"), testing::IsEmpty()));
  EXPECT_EQ(state()["version"], 0);
}

TEST_F(LiveViewTest, NonsenseEndsThatConnectionOnly) {
  exchange(where_.address, where_.port, std::string("\0\1\2\xff\r\n\r\n", 8));
  exchange(where_.address, where_.port, "GET /" + std::string(100000, 'a') + " HTTP/1.1\r\n\r\n");
  exchange(where_.address, where_.port, "GET / HTTP/1.1\r\n" + std::string(100000, 'h'));
  EXPECT_EQ(state()["title"], "cube");
}

TEST_F(LiveViewTest, ListensWhereItWasToldAndNowhereElse) {
  EXPECT_NE(ask(where_, root_), "");
  Where elsewhere = where_;
  elsewhere.address = "127.0.0.2";
  EXPECT_EQ(ask(elsewhere, root_), "");
}

TEST_F(LiveViewTest, TakenPortAndForeignAddressAreSaidWithACure) {
  try {
    LiveView second("127.0.0.1", where_.port, "", "");
    FAIL() << "two views on one port";
  } catch (const Error& error) {
    EXPECT_EQ(error.where(), "127.0.0.1:" + std::to_string(where_.port));
    EXPECT_THAT(error.message(), HasSubstr("another program has this port"));
    EXPECT_THAT(error.message(), HasSubstr("or 0 for one that is free"));
  }
  EXPECT_THROW(LiveView("192.0.2.1", 0, "", ""), Error);  // kept free for documentation: no machine has it
  EXPECT_THROW(LiveView("localhost.", 0, "", ""), Error);
}

TEST_F(LiveViewTest, DataAreMadeWhenAskedForAndOnceAVersion) {
  std::atomic<int> made{0};
  for (int i = 0; i < 5; ++i) {
    view_.update([&] {
      ++made;
      return std::string("{}");
    });
  }
  EXPECT_EQ(made, 0);
  for (int i = 0; i < 3; ++i) ask(where_, root_ + "data");
  EXPECT_EQ(made, 1);
}

TEST_F(LiveViewTest, FaultWhileMakingDataEndsNothingElse) {
  view_.update([]() -> std::string { throw std::runtime_error("no memory"); });
  EXPECT_EQ(ask(where_, root_ + "data"), "");
  EXPECT_EQ(state()["version"], 1);
}

TEST_F(LiveViewTest, EndWaitsForWhoLooksAndForNobodyElse) {
  const auto start = std::chrono::steady_clock::now();
  LiveView unseen("127.0.0.1", 0, "", "");
  unseen.finish([] { return std::string("{}"); }, "done", 60s);
  EXPECT_LT(std::chrono::steady_clock::now() - start, 30s);

  state();  // somebody looks
  std::thread looker([this] {
    while (state()["finished"] != true) std::this_thread::sleep_for(20ms);
    std::this_thread::sleep_for(300ms);
    EXPECT_EQ(body_of(ask(where_, root_ + "data")), "{\"last\": true}");
  });
  view_.finish([] { return std::string("{\"last\": true}"); }, "Finished.", 60s);
  looker.join();
  EXPECT_EQ(state()["message"], "Finished.");
}

TEST_F(LiveViewTest, ManyThreadsAtOnce) {
  std::atomic<bool> over{false};
  std::vector<std::thread> lookers;
  for (int i = 0; i < 4; ++i) {
    lookers.emplace_back([&] {
      std::int64_t last = 0;
      while (!over) {
        const auto now = state();
        EXPECT_GE(now["version"], last);
        last = now["version"];
        const std::string data = body_of(ask(where_, root_ + "data"));
        if (!data.empty()) {
          EXPECT_GE(nlohmann::json::parse(data)["version"], last);
        }
      }
    });
  }
  for (int i = 1; i <= 200; ++i) {
    view_.progress(i % 2 ? "fit" : "posterior", i / 200.0);
    view_.update([i] { return "{\"version\": " + std::to_string(i) + "}"; });
    std::this_thread::sleep_for(1ms);
  }
  over = true;
  for (auto& looker : lookers) looker.join();
}

}  // namespace
}  // namespace palpate::cli::live_view_test
