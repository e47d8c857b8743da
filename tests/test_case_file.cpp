// Tables of the case file: good cases, every kind of mistake with its place and wording, overrides.
#include "case_texts.h"

#include <filesystem>
#include <random>

namespace platen {
namespace {

using test::errors_of;
using test::expect_error;
using test::good_case;
using test::replaced;

TEST(CaseFile, GoodCaseWithDefaults) {
  const Case c = parse_case(good_case, "case.toml", ".");
  EXPECT_EQ(c.title, "small");
  EXPECT_EQ(c.seed, 7u);
  EXPECT_EQ(c.particles.sizes.radius, 2.5e-3);
  EXPECT_EQ(c.particles.count, 100);
  EXPECT_EQ(c.particles.law.k2, 25e3);
  EXPECT_EQ(c.particles.law.k_adh, 0.0);
  EXPECT_EQ(c.particles.law.friction, 0.5);
  EXPECT_EQ(c.particles.law.tangential_ratio, 2.0 / 7.0);
  EXPECT_TRUE(c.plates.top && c.plates.bottom);
  EXPECT_EQ(c.plates.law.particle_young_modulus, 2.6e8);
  EXPECT_EQ(c.box.sides, Sides::periodic);
  EXPECT_TRUE(c.box.given);
  EXPECT_EQ(c.gravity, 9.81);
  EXPECT_FALSE(c.time.step);
  EXPECT_EQ(c.time.safety, 0.3);
  EXPECT_FALSE(c.output.frames);
  EXPECT_EQ(c.output.checkpoint, 60.0);
  EXPECT_FALSE(c.engine.skin || c.engine.inner_gap || c.engine.batch);
  ASSERT_EQ(c.stages.size(), 2u);
  EXPECT_EQ(c.stages[1].name, "compress");
  EXPECT_EQ(c.stages[1].strain_zero, 5e3);
  EXPECT_EQ(*c.stages[1].until.stress, 40e3);
  EXPECT_EQ(c.text, good_case) << "the text is kept as it was written";
}

TEST(CaseFile, WordsAndNumbersOfEverySection) {
  const Case c = parse_case(good_case + R"([time]
step = 1e-5
[output]
frames = "50 ms"
checkpoint = "off"
slabs = 5
contacts = false
[engine]
skin = "0.5 mm"
batch = 64
inner_gap = "auto"
check_every = 8
[environment]
gravity = 0.5
)",
                            "case.toml", ".");
  EXPECT_EQ(*c.time.step, 1e-5);
  EXPECT_EQ(*c.output.frames, 0.05);
  EXPECT_EQ(c.output.checkpoint, 0.0);
  EXPECT_EQ(c.output.slabs, 5);
  EXPECT_FALSE(c.output.contacts);
  EXPECT_EQ(*c.engine.skin, 5e-4);
  EXPECT_EQ(*c.engine.batch, 64);
  EXPECT_EQ(c.engine.check_every, 8);
  EXPECT_EQ(c.gravity, 0.5);
}

TEST(CaseFile, ShippedCasesParse) {
  int cases = 0;
  for (const auto& entry : std::filesystem::directory_iterator(PLATEN_SOURCE_DIR "/protocol/cases")) {
    if (entry.path().extension() != ".toml") continue;
    ++cases;
    const Case c = read_case(entry.path());
    EXPECT_GE(c.stages.size(), 5u) << entry.path();
    if (entry.path().stem() == "quick") continue;
    EXPECT_FALSE(c.time.step) << "the automatic step";
    const bool unequal = entry.path().stem() == "distribution";
    EXPECT_EQ(c.particles.sizes.kind == SizeDistribution::Kind::mono, !unequal);
    EXPECT_EQ(c.particles.count, unequal ? 5100 : 17213);
    EXPECT_EQ(c.particles.law.f0, entry.path().stem() == "cohesive" ? -0.4 : unequal ? -0.9 : 0.0);
    EXPECT_EQ(c.particles.law.k_adh, entry.path().stem() == "load-dependent" ? 5e3 : 0.0);
  }
  EXPECT_EQ(cases, 5);
}

TEST(CaseFile, SizeDistributions) {
  const auto with = [](const std::string& sizes) {
    return parse_case(replaced("radius = \"2.5 mm\"", "sizes = " + sizes), "case.toml", ".").particles.sizes;
  };
  SizeDistribution s = with(R"({ kind = "lognormal", median = "2.5 mm", sigma = 0.2, min = "1.5 mm", max = "4 mm" })");
  EXPECT_EQ(s.kind, SizeDistribution::Kind::lognormal);
  EXPECT_EQ(s.largest(), 4e-3);
  EXPECT_EQ(s.smallest(), 1.5e-3);
  EXPECT_EQ(s.sigma, 0.2);
  s = with(R"({ kind = "normal", mean = "2.5 mm", sigma = "0.2 mm", min = "1.5 mm", max = "4 mm" })");
  EXPECT_EQ(s.median, 2.5e-3);
  EXPECT_EQ(s.sigma, 0.2e-3);
  s = with(R"({ kind = "uniform", min = "1 mm", max = 0.002 })");
  EXPECT_EQ(s.largest(), 2e-3);
  s = with(R"({ kind = "list", radii = ["1 mm", 0.002, "3 mm"], weights = [1, 2.5, 0] })");
  EXPECT_EQ(s.largest(), 2e-3) << "a weight of 0 never occurs";
  EXPECT_EQ(s.smallest(), 1e-3);
  EXPECT_EQ(s.basis, SizeDistribution::Basis::number);
  s = with(R"({ kind = "cumulative", basis = "volume", radii = ["1 mm", "2 mm", "4 mm"], below = [0, 0.5, 1] })");
  EXPECT_EQ(s.basis, SizeDistribution::Basis::volume);
  EXPECT_EQ(s.smallest(), 1e-3);
  EXPECT_EQ(s.largest(), 4e-3);
}

TEST(CaseFile, BadSizeDistributions) {
  const auto refused = [](const std::string& sizes, const std::string& key, const std::string& part) {
    const std::string said = errors_of(replaced("radius = \"2.5 mm\"", "sizes = " + sizes));
    EXPECT_NE(said.find("particles.sizes." + key + ": "), std::string::npos) << said;
    EXPECT_NE(said.find(part), std::string::npos) << said;
  };
  refused(R"({ kind = "lognorm", min = 1, max = 2 })", "kind", "nearest known word: lognormal");
  refused(R"({ kind = "uniform", min = "2 mm", max = "1 mm" })", "min", "min < max");
  refused(R"({ kind = "uniform", min = "1 mm", max = "2 mm", sigma = 1 })", "sigma", "unknown key");
  refused(R"({ kind = "lognormal", median = "5 mm", sigma = 0.2, min = "1 mm", max = "4 mm" })", "median",
          "not between");
  refused(R"({ kind = "lognormal", median = "3 mm", sigma = "0.2 mm", min = "1 mm", max = "4 mm" })", "sigma",
          "no dimension");
  refused(R"({ kind = "list", radii = ["1 mm", "2 mm"], weights = [1] })", "weights", "one weight for each radius");
  refused(R"({ kind = "list", radii = ["1 mm"], weights = [0] })", "weights", "at least one weight > 0");
  refused(R"({ kind = "list", radii = [] })", "radii", "is empty");
  // How long it must rain is not asked of sizes that are wrong.
  for (const char* sizes : {R"({ kind = "list", radii = ["1 mm", "2 mm"], weights = [1] })", R"({ kind = "lognormal", median = "5 mm", sigma = 0.2, min = "1 mm", max = "4 mm" })"})
    EXPECT_THROW(parse_case(replaced("radius = \"2.5 mm\"", std::string("sizes = ") + sizes), "case.toml", ".", {"stage.fill.duration=\"5 s\""}), CaseError);
  refused(R"({ kind = "lognormal", median = "2 mm", sigma = 1e7, min = "1.999 mm", max = "2.001 mm" })", "sigma", "almost nothing of the distribution");
  refused(R"({ kind = "uniform", basis = "mass", min = "1 mm", max = "2 mm" })", "basis", "allowed: \"number\", \"volume\"");
  refused(R"({ kind = "cumulative", radii = ["1 mm", "1 mm"], below = [0, 1] })", "radii", "each larger than the one before");
  refused(R"({ kind = "cumulative", radii = ["1 mm", "2 mm"], below = [1, 0] })", "below", "none smaller than the one before");
  refused(R"({ kind = "cumulative", radii = ["1 mm", "2 mm"], below = [0.5, 0.5] })", "below", "larger than the first");
  refused(R"({ kind = "cumulative", radii = ["1 mm", "2 mm"], below = [0, 50] })", "below", "[0, 1]");
  refused(R"({ kind = "cumulative", radii = ["1 mm", "2 mm"], below = [1] })", "below", "one part for each radius");
  refused(R"({ kind = "cumulative", radii = ["1 mm"], below = [1] })", "radii", "two or more");
}

TEST(CaseFile, UnknownKeyNamesTheNearest) {
  expect_error(replaced("seed = 7", "sed = 7"), "case.toml:3:1: case.sed: unknown key; allowed in case: title, seed",
               "; nearest known key: seed");
  expect_error(replaced("k2 = \"25 kN/m\"", "k2 = \"25 kN/m\"\nfrction = 0.5"),
               "case.toml:11:1: particles.law.frction: unknown key; allowed in particles.law: ",
               "; nearest known key: friction");
  expect_error(good_case + "[enviroment]\ngravity = 9.81\n", "case.toml:21:2: enviroment: unknown key",
               "nearest known key: environment");
  EXPECT_EQ(errors_of(replaced("seed = 7", "zzzzzzzzzzzz = 7")).find("nearest"), std::string::npos)
      << "nothing is proposed where nothing is near";
}

TEST(CaseFile, WrongDimension) {
  expect_error(replaced("\"2.5 mm\"", "\"2.5 kg\""),
               "case.toml:5:10: particles.radius: \"2.5 kg\" has the wrong dimension, it is not a length; allowed: a "
               "length > 0");
  expect_error(replaced("seed = 7", "seed = 7\n[environment]\ngravity = \"10 mm/s\""),
               "case.toml:5:11: environment.gravity: \"10 mm/s\" has the wrong dimension, it is not an acceleration");
}

TEST(CaseFile, DimensionlessKeysTakeNoUnit) {
  expect_error(replaced("k2 = \"25 kN/m\"", "k2 = \"25 kN/m\"\nfriction = \"0.5 m\""),
               "case.toml:11:12: particles.law.friction: \"0.5 m\" is a string, but this key has no dimension",
               "allowed: a plain number >= 0");
}

TEST(CaseFile, WrongTypes) {
  expect_error(replaced("count = 100", "count = 10.5"), "case.toml:7:9: particles.count: is a real number, wrong type",
               "a whole number");
  expect_error(replaced("seed = 7", "seed = \"x\""), "case.toml:3:8: case.seed: is a string, wrong type");
  expect_error(replaced("\"small\"", "5"),
               "case.toml:2:9: case.title: is a whole number, wrong type; allowed: a string");
  expect_error(replaced("\"2.5 mm\"", "true"), "case.toml:5:10: particles.radius: is true or false, wrong type");
  expect_error(replaced("\"2.5 mm\"", "2024-01-01"),
               "case.toml:5:10: particles.radius: is a date or time of day, wrong type");
  expect_error("plates = 3\n" + good_case, "case.toml:1:10: plates: is a whole number, wrong type; allowed: a table");
  expect_error(good_case + "[plates]\ntop = 1\n",
               "case.toml:22:7: plates.top: is a whole number, wrong type; allowed: true or false");
}

TEST(CaseFile, NotFinite) {
  for (const char* bad : {"nan", "inf", "-inf", "\"nan mm\"", "\"inf mm\""}) {
    expect_error(replaced("\"2.5 mm\"", bad), "case.toml:5:10: particles.radius: ", "not a finite number");
  }
}

TEST(CaseFile, ImpossibleValues) {
  const auto law = [](const std::string& line) { return replaced("k2 = \"25 kN/m\"", "k2 = \"25 kN/m\"\n" + line); };
  const std::string at = "case.toml:11:";
  expect_error(replaced("\"2.5 mm\"", "0"),
               "case.toml:5:10: particles.radius: 0 is out of range; allowed: a length > 0");
  expect_error(replaced("\"2000 kg/m3\"", "-5"),
               "case.toml:6:11: particles.density: -5 is out of range; allowed: a density > 0");
  expect_error(replaced("count = 100", "count = 0"), "case.toml:7:9: particles.count: 0 is out of range");
  expect_error(replaced("25 kN/m", "1 kN/m"),
               "case.toml:10:6: particles.law.k2: 1000 is smaller than k1 = 5000; allowed: k2 >= k1");
  expect_error(law("f0 = \"0.4 N\""), at + "6: particles.law.f0: \"0.4 N\" is out of range; allowed: a force <= 0");
  expect_error(law("restitution = 0"),
               at + "15: particles.law.restitution: 0 is out of range; allowed: a plain number in (0, 1]");
  expect_error(law("restitution = 1.01"), at + "15: particles.law.restitution: 1.01 is out of range");
  expect_error(law("k_adh = -1"), at + "9: particles.law.k_adh: -1 is out of range; allowed: a stiffness >= 0");
  expect_error(law("exponent = 0"), at + "12: particles.law.exponent: 0 is out of range");
  expect_error(good_case + "[plates]\npoisson_ratio = 0.6\n",
               "case.toml:22:17: plates.poisson_ratio: 0.6 is out of range; allowed: a plain number in (-1, 0.5]");
  expect_error(good_case + "[plates]\nparticle_poisson_ratio = -1\n",
               "case.toml:22:26: plates.particle_poisson_ratio: -1 is out of range");
  expect_error(good_case + "[engine]\ncheck_every = 0\n",
               "case.toml:22:15: engine.check_every: 0 is out of range; allowed: a whole number from 1");
  expect_error(good_case + "[environment]\ngravity = -9.81\n",
               "case.toml:22:11: environment.gravity: -9.81 is out of range; allowed: an acceleration >= 0");
}

TEST(CaseFile, UnknownWords) {
  expect_error(replaced("height = \"80 mm\"", "height = \"80 mm\"\nsides = \"periodc\""),
               "case.toml:15:9: box.sides: \"periodc\" is unknown; allowed: \"periodic\", \"walls\", \"open\"",
               "nearest known word: periodic");
  expect_error(good_case + "[time]\nstep = \"automatic\"\n",
               "case.toml:22:8: time.step: \"automatic\" is unknown; allowed: \"auto\" or a time > 0");
  expect_error(good_case + "[engine]\nbatch = \"all\"\n",
               "case.toml:22:9: engine.batch: \"all\" is unknown; allowed: \"auto\" or a whole number");
  expect_error(good_case + "[particles.law.x]\n", "case.toml:21:16: particles.law.x: unknown key");
}

TEST(CaseFile, MissingKeysPointAtTheTable) {
  expect_error(replaced("density = \"2000 kg/m3\"\n", ""),
               "case.toml:4:1: particles.density: is missing; allowed: a density > 0");
  expect_error(replaced("k1 = \"5 kN/m\"\n", ""), "case.toml:8:1: particles.law.k1: is missing");
  expect_error(replaced("radius = \"2.5 mm\"\n", ""),
               "case.toml:4:1: particles.radius: is missing; allowed: exactly one of radius, sizes, file");
  expect_error(replaced("height = \"80 mm\"\n", ""), "case.toml:11:1: box.height: is missing");
  EXPECT_NE(errors_of("").find("case.toml:1:1: particles: is missing"), std::string::npos);
  EXPECT_NE(errors_of("").find("stage: there are no stages"), std::string::npos);
}

TEST(CaseFile, ExponentsOtherThanOneTakePlainStiffnesses) {
  const std::string text = replaced("k1 = \"5 kN/m\"", "exponent = 1.5\nk1 = 5e4");
  expect_error(text,
               "case.toml:11:6: particles.law.k2: \"25 kN/m\" is a string, but with an exponent other than 1 "
               "stiffnesses are in N/m^n");
  EXPECT_EQ(errors_of(replaced("\"25 kN/m\"", "25e4", text)), "accepted");
}

TEST(CaseFile, PeriodicBoxTooNarrow) {
  // R = 2.5 mm, automatic skin 0.3 R: 4 R + 2 skin = 11.5 mm.
  expect_error(replaced("width = \"30 mm\"", "width = \"11.4 mm\""),
               "case.toml:12:9: box.width: 0.0114 m is too narrow", ">= 4 R_max + 2 skin = 0.0115 m");
  EXPECT_EQ(errors_of(replaced("width = \"30 mm\"", "width = \"11.6 mm\"")), "accepted");
  expect_error(replaced("depth = \"30 mm\"", "depth = \"11.6 mm\"") + "[engine]\nskin = \"1 mm\"\n",
               "case.toml:13:9: box.depth: 0.0116 m is too narrow", "0.012 m");
  EXPECT_EQ(errors_of(replaced("depth = \"30 mm\"", "depth = \"6 mm\"\nsides = \"walls\"")), "accepted");
  expect_error(replaced("depth = \"30 mm\"", "depth = \"4 mm\"\nsides = \"walls\""),
               "case.toml:13:9: box.depth: 0.004 m is narrower than the largest sphere");
}

TEST(CaseFile, AllErrorsAtOnceInTheOrderOfTheFile) {
  std::string text = replaced("seed = 7", "seed = -1");
  text = replaced("25 kN/m", "25 kPa", text);
  text = replaced("speed = \"10 mm/s\"", "sped = 1", text);
  const std::string said = errors_of(text);
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 3) << said;
  EXPECT_LT(said.find("case.seed"), said.find("particles.law.k2"));
  EXPECT_LT(said.find("particles.law.k2"), said.find("stage.compress.speed: is missing"));
  EXPECT_NE(said.find("stage.compress.sped: unknown key"), std::string::npos);
}

