// SPDX-License-Identifier: Apache-2.0
#include "cli/live_view.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <random>

#include "cli/session.hpp"

namespace palpate::cli {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto lately = std::chrono::seconds(5);             // a page that looks asks about once a second
constexpr auto for_others = std::chrono::milliseconds(1500);  // a second page may be about to ask as well

std::string new_token() {
  std::random_device source;  // from the system: nobody can guess it
  std::string token;
  for (int i = 0; i < 4; ++i) token += fmt::format("{:08x}", source());
  return token;
}

/// Takes the same time for every wrong secret.
bool same_secret(std::string_view given, std::string_view secret) {
  if (given.size() != secret.size()) return false;
  unsigned difference = 0;
  for (std::size_t i = 0; i < secret.size(); ++i) difference |= static_cast<unsigned>(given[i] ^ secret[i]);
  return difference == 0;
}

}  // namespace

LiveView::LiveView(const std::string& address, int port, std::string title, std::string page)
    : token_(new_token()),
      title_(std::move(title)),
      page_(std::move(page)),
      stage_start_(Clock::now()),
      server_(address, port, [this](const std::string& path) { return answer(path); }) {
  const bool six = address.find(':') != std::string::npos;
  url_ = fmt::format("http://{}{}{}:{}/{}/", six ? "[" : "", address, six ? "]" : "", server_.port(), token_);
}

void LiveView::progress(std::string_view stage, double share) {
  const std::scoped_lock lock(mutex_);
  if (stage != stage_) {
    stage_ = stage;
    stage_start_ = Clock::now();
  }
  share_ = share;
}

void LiveView::update(MakeData data) {
  const std::scoped_lock lock(mutex_);
  make_ = std::move(data);
  ++version_;
}

void LiveView::finish(MakeData data, std::string message, std::chrono::milliseconds patience) {
  std::unique_lock lock(mutex_);
  make_ = std::move(data);
  ++version_;
  finished_ = true;
  message_ = std::move(message);
  if (Clock::now() - last_asked_ > lately) return;
  if (asked_.wait_for(lock, patience, [this] { return sent_version_ == version_; })) {
    lock.unlock();
    std::this_thread::sleep_for(for_others);
  }
}

std::optional<WebServer::Content> LiveView::answer(const std::string& path) {
  const std::size_t end = path.find('/', 1);
  if (path.empty() || end == std::string::npos || !same_secret(std::string_view(path).substr(1, end - 1), token_)) return {};
  const std::string what = path.substr(end + 1);
  if (what.empty()) return WebServer::Content{"text/html; charset=utf-8", page_};
  if (what == "state") return WebServer::Content{"application/json", state()};
  if (what == "data") return WebServer::Content{"application/json", data()};
  return {};
}

std::string LiveView::state() {
  const std::scoped_lock lock(mutex_);
  last_asked_ = Clock::now();
  const auto left_s = time_left_s(std::chrono::duration<double>(last_asked_ - stage_start_).count(), share_);
  const nlohmann::json state = {{"title", title_},
                                {"stage", stage_words(stage_)},
                                {"share", share_},
                                {"time_left_s", left_s ? nlohmann::json(*left_s) : nlohmann::json()},
                                {"version", version_},
                                {"finished", finished_},
                                {"message", message_}};
  return state.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
}

std::string LiveView::data() {
  std::unique_lock lock(mutex_);
  const std::int64_t version = version_;
  if (made_version_ != version && make_) {
    const MakeData make = make_;
    lock.unlock();  // encoding meshes takes a while, and the work must not wait for those who look
    std::string made = make();
    lock.lock();
    made_ = std::move(made);
    made_version_ = version;
  }
  sent_version_ = std::max(sent_version_, version);
  asked_.notify_all();
  return made_;
}

}  // namespace palpate::cli
