// Stages of the case file, and what stages, plates, box and particles must agree on.
#include "case_texts.h"

namespace platen {
namespace {

using test::errors_of;
using test::expect_error;
using test::good_case;
using test::replaced;

// good_case with further stages; the first added line is line 21.
Case with(const std::string& stages) { return parse_case(good_case + stages, "case.toml", "."); }

void refused(const std::string& stages, const std::string& begin, const std::string& part = "") {
  expect_error(good_case + stages, "case.toml:" + begin, part);
}

TEST(CaseStages, EveryKind) {
  const Case c = parse_case(replaced("kind = \"fill\"", "kind = \"fill\"\nmethod = \"grow\"\nporosity = 0.45") + R"(
[[stage]]
kind = "vibrate"
frequency = "60 Hz"
amplitude = "1.5 mm"
duration = "2 s"
[[stage]]
kind = "settle"
until = { window = "0.05 s" }
frames = "off"
[[stage]]
kind = "unload"
speed = 0.01
[[stage]]
kind = "hold"
stress = "10 kPa"
duration = "100 s"
[[stage]]
kind = "release"
max_duration = "5 s"
[[stage]]
kind = "crush"
speed = "10 mm/s"
until = { strain = 0.2, drop = 0.2 }
start_gap = "0.1 mm"
frames = "5 ms"
[[stage]]
kind = "run"
until = { duration = "1 s" }
[[stage]]
kind = "compress"
speed = 1
until = { displacement = "1 mm" }
strain_zero = "1 kPa"
)",
                            "case.toml", ".");
  const auto& s = c.stages;
  ASSERT_EQ(s.size(), 10u);
  EXPECT_EQ(s[0].method, FillMethod::grow);
  EXPECT_EQ(*s[0].porosity, 0.45);
  EXPECT_EQ(s[2].frequency, 60.0);
  EXPECT_EQ(s[2].amplitude, 1.5e-3);
  EXPECT_EQ(*s[2].duration, 2.0);
  EXPECT_EQ(s[3].until.window, 0.05);
  EXPECT_EQ(s[3].until.kinetic_to_potential, 1e-5);
  EXPECT_EQ(*s[3].frames, 0.0);
  EXPECT_EQ(*s[4].until.stress, 0.0) << "unload goes to 0 when nothing else is said";
  EXPECT_EQ(s[5].stress, 10e3);
  EXPECT_GT(s[5].max_duration, 100.0) << "the default never ends a stage before its own duration";
  EXPECT_EQ(s[6].max_duration, 5.0);
  EXPECT_EQ(s[7].strain_zero, 20.0);
  EXPECT_EQ(*s[7].until.drop, 0.2);
  EXPECT_EQ(*s[7].start_gap, 1e-4);
  EXPECT_EQ(*s[8].duration, 1.0);
  EXPECT_EQ(s[8].max_duration, 60.0);
  EXPECT_EQ(s[9].name, "compress-2");
  EXPECT_EQ(s[9].strain_zero, 1e3);
  EXPECT_EQ(*s[9].until.displacement, 1e-3);
}

TEST(CaseStages, KindAndName) {
  refused("[[stage]]\nkind = \"setle\"\n",
          "22:8: stage.setle.kind: \"setle\" is unknown; allowed: \"fill\", \"vibrate\"", "nearest known word: settle");
  refused("[[stage]]\nname = \"x\"\n", "21:1: stage.x.kind: is missing");
  refused("[[stage]]\nkind = \"settle\"\nname = \"compress\"\n",
          "23:8: stage.compress.name: stage 3 has the name \"compress\" of stage 2");
  refused("[[stage]]\nkind = \"settle\"\nname = \"a/b\"\n", "23:8: stage.3.name: is not a good name");
  EXPECT_EQ(with("[[stage]]\nkind = \"settle\"\n[[stage]]\nkind = \"settle\"\nname = \"my rest\"\n").stages[3].name,
            "my rest");
}

TEST(CaseStages, ABedMustHaveRoomForASphere) {
  const auto complaint = [](const std::vector<std::string>& overrides) -> std::string {
    try {
      parse_case(good_case, "case.toml", ".", overrides);
    } catch (const CaseError& error) {
      return error.what();
    }
    return "";
  };
  const std::vector<std::string> grown{"stage.fill.method=\"grow\"", "stage.fill.porosity=0.4", "particles.count=50", "box.width=\"150 mm\"", "box.depth=\"50 mm\""};
  EXPECT_NE(complaint(grown).find("50 spheres make a bed of 0.0007272 m, less than a diameter"), std::string::npos) << complaint(grown);
  // What counts is the largest sphere that is drawn, not the largest that could be.
  EXPECT_NO_THROW(parse_case(test::replaced("radius = \"2.5 mm\"", "sizes = { kind = \"lognormal\", median = \"2 mm\", sigma = 0.3, min = \"1 mm\", max = \"14 mm\" }"), "case.toml", ".",
                             {"stage.fill.method=\"grow\"", "stage.fill.porosity=0.45", "particles.count=150", "box.sides=\"walls\"", "box.width=\"28 mm\"", "box.depth=\"28 mm\""}));
  const std::vector<std::string> open{"box.sides=\"open\"", "box.width=\"4 mm\""};
  EXPECT_NE(complaint(open).find("box.width: 0.004 m is narrower than the largest sphere"), std::string::npos) << complaint(open);
}

TEST(CaseStages, NoStages) {
  const std::string without = good_case.substr(0, good_case.find("[[stage]]"));
  expect_error(without, "case.toml:1:1: stage: there are no stages; allowed: at least one [[stage]]");
  expect_error(without + "[stage]\nkind = \"fill\"\n",
               "case.toml:15:2: stage: is a table, wrong type; allowed: [[stage]] with double brackets");
  expect_error("stage = []\n" + without, "case.toml:1:9: stage: there are no stages");
}

TEST(CaseStages, PorosityNeedsSides) {
  const std::string press = "[[stage]]\nkind = \"compress\"\nspeed = 0.01\nuntil = { porosity = 0.4 }\n";
  const Case c = parse_case(good_case, "case.toml", ".", {"stage.compress.until.porosity=0.4"});
  EXPECT_EQ(c.stages.at(1).until.porosity, 0.4);
  try {
    parse_case(good_case + "[[stage]]\nkind = \"release\"\n" + press, "case.toml", ".", {});
    ADD_FAILURE() << "was taken";
  } catch (const CaseError& error) {
    EXPECT_NE(std::string(error.what()).find("until.porosity needs sides"), std::string::npos) << error.what();
  }
}

TEST(CaseStages, KeysOfAnotherKind) {
  refused("[[stage]]\nkind = \"settle\"\nspeed = 1\n",
          "23:1: stage.settle.speed: unknown key; allowed in a settle stage: kind, name, max_duration, frames, until");
  refused("[[stage]]\nkind = \"settle\"\nuntil = { stress = 1 }\n",
          "23:11: stage.settle.until.stress: unknown key; allowed in until of a settle stage: kinetic_to_potential");
  refused("[[stage]]\nkind = \"unload\"\nspeed = 1\nstrain_zero = 5\n", "24:1: stage.unload.strain_zero: unknown key");
  refused("[[stage]]\nkind = \"unload\"\nspeed = 1\nuntil = { porosity = 0.5 }\n",
          "24:11: stage.unload.until.porosity: unknown key");
  expect_error(replaced("{ stress = \"40 kPa\" }", "{ drop = 0.2, strain = 0.1 }"),
               "case.toml:20:11: stage.compress.until.drop: unknown key");
  expect_error(replaced("kind = \"fill\"", "kind = \"fill\"\nporosity = 0.4"),
               "case.toml:17:1: stage.fill.porosity: unknown key");
}

TEST(CaseStages, StagesThatCanNeverEnd) {
  expect_error(replaced("until = { stress = \"40 kPa\" }\n", ""),
               "case.toml:17:1: stage.compress.until: is missing or empty, the stage can never end");
  expect_error(replaced("{ stress = \"40 kPa\" }", "{ }"), "case.toml:20:9: stage.compress.until: is missing or empty");
  refused("[[stage]]\nkind = \"crush\"\nspeed = 1\n", "21:1: stage.crush.until: is missing or empty");
  refused("[[stage]]\nkind = \"run\"\n", "21:1: stage.run.duration: is missing, the stage can never end");
  refused("[[stage]]\nkind = \"hold\"\nstress = 1\n", "21:1: stage.hold.duration: is missing");
  expect_error(
      replaced("kind = \"compress\"", "kind = \"unload\"", replaced("{ stress = \"40 kPa\" }", "{ strain = 0.1 }")),
      "case.toml:18:8: stage.unload: strain has no zero before a compress or crush stage");
}

TEST(CaseStages, ImpossibleValues) {
  refused("[[stage]]\nkind = \"vibrate\"\nfrequency = 1\namplitude = 0.001\nduration = 0.5\n",
          "25:12: stage.vibrate.duration: holds 0.5 of a period; allowed: frequency * duration >= 1");
  refused("[[stage]]\nkind = \"vibrate\"\nfrequency = \"2 s\"\namplitude = 0.001\nduration = 5\n",
          "23:13: stage.vibrate.frequency: \"2 s\" has the wrong dimension, it is not a frequency");
  expect_error(replaced("\"10 mm/s\"", "0"),
               "case.toml:19:9: stage.compress.speed: 0 is out of range; allowed: a speed > 0");
  expect_error(replaced("\"40 kPa\"", "0"),
               "case.toml:20:20: stage.compress.until.stress: 0 is out of range; allowed: a stress > 0");
  refused("[[stage]]\nkind = \"crush\"\nspeed = 1\nuntil = { strain = 0.2, drop = 1 }\n",
          "24:32: stage.crush.until.drop: 1 is out of range; allowed: a plain number in (0, 1)");
  refused("[[stage]]\nkind = \"run\"\nduration = -1\n", "23:12: stage.run.duration: -1 is out of range");
  refused("[[stage]]\nkind = \"run\"\nduration = 1\nuntil = { duration = 2 }\n",
          "23:12: stage.run.duration: is given twice");
  refused("[[stage]]\nkind = \"settle\"\nmax_duration = 0\n", "23:16: stage.settle.max_duration: 0 is out of range");
  expect_error(replaced("kind = \"fill\"", "kind = \"fill\"\nmethod = \"grow\""),
               "case.toml:15:1: stage.fill.porosity: is missing");
  expect_error(replaced("kind = \"fill\"", "kind = \"fill\"\nmethod = \"snow\""),
               "case.toml:17:10: stage.fill.method: \"snow\" is unknown; allowed: \"rain\", \"grow\"");
}

TEST(CaseStages, RainsThatCannotBe) {
  const auto rain = [](const std::string& keys) { return replaced("kind = \"fill\"", "kind = \"fill\"\n" + keys); };
  EXPECT_EQ(errors_of(rain("duration = 5\noutlet = \"0.3 m\"")), "accepted");
  expect_error(rain("outlet = 0.3"), "case.toml:17:10: stage.fill.outlet: is given without duration");
  expect_error(rain("duration = 5\ndrop_speed = 0"), "case.toml:18:14: stage.fill.drop_speed: is 0, so that nothing would come out");
  expect_error(rain("duration = \"0.01 s\""), "case.toml:16:8: stage.fill: duration = 0.01 s is too short for 100 spheres to come out at 0.5 m/s; allowed: at least 0.0582 s");
  expect_error(rain("method = \"grow\"\nporosity = 0.5\nduration = 5"), "case.toml:19:1: stage.fill.duration: unknown key");
}

TEST(CaseStages, WhereParticlesComeFrom) {
  expect_error(replaced("[[stage]]\nkind = \"fill\"\n", ""),
               "case.toml:7:9: particles.count: nothing makes the particles");
  refused("[[stage]]\nkind = \"fill\"\n", "22:8: stage.fill-2: fill is not the first stage");
}

TEST(CaseStages, PlatesThatStagesNeed) {
  refused("[plates]\ntop = false\n", "18:8: stage.compress: compress moves the top plate, but there is none");
  for (const char* kind : {"unload", "crush"}) {
    const std::string text =
        replaced("kind = \"compress\"", "kind = \"" + std::string(kind) + "\"") + "[plates]\ntop = false\n";
    expect_error(text, "case.toml:18:8: stage." + std::string(kind) + ": " + kind + " moves the top plate");
  }
  const std::string no_compress = good_case.substr(0, good_case.rfind("[[stage]]"));
  expect_error(no_compress + "[[stage]]\nkind = \"hold\"\nstress = 1\nduration = 1\n[plates]\ntop = false\n",
               "case.toml:18:8: stage.hold: hold moves the top plate");
  expect_error(no_compress + "[plates]\nbottom = false\n",
               "case.toml:16:8: stage.fill: fill by rain needs the bottom plate");
  expect_error(
      replaced("kind = \"fill\"", "kind = \"fill\"\nmethod = \"grow\"\nporosity = 0.5") +
          "[[stage]]\nkind = \"vibrate\"\nfrequency = 60\namplitude = 0.001\nduration = 1\n[plates]\nbottom = false\n",
      "case.toml:24:8: stage.vibrate: vibrate moves the bottom plate, but there is none");
}

TEST(CaseStages, RainNeedsGravity) {
  refused("[environment]\ngravity = 0\n",
          "16:8: stage.fill: fill by rain needs gravity; allowed: environment.gravity > 0");
}

TEST(CaseStages, BoxThatIsNeeded) {
  const std::string box = "[box]\nwidth = \"30 mm\"\ndepth = \"30 mm\"\nheight = \"80 mm\"\n";
  expect_error(replaced(box, ""),
               "case.toml:1:1: box: is missing; allowed: [box] with width, depth, height, or no plates");
  const std::string open = errors_of(replaced(box, "[box]\nsides = \"open\"\n"));
  EXPECT_NE(open.find("case.toml:11:1: box.width: is missing"), std::string::npos) << open;
}

TEST(CaseStages, ReleaseOfOpenSides) {
  refused("[[stage]]\nkind = \"release\"\n[[stage]]\nkind = \"release\"\n",
          "24:8: stage.release-2: the sides are open already");
  expect_error(
      replaced("height = \"80 mm\"", "height = \"80 mm\"\nsides = \"open\"") + "[[stage]]\nkind = \"release\"\n",
      "case.toml:23:8: stage.release: the sides are open already");
  EXPECT_EQ(with("[[stage]]\nkind = \"release\"\n").stages.size(), 3u);
  EXPECT_EQ(errors_of(replaced("height = \"80 mm\"", "height = \"80 mm\"\nsides = \"walls\"") +
                      "[[stage]]\nkind = \"release\"\n"),
            "accepted");
}

TEST(CaseStages, GrowthNeedsClosedSides) {
  expect_error(replaced("kind = \"fill\"", "kind = \"fill\"\nmethod = \"grow\"\nporosity = 0.5",
                        replaced("height = \"80 mm\"", "height = \"80 mm\"\nsides = \"open\"")),
               "case.toml:17:8: stage.fill: fill by growth needs closed sides");
}

}  // namespace
}  // namespace platen