TEST(CaseFile, SyntaxErrorAloneWithCaret) {
  EXPECT_EQ(errors_of("[case]\nsed = 1\nseed = = 3\n"),
            "case.toml:3:8: TOML syntax: Error while parsing value: could not determine value type\n  seed = = 3\n     "
            "    ^");
  EXPECT_NE(errors_of("[case]\nseed = 1\nseed = 2\n").find("case.toml:3:"), std::string::npos) << "a key given twice";
}

TEST(CaseFile, Overrides) {
  const auto with = [](const std::vector<std::string>& o) { return parse_case(good_case, "case.toml", ".", o); };
  EXPECT_EQ(with({"stage.compress.speed=\"20 mm/s\""}).stages[1].speed, 20e-3);
  EXPECT_EQ(with({"stage.compress.speed=20 mm/s"}).stages[1].speed, 20e-3) << "the shell ate the quotes";
  EXPECT_EQ(with({"stage.2.speed=0.5"}).stages[1].speed, 0.5);
  EXPECT_EQ(with({"engine.batch=7"}).engine.batch, 7) << "the table is made";
  EXPECT_EQ(with({"box.sides=walls"}).box.sides, Sides::walls);
  EXPECT_EQ(*with({"stage.compress.until={ strain = 0.1 }"}).stages[1].until.strain, 0.1);
  EXPECT_EQ(*with({"stage.compress.until.strain=0.1"}).stages[1].until.stress, 40e3) << "the other goal stays";
  EXPECT_EQ(with({"case.seed=3", "case.seed=4"}).seed, 4u) << "the last one wins";
  EXPECT_EQ(with({"stage.compress.name=press", "stage.press.speed=1"}).stages[1].speed, 1.0);
}

