// SPDX-License-Identifier: Apache-2.0
#include "palpate/report/report.hpp"

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string_view>

#include "palpate/core/error.hpp"
#include "palpate/report/payload.hpp"
#include "palpate/report/template.hpp"
#include "palpate/report/words.hpp"

namespace palpate::report {
namespace {

constexpr std::string_view data_mark = "<!--palpate:data-->";
constexpr std::string_view data_open = "<script type=\"application/json\" id=\"palpate-data\">";
constexpr std::string_view data_close = "</script>";

/// JSON that may stand inside a script element: no character that HTML or JavaScript could take for markup is left.
std::string script_safe(const std::string& json_text) {
  std::string safe;
  safe.reserve(json_text.size() + 64);
  for (std::size_t i = 0; i < json_text.size(); ++i) {
    switch (json_text[i]) {
      case '<':
        safe += "\\u003c";
        break;
      case '>':
        safe += "\\u003e";
        break;
      case '&':
        safe += "\\u0026";
        break;
      default:
        safe += json_text[i];
    }
  }
  return safe;
}

std::string html_safe(std::string_view text) {
  std::string safe;
  for (const char c : text) {
    switch (c) {
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      case '&':
        safe += "&amp;";
        break;
      case '"':
        safe += "&quot;";
        break;
      case '\'':
        safe += "&#39;";
        break;
      default:
        safe += c;
    }
  }
  return safe;
}

/// What a reader without scripts sees: the answer and the verdicts.
std::string plain_answer(const Identification& identification) {
  std::string text = "<noscript><p>" + html_safe(answer(identification)) + "</p><ul>";
  for (const Verdict& verdict : identification.verdicts) text += "<li>" + html_safe(verdict.message) + "</li>";
  return text + "</ul><p>The figures need JavaScript, which this browser does not run.</p></noscript>";
}

std::size_t place_of(std::string_view mark, const std::string& page) {
  const std::size_t place = page.find(mark);
  if (place == std::string::npos) throw Error("the page's template has lost its " + std::string(mark), "report");
  return place;
}

/// Names come from files: bytes that are no UTF-8 are replaced. ASCII only, so that no browser can guess a wrong encoding.
std::string as_text(const nlohmann::json& data) {
  return data.dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
}

}  // namespace

std::string page_data(const Identification& identification, const Recording* recording, const ReportOptions& options) {
  constexpr std::size_t room_for_words = 300'000;  // tables, posterior, names
  PayloadOptions fitted;
  fitted.title = options.title;
  fitted.running = options.running;
  const std::size_t fixed = page_template().size() + room_for_words;
  fitted.max_bytes = options.max_bytes > fixed + 100'000 ? options.max_bytes - fixed : 100'000;
  return as_text(payload(identification, recording, fitted));
}

std::string live_page() {
  std::string page = page_template();
  // The page may ask its own server, and nobody else, for data; everything else stays forbidden.
  constexpr std::string_view policy = "default-src 'none';";
  page.insert(place_of(policy, page) + policy.size(), " connect-src 'self';");
  page.replace(place_of(data_mark, page), data_mark.size(), "<meta name=\"palpate-live\" content=\"state\">");
  return page;
}

std::string html(const Identification& identification, const Recording* recording, const ReportOptions& options) {
  const std::string page = page_template();
  const std::size_t mark = place_of(data_mark, page);
  const std::string text = page_data(identification, recording, options);

  std::string result = page.substr(0, mark);
  result += plain_answer(identification);
  result += data_open;
  result += script_safe(text);
  result += data_close;
  result += page.substr(mark + data_mark.size());
  return result;
}

void write_report(const Identification& identification, const Recording* recording, const std::filesystem::path& path,
                  const ReportOptions& options) {
  const std::string page = html(identification, recording, options);
  std::filesystem::path unfinished = path;
  unfinished += ".part";
  {
    std::ofstream file(unfinished, std::ios::binary);
    file << page;
    file.flush();
    if (!file) throw Error("cannot write the report; is the folder there and is the disk full?", path.string());
  }
  std::error_code problem;
  std::filesystem::rename(unfinished, path, problem);
  if (problem) throw Error("cannot write the report: " + problem.message(), path.string());
}

std::string read_report_data(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Error("cannot open the report; give the folder that `palpate estimate -o` wrote", path.string());
  const std::string page{std::istreambuf_iterator<char>(file), {}};
  const std::size_t begin = page.find(data_open);
  const std::size_t end = begin == std::string::npos ? begin : page.find(data_close, begin);
  if (end == std::string::npos) throw Error("this is no report of palpate: it carries no data", path.string());
  return page.substr(begin + data_open.size(), end - begin - data_open.size());
}

}  // namespace palpate::report
