// `platen info`: text for people and JSON for machines say the same.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "protocol/info.h"
#include "tests/sample_run.h"

namespace platen {
namespace {

using namespace sample;
using Json = nlohmann::json;

class Info : public OutputTest {};

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST_F(Info, FinishedRun) {
  write_run(root / "run");
  const std::string text = describe(root / "run", false);
  for (const char* part : {"sample: R = 2.5 mm, \u03c3", "0000000000000abc", "exit code 0", "stress 40 kPa reached",
                           "6.33 kPa", "unconfined strength 5.43 kPa"})
    EXPECT_TRUE(has(text, part)) << part << "\n" << text;
  EXPECT_FALSE(has(text, "wall time"));
  const Json json = Json::parse(describe(root / "run", true));
  EXPECT_EQ(json.at("kind"), "run");
  EXPECT_EQ(json.at("finished"), true);
  EXPECT_EQ(json.at("state_hash"), "0000000000000abc");
  EXPECT_EQ(json.at("stages").size(), 4u);
}

TEST_F(Info, RunThatIsStillGoing) {
  const RunFolder run = write_half_a_run(root / "run");
  const std::string series = contents(root / "run/series.csv");
  const std::string text = describe(root / "run", false);
  for (const char* part : {"running", "stress 40 kPa reached", "not ended", "unload"})
    EXPECT_TRUE(has(text, part)) << part << "\n" << text;
  const Json json = Json::parse(describe(root / "run", true));
  EXPECT_EQ(json.at("finished"), false);
  EXPECT_EQ(json.at("stages").at(2).at("values").at("porosity"), row(2, 1).measures.porosity);
  EXPECT_NEAR(json.at("stages").at(2).at("time").get<double>(), 1e-3, 1e-15);
  EXPECT_EQ(contents(root / "run/series.csv"), series);  // looking changes nothing
}

TEST_F(Info, RunThatWasKilled) {
  {
    RunFolder run = RunFolder::create(root / "run", case_text, false);
    run.set_info(info());
    write_stage(run, 0);
  }
  const std::string text = describe(root / "run", false);
  EXPECT_TRUE(has(text, "nobody works on it")) << text;
}

TEST_F(Info, Hdf5File) {
  write_run(root / "run");
  const std::string text = describe(root / "run/results.h5", false);
  EXPECT_TRUE(has(text, "/contacts/normal_force")) << text;
  EXPECT_TRUE(has(text, "hysteretic normal force without damping")) << text;
  EXPECT_TRUE(has(text, "40 x 3")) << text;
  EXPECT_TRUE(has(text, "[rad/s]")) << text;
  const Json json = Json::parse(describe(root / "run/results.h5", true));
  int found = 0;
  for (const Json& d : json.at("datasets")) {
    if (d.at("path") == "/series/stress_top") {
      EXPECT_EQ(d.at("unit"), "Pa");
      EXPECT_EQ(d.at("shape"), Json::array({20}));
      EXPECT_EQ(d.at("type"), "float64");
      ++found;
    }
    if (d.at("path") == "/stages/crush/particles/position" || d.at("path") == "/particles/position") ++found;
  }
  EXPECT_EQ(found, 3);
}

TEST_F(Info, CaseFile) {
  put(root / "spheres.toml",
      "[case]\ntitle = \"two spheres\"\nseed = 3\n[particles]\nradius = \"2.5 mm\"\ndensity = 2000\ncount = 20\n"
      "[particles.law]\nk1 = \"5 kN/m\"\nk2 = \"25 kN/m\"\nk_adh = 0\nf0 = 0\nrestitution = 0.4\nfriction = 0.5\n"
      "rolling_friction = 0.001\n[box]\nwidth = \"50 mm\"\ndepth = \"50 mm\"\nheight = \"0.1 m\"\nsides = \"periodic\"\n"
      "[[stage]]\nkind = \"fill\"\n[[stage]]\nkind = \"compress\"\nspeed = \"10 mm/s\"\nuntil = { stress = \"40 kPa\" }\n");
  const std::string text = describe(root / "spheres.toml", false);
  for (const char* part : {"two spheres", "20 spheres, radius 2.5 mm", "50 x 50 x 100 mm", "periodic", "k1 = 5000",
                           "10 mm/s, until 40 kPa"})
    EXPECT_TRUE(has(text, part)) << part << "\n" << text;
  const Json json = Json::parse(describe(root / "spheres.toml", true));
  EXPECT_EQ(json.at("kind"), "case");
  EXPECT_EQ(json.at("particles").at("count"), 20);
  EXPECT_EQ(json.at("stages").at(1).at("name"), "compress");
}

TEST_F(Info, AnythingElseIsAnError) {
  put(root / "notes.txt", "text");
  fs::create_directory(root / "empty");
  EXPECT_THROW(describe(root / "notes.txt", false), OutputError);
  EXPECT_THROW(describe(root / "empty", false), OutputError);
  EXPECT_THROW(describe(root / "nothing", true), OutputError);
  put(root / "bad.toml", "[case\n");
  EXPECT_THROW(describe(root / "bad.toml", false), CaseError);
  // A run whose files were damaged.
  write_run(root / "run", 1);
  put(root / "run/summary.json", "{\"stages\":[{}],");
  EXPECT_THROW(describe(root / "run", false), OutputError);
  put(root / "run/summary.json", "{}");
  EXPECT_THROW(describe(root / "run", false), OutputError);
}

}  // namespace
}  // namespace platen