TEST(CaseFile, OverriddenTextReadsBackTheSame) {
  const Case c =
      parse_case(good_case, "case.toml", ".",
                 {"case.title=\"a \\\"b\\\" \\u0007 ü\"", "particles.density=0.1", "particles.radius=2.5e-3"});
  const Case again = parse_case(c.text, "case.toml", ".");
  EXPECT_EQ(again.title, "a \"b\" \a ü");
  EXPECT_EQ(again.particles.density, 0.1);
  EXPECT_EQ(again.particles.sizes.radius, 2.5e-3);
  EXPECT_EQ(again.stages.size(), 2u);
  EXPECT_EQ(*again.stages[1].until.stress, 40e3);
  EXPECT_EQ(again.text, c.text);
}

TEST(CaseFile, BadOverrides) {
  const auto refused = [](const std::string& o, const std::string& message, const std::string& part = "") {
    expect_error(good_case, "--set " + o + ": " + message, part, {o});
  };
  refused("stage.compres.speed=1", "stage.compres: there is no such stage; allowed: 1 fill, 2 compress",
          "nearest known stage: compress");
  refused("stage.3.speed=1", "stage.3: there is no such stage");
  refused("stage.2=1", "stage.2: is a whole stage");
  refused("engine.bach=1", "engine.bach: unknown key; allowed in engine: ", "nearest known key: batch");
  refused("particls.count=3", "particls: unknown key", "nearest known key: particles");
  refused("stage.compress.speed=fast", "stage.compress.speed: \"fast\" does not begin with a number",
          "TOML strings need quotes");
  refused("stage.compress.speed=-1", "stage.compress.speed: -1 is out of range");
  refused("particles.radius.x=1", "particles.radius: is a string and has no keys");
  refused("particles.radius", "there is no value");
  refused("particles.radius=", "there is no value");
  refused("=1", "the key is empty");
  refused("case.title=\xff", "the value is not UTF-8");
}

