// `platen report`: the page holds what the run folder holds, needs nothing else, and draws in a browser.
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <regex>

#include "protocol/report/report_page.h"
#include "protocol/report/run_data.h"
#include "protocol/report_command.h"
#include "tests/program.h"
#include "tests/sample_run.h"

namespace platen {
namespace {

using namespace sample;
using Json = nlohmann::json;

class Report : public OutputTest {};

Json data_of(const std::string& page) {
  const std::string open = "<script id=\"data\" type=\"application/json\">";
  const std::size_t begin = page.find(open), end = page.find("</script>", begin);
  if (begin == std::string::npos || end == std::string::npos) throw std::runtime_error("the page has no data");
  return Json::parse(page.substr(begin + open.size(), end - begin - open.size())).at("runs");
}

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t n = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++n;
  return n;
}

TEST_F(Report, ThePageHoldsTheRun) {
  write_run(root / "run");
  write_report(root / "run");
  const Json run = data_of(contents(root / "run/report.html")).at(0);
  EXPECT_EQ(run.at("title"), "sample: R = 2.5 mm, \u03c3");
  EXPECT_EQ(run.at("state"), "done (exit code 0)");
  EXPECT_EQ(run.at("state_hash"), "0000000000000abc");
  EXPECT_EQ(run.at("case"), case_text);
  ASSERT_EQ(run.at("stages").size(), 4u);
  EXPECT_EQ(run.at("stages").at(3).at("strength"), 5432.1);
  const Json& series = run.at("series");
  ASSERT_EQ(series.at("time").size(), 4u * rows_per_stage);
  for (int stage = 0; stage < 4; ++stage)
    for (int k = 0; k < rows_per_stage; ++k) {
      const auto at = static_cast<std::size_t>(stage * rows_per_stage + k);
      EXPECT_EQ(series.at("stage").at(at), stage);
      EXPECT_NEAR(series.at("porosity").at(at).get<double>(), row(stage, k).measures.porosity, 1e-6);
    }
  EXPECT_TRUE(series.at("inertial_number").at(0).is_null());
  // Strain of the whole stage, from results.h5, not what was known at the time.
  EXPECT_NEAR(series.at("strain").at(rows_per_stage).get<double>(), (0.243 - row(1, 0).measures.height) / 0.243, 1e-6);
  EXPECT_TRUE(series.at("strain").at(0).is_null());
  const Json& beds = run.at("beds");
  ASSERT_EQ(beds.size(), 4u);
  const double unit = run.at("particles").at("unit");
  EXPECT_EQ(run.at("particles").at("radius").size(), 40u);
  for (std::size_t k = 0; k < 120; ++k)
    EXPECT_NEAR(unit * beds.at(2).at("position").at(k).get<double>(), snapshot(2).particles.position[k], 0.5 * unit);
  EXPECT_FALSE(beds.at(0).contains("moved"));
  for (const Json& stage : run.at("stages")) EXPECT_TRUE(stage.contains("profile")) << stage.at("name");
}

TEST_F(Report, NeedsNothingElse) {
  write_run(root / "run");
  const std::string page = report_page({root / "run"});
  EXPECT_FALSE(std::regex_search(page.substr(0, page.find("<script>")), std::regex("(src|href)=")));
  EXPECT_EQ(count(page, "</html>"), 1u);
  EXPECT_NE(page.find("Released under the MIT License"), std::string::npos);
  EXPECT_NE(page.find("Permission is hereby granted"), std::string::npos);
}

TEST_F(Report, NoTextOfACaseEndsTheData) {
  {
    RunFolder run = RunFolder::create(root / "run", "[case]\ntitle = \"</script><script>alert(1)</script> & <b>\"\n", false);
    run.set_info(info());
    write_stage(run, 0);
  }
  const std::string page = report_page({root / "run"});
  EXPECT_EQ(data_of(page).at(0).at("title"), "</script><script>alert(1)</script> & <b>");
  EXPECT_EQ(count(page, "<script>alert"), 0u);
  EXPECT_EQ(count(page, "<title>&lt;/script&gt;"), 1u);
}

TEST_F(Report, ARunThatWasKilled) {
  write_half_a_run(root / "run");
  const Json run = data_of(report_page({root / "run"})).at(0);
  EXPECT_EQ(run.at("good"), false);
  ASSERT_EQ(run.at("stages").size(), 3u);
  EXPECT_EQ(run.at("stages").at(1).at("kind"), "compress");
  EXPECT_EQ(run.at("stages").at(1).at("end_reason"), "stress 40 kPa reached");
  EXPECT_EQ(run.at("stages").at(2).at("end_reason"), "not ended");
  EXPECT_EQ(run.at("series").at("stage").back(), 2);
  EXPECT_EQ(run.at("beds").size(), 2u);
}

// A name that every object has, and one with a slash: they end up in nobody's way.
TEST_F(Report, StagesOfAnyName) {
  {
    RunFolder run = RunFolder::create(root / "run", "[case]\ntitle = \"odd\"\n", false);
    run.set_info(info());
    StageResult stage = result(0);
    stage.name = "constructor", stage.last.stage = "constructor";
    SeriesRow r = row(0, 0);
    r.stage = "constructor";
    run.append(r, 0);
    run.close_stage(stage, snapshot(0), {});
    stage.name = "down/up";
    r.stage = "down/up", r.measures.step = 1;
    run.append(r, 1);
    run.close_stage(stage, snapshot(1), profile(snapshot(1), 1.0, 3));
  }
  const Json run = data_of(report_page({root / "run"})).at(0);
  EXPECT_FALSE(run.at("stages").at(0).contains("profile"));
  EXPECT_EQ(run.at("stages").at(1).at("profile").at("porosity").size(), 3u);
  EXPECT_EQ(run.at("beds").at(1).at("since"), "constructor");
}

TEST_F(Report, LongSeriesAreThinned) {
  {
    RunFolder run = RunFolder::create(root / "run", case_text, false);
    SeriesRow r = row(0, 0);
    for (int k = 0; k < 10001; ++k) {
      r.measures.step = k, r.measures.time = 1e-5 * k, r.stage = stage_names()[k < 7000 ? 0 : 1];
      r.measures.stress_top = k == 8765 ? 9e4 : 1e3 + 7 * (k % 11);
      run.append(r, k < 7000 ? 0 : 1);
    }
  }
  const Json series = data_of(report_page({root / "run"})).at(0).at("series");
  EXPECT_LE(series.at("time").size(), 4002u);
  EXPECT_GE(series.at("time").size(), 2000u);
  EXPECT_EQ(series.at("time").front(), 0.0);
  EXPECT_EQ(series.at("time").back(), 0.1);
  const std::vector<int> stage = series.at("stage");
  const auto second = static_cast<std::size_t>(std::find(stage.begin(), stage.end(), 1) - stage.begin());
  EXPECT_EQ(series.at("time").at(second), 0.07);       // the first row of a stage
  EXPECT_EQ(series.at("time").at(second - 1), 0.06999);  // the last one of the stage before
  const std::vector<double> stress = series.at("stress_top");
  EXPECT_EQ(*std::max_element(stress.begin(), stress.end()), 9e4) << "a peak of one row is lost";
  const std::vector<double> time = series.at("time");
  EXPECT_TRUE(std::is_sorted(time.begin(), time.end()));
}

TEST_F(Report, RunsOfOneNameAreToldApart) {
  write_run(root / "a/run");
  write_run(root / "b/run");
  const Json runs = data_of(report_page({root / "a/run", root / "b/run"}));
  EXPECT_EQ(runs.at(0).at("name"), (root / "a/run").string());
  EXPECT_EQ(runs.at(1).at("name"), (root / "b/run").string());
}

TEST_F(Report, OnTheCommandLine) {
  write_run(root / "run");
  test::ProgramOptions here;
  here.folder = root;
  test::ProgramResult result = test::run_program({"report", "run"}, here);
  EXPECT_EQ(result.exit_code, 0) << result.report();
  EXPECT_EQ(result.out, "report: run/report.html\n");
  EXPECT_TRUE(fs::exists(root / "run/report.html"));
  result = test::run_program({"report", "run", "run", "-o", "two.html", "-q"}, here);
  EXPECT_EQ(result.exit_code, 0) << result.report();
  EXPECT_EQ(result.out, "");
  EXPECT_TRUE(fs::exists(root / "two.html"));

  result = test::run_program({"report", "nowhere"}, here);
  EXPECT_EQ(result.exit_code, 5) << result.report();
  EXPECT_NE(result.err.find("nowhere: is not a run folder"), std::string::npos) << result.err;
  result = test::run_program({"report"}, here);
  EXPECT_EQ(result.exit_code, 2) << result.report();
  result = test::run_program({"report", "run", "-o", "no/such/folder/page.html"}, here);
  EXPECT_EQ(result.exit_code, 5) << result.report();
}

// Opens a page in Chromium; what its console says, and the page as it is then.
struct Drawn {
  std::string console, page;
};

Drawn draw(const fs::path& page, const fs::path& home) {
  test::ProgramOptions browser;
  browser.program = PLATEN_CHROMIUM;
  browser.timeout = 120.0;
  browser.environment = {{"HOME", home.string()}};
  const test::ProgramResult result =
      test::run_program({"--headless", "--no-sandbox", "--disable-dev-shm-usage", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--enable-logging=stderr",
                         "--virtual-time-budget=5000", "--window-size=1200,900", "--dump-dom", "file://" + page.string()}, browser);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  Drawn drawn;
  std::istringstream lines(result.err);
  for (std::string line; std::getline(lines, line);)
    if (line.find("CONSOLE") != std::string::npos) drawn.console += line + "\n";
  drawn.page = result.out.substr(0, result.out.find("<script"));  // what was drawn comes first
  return drawn;
}

TEST_F(Report, DrawsInABrowser) {
  if (std::string(PLATEN_CHROMIUM).empty()) GTEST_SKIP() << "chromium is not installed";
  write_run(root / "run");
  write_report(root / "run");
  const Drawn drawn = draw(root / "run/report.html", root);
  EXPECT_EQ(drawn.console, "");
  const std::string& page = drawn.page;
  for (const char* id : {"confined", "crush", "porosity", "coordination", "profile", "time", "rest", "energy"})
    EXPECT_EQ(count(page, "id=\"plot-" + std::string(id) + "\""), 1u) << id;
  EXPECT_NE(page.find("5.43 kPa"), std::string::npos);
  EXPECT_NE(page.find("made up warning"), std::string::npos);
  EXPECT_NE(page.find("R = 2.5 to 2.54 mm"), std::string::npos);
  const std::size_t view = page.find("id=\"view\"");
  ASSERT_NE(view, std::string::npos);
  EXPECT_NE(page.find("<canvas", view), std::string::npos) << page.substr(view, 300);
  EXPECT_EQ(page.find("cannot be drawn"), std::string::npos);
}

// A comparison whose reader looks at another run, and drags a frame in a plot: the page with a few lines that do so.
TEST_F(Report, AReaderMayChooseAndZoom) {
  if (std::string(PLATEN_CHROMIUM).empty()) GTEST_SKIP() << "chromium is not installed";
  write_run(root / "a");
  write_run(root / "b");
  std::string page = report_page({root / "a", root / "b"});
  const std::string reader =
      "<script>(function () { const select = document.querySelector('#choice select');"
      "for (const k of [1, 0, 1]) { select.value = k; select.dispatchEvent(new Event('change')); }"
      "for (const canvas of document.querySelectorAll('canvas')) { const box = canvas.getBoundingClientRect();"
      "const mouse = (type, x, y, on) => on.dispatchEvent(new MouseEvent(type, { bubbles: true, clientX: box.left + x * box.width, clientY: box.top + y * box.height }));"
      "mouse('mousedown', 0.3, 0.3, canvas); mouse('mousemove', 0.6, 0.6, canvas); mouse('mouseup', 0.7, 0.7, window); mouse('dblclick', 0.5, 0.5, canvas); }"
      "document.title = 'read'; console.log = null; })();</script>\n</body>";
  page.replace(page.rfind("</body>"), 7, reader);
  put(root / "page.html", page);
  const Drawn drawn = draw(root / "page.html", root);
  EXPECT_EQ(drawn.console, "");
  EXPECT_NE(drawn.page.find("<title>read</title>"), std::string::npos) << "the reader did not come to the end";
}

}  // namespace
}  // namespace platen
