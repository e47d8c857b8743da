#include "protocol/report/report_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "protocol/report/page_parts.h"
#include "protocol/report/run_data.h"

namespace platen {
namespace {

using Json = nlohmann::ordered_json;

// JSON within a script element: no text of a case may end it.
std::string for_script(const Json& data) {
  const std::string json = data.dump(-1, ' ', false, Json::error_handler_t::replace);
  std::string safe;
  for (const char c : json) c == '<' ? safe += "\\u003c" : safe += c;
  return safe;
}

std::string for_html(const std::string& text) {
  std::string safe;
  for (const char c : text) c == '<' ? safe += "&lt;" : c == '>' ? safe += "&gt;" : c == '&' ? safe += "&amp;" : safe += c;
  return safe;
}

// Runs of one name are told apart by their folders.
void tell_apart(std::vector<Json>& runs) {
  std::map<std::string, int> times;
  for (const Json& run : runs) ++times[run["name"].get<std::string>()];
  for (Json& run : runs)
    if (times[run["name"].get<std::string>()] > 1) run["name"] = run["folder"];
}

constexpr const char* licence =
    "Permission is hereby granted, free of charge, to any person obtaining a copy of this software and associated documentation files (the \"Software\"), to deal in the Software without "
    "restriction, including without limitation the rights to use, copy, modify, merge, publish, distribute, sublicense, and/or sell copies of the Software, and to permit persons to whom the "
    "Software is furnished to do so, subject to the following conditions: The above copyright notice and this permission notice shall be included in all copies or substantial portions of the "
    "Software. THE SOFTWARE IS PROVIDED \"AS IS\", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR "
    "PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, "
    "ARISING FROM, OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE.";

}  // namespace

std::string report_page(const std::vector<std::filesystem::path>& folders) {
  std::vector<Json> runs;
  for (const std::filesystem::path& folder : folders) runs.push_back(run_data(folder));
  tell_apart(runs);
  const bool beds = std::any_of(runs.begin(), runs.end(), [](const Json& run) { return !run["beds"].empty(); });
  const std::string title = runs.size() > 1 ? fmt::format("{} runs", runs.size()) : runs.front()["title"].get<std::string>();

  std::string page = fmt::format("<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
                                 "<meta name=\"generator\" content=\"platen {}\">\n<title>{}</title>\n<style>\n",
                                 PLATEN_VERSION, for_html(title.empty() ? runs.front()["name"].get<std::string>() : title));
  page.append(page_parts::css).append("</style>\n</head>\n<body>\n").append(page_parts::html);
  page += fmt::format("<footer><main><details><summary>Made by platen {}. With Chart.js{}</summary>\n<p>Chart.js, copyright 2014-2022 Chart.js Contributors{}: MIT licence.</p>\n<p>{}</p></details></main></footer>\n",
                      PLATEN_VERSION, beds ? " and three.js" : "", beds ? "; three.js, copyright 2010-2019 three.js authors" : "", for_html(licence));
  page += "<noscript>This page draws with JavaScript.</noscript>\n<script id=\"data\" type=\"application/json\">";
  page += for_script({{"runs", runs}});
  page += "</script>\n";
  const auto script = [&](std::string_view text) { page.append("<script>\n").append(text).append("\n</script>\n"); };
  script(page_parts::chart);
  if (beds) script(page_parts::three), script(page_parts::controls);
  script(page_parts::script);
  return page + "</body>\n</html>\n";
}

}  // namespace platen