TEST(CaseFile, LawOnlyNeedsOnlyTheLaw) {
  const std::string law = "[particles.law]\nk1 = 1\nk2 = 2\n";
  EXPECT_EQ(parse_case(law, "law.toml", ".", {}, CaseUse::law_only).particles.law.k2, 2.0);
  EXPECT_EQ(errors_of(good_case, {}, ".", CaseUse::law_only), "accepted");
  EXPECT_NE(errors_of(law + "[plates]\nfriction = -1\n", {}, ".", CaseUse::law_only)
                .find("plates.friction: -1 is out of range"),
            std::string::npos);
  EXPECT_NE(errors_of("", {}, ".", CaseUse::law_only).find("particles: is missing"), std::string::npos);
}

TEST(CaseFile, MissingFile) {
  EXPECT_THROW(read_case("no/such/case.toml"), CaseError);
  EXPECT_THROW(read_case("."), CaseError);
}

// Any bytes either read or are refused; nothing crashes, nothing else is thrown.
TEST(CaseFile, AnyBytesAreSafe) {
  std::mt19937 random(2);
  for (int i = 0; i < 3000; ++i) {
    std::string text = good_case;
    for (std::size_t n = 1 + random() % 8; n > 0; --n) {
      const std::size_t at = random() % text.size();
      switch (random() % 4) {
        case 0:
          text[at] = static_cast<char>(random() % 256);
          break;
        case 1:
          text.erase(at, 1 + random() % 20);
          break;
        case 2:
          text.insert(at, 1, "=.[]{}\"'#\n,x1-"[random() % 14]);
          break;
        default:
          text.insert(at, text.substr(random() % text.size(), random() % 60));
          break;
      }
    }
    EXPECT_FALSE(errors_of(text).empty());
  }
  std::string deep;
  for (int i = 0; i < 100000; ++i) deep += "a.";
  EXPECT_NE(errors_of(deep + "b = 1\n").find("nested too deeply"), std::string::npos);
  EXPECT_NE(errors_of("[" + deep + "b]\n").find("nested too deeply"), std::string::npos);
  EXPECT_NE(errors_of("a = " + std::string(100000, '[')).find("TOML syntax"), std::string::npos);
}

}  // namespace
}  // namespace platen
