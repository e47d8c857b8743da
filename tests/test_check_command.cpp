// `platen check`: derived values against their formulas, the expected time, the two forms of output.
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "case_texts.h"
#include "program.h"
#include "protocol/check_command.h"

namespace platen::test {
namespace {

constexpr double pi = 3.14159265358979323846;

Case good(const std::vector<std::string>& overrides = {}) { return parse_case(good_case, "case.toml", ".", overrides); }

double mass(double R) { return 4.0 / 3.0 * pi * R * R * R * 2000.0; }

TEST(CheckCommand, EqualSpheres) {
  const SphereFacts f = sphere_facts(good());
  EXPECT_EQ(f.count, 100);
  EXPECT_TRUE(f.equal);
  EXPECT_DOUBLE_EQ(f.mass_min, mass(2.5e-3));
  EXPECT_DOUBLE_EQ(f.mass_max, mass(2.5e-3));
  EXPECT_DOUBLE_EQ(f.mass_total, 100.0 * mass(2.5e-3));
  EXPECT_DOUBLE_EQ(f.solid_volume, 100.0 * mass(2.5e-3) / 2000.0);
  EXPECT_DOUBLE_EQ(f.density, 2000.0);
}

TEST(CheckCommand, DistributedSpheres) {
  const Case c = parse_case(replaced("radius = \"2.5 mm\"", "sizes = { kind = \"uniform\", min = \"2 mm\", max = \"3 mm\" }"),
                            "case.toml", ".", {"particles.count=20000"});
  const SphereFacts f = sphere_facts(c);
  EXPECT_FALSE(f.equal);
  EXPECT_GE(f.radius_min, 2e-3);
  EXPECT_LE(f.radius_max, 3e-3);
  // Scatter of means of 20,000 draws: 1 mm/sqrt(12 N) = 2e-6 m, and 0.3 % of the volume; four times that here.
  EXPECT_NEAR(f.radius_mean, 2.5e-3, 8e-6);
  EXPECT_NEAR(f.solid_volume / (20000.0 * pi / 3.0 * (81.0 - 16.0) * 1e-9), 1.0, 0.012) << "4/3 pi <R^3>";
  EXPECT_DOUBLE_EQ(f.mass_max, mass(f.radius_max));
  // Of the volume (R^4 - 2^4) / (3^4 - 2^4) is below R, in mm.
  ASSERT_TRUE(f.volume_radii);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR((*f.volume_radii)[static_cast<std::size_t>(k)], 1e-3 * std::pow(16.0 + std::array{0.1, 0.5, 0.9}[static_cast<std::size_t>(k)] * 65.0, 0.25), 2e-5) << k;
}

TEST(CheckCommand, DimensionlessNumbers) {
  const Case c = good({"particles.law.f0=-0.4"});
  const CheckReport r = check_report(c, 1);
  ASSERT_TRUE(r.bond_number);
  EXPECT_DOUBLE_EQ(*r.bond_number, 0.4 / (mass(2.5e-3) * 9.81));
  ASSERT_EQ(r.inertial.size(), 2u);
  const double height = r.spheres.solid_volume / (0.03 * 0.03 * 0.6);
  for (std::size_t k = 0; k < 2; ++k) {
    const double stress = k == 0 ? 5e3 : 40e3;
    EXPECT_EQ(r.inertial[k].stress, stress);
    EXPECT_NEAR(r.inertial[k].value, 0.01 / height * 5e-3 * std::sqrt(2000.0 / stress), 1e-12);
  }
  EXPECT_FALSE(check_report(good({"environment.gravity=0", "stage.fill.method=grow", "stage.fill.porosity=0.5"}), 1).bond_number);
}

TEST(CheckCommand, FormulasOfMaterialData) {
  const Case c = good({"particles.law.k1={ young_modulus = \"1 MPa\", poisson_ratio = 0.3 }", "particles.law.f0={ surface_energy = \"0.05 J/m2\", model = \"jkr\" }"});
  const CheckReport r = check_report(c, 1);
  const std::string text = check_text(c, r);
  EXPECT_NE(text.find("k1 = 2 E* R* [Thakur2016, Eq. 14]\n"), std::string::npos) << text;
  EXPECT_NE(text.find("f0 = -3 pi gamma R* [Thakur2016, Eq. 17]\n"), std::string::npos) << text;
  EXPECT_EQ(text.find("k2 = "), std::string::npos) << "a plain number";
  const auto json = nlohmann::json::parse(check_json(c, r));
  EXPECT_EQ(json.at("law").at("from").size(), 2u);
  EXPECT_EQ(json.at("law").at("from").at("k1"), "2 E* R* [Thakur2016, Eq. 14]");
  EXPECT_FALSE(nlohmann::json::parse(check_json(good(), check_report(good(), 1))).at("law").contains("from"));
}

TEST(CheckCommand, TimeStep) {
  const CheckReport r = check_report(good(), 1);
  // dt_crit of a dense bed: 0.75 sqrt(m/k2) at k2 = 5 k1.
  EXPECT_NEAR(r.limits.dt_crit / (0.75 * std::sqrt(mass(2.5e-3) / 25e3)), 1.0, 0.01);
  EXPECT_LE(r.dt, 0.3 * r.limits.dt_crit);
  EXPECT_GE(r.dt, 0.3 * r.limits.dt_crit / std::pow(2.0, 1.0 / 16.0));
  EXPECT_LT(r.limits.dt_limit, r.limits.dt_crit);
  EXPECT_NE(r.rule.find("dt_crit"), std::string::npos);
  EXPECT_EQ(check_report(good({"time.step=1e-5"}), 1).dt, 1e-5);
  EXPECT_THROW(check_report(good({"time.step=1e-4"}), 1), CaseError);
  const CheckReport lifted = check_report(good({"time.step=1e-4", "time.allow_unstable=true"}), 1);
  EXPECT_NE(check_text(good(), lifted).find("note: time.step is above dt_limit"), std::string::npos);
}

TEST(CheckCommand, KernelsAndWhy) {
  struct Wanted {
    std::vector<std::string> overrides;
    const char* scene;
    const char* because;
  };
  const std::vector<Wanted> all{
      {{}, "cohesionless", "no adhesion"},
      {{"particles.law.k2=5e3"}, "elastic", "no plasticity"},
      {{"particles.law.f0=-0.1", "particles.law.rolling_friction=0.01"}, "full", "adhesion (k_adh or f0)"},
      {{"particles.law.exponent=1.5", "particles.law.k1=1e5", "particles.law.k2=5e5"}, "three_halves", "n = 1.5"},
      {{"particles.law.exponent=0.8", "particles.law.k1=1e3", "particles.law.k2=5e3"}, "any_exponent", "n = 0.8"},
      {{"particles.law.rolling_friction=0.01", "particles.law.rolling_model=relative"}, "relative_rolling", "relative rolling"},
  };
  for (const Wanted& wanted : all) {
    const CheckReport r = check_report(good(wanted.overrides), 1);
    EXPECT_EQ(r.scene, wanted.scene);
    EXPECT_NE(r.why_scene.find(wanted.because), std::string::npos) << r.why_scene;
  }
  const Case sizes = parse_case(replaced("radius = \"2.5 mm\"", "sizes = { kind = \"uniform\", min = \"2 mm\", max = \"3 mm\" }"),
                                "case.toml", ".");
  EXPECT_EQ(check_report(sizes, 1).scene, "full_wide");
}

TEST(CheckCommand, SmallExponentsAreExplained) {
  const Case c = good({"particles.law.exponent=0.8", "particles.law.k1=1e3", "particles.law.k2=5e3"});
  EXPECT_NE(check_text(c, check_report(c, 1)).find("max(delta, 1e-3 R)"), std::string::npos);
  EXPECT_EQ(check_text(good(), check_report(good(), 1)).find("max(delta, 1e-3 R)"), std::string::npos);
}

TEST(CheckCommand, ExpectedStages) {
  const Case c = good({"stage.compress.until={ displacement = \"3 mm\" }", "stage.compress.start_gap=\"0.1 mm\""});
  const auto stages = expected_stages(c, {0.1, 0.05, 0.42}, 1000, 1e-5, 1e7);
  ASSERT_EQ(stages.size(), 2u);
  // From rest at 0.5 m/s down 75 mm, then 0.15 s to land.
  EXPECT_NEAR(stages[0].simulated, (std::sqrt(0.25 + 2.0 * 9.81 * 0.075) - 0.5) / 9.81 + 0.15, 1e-12);
  EXPECT_NEAR(stages[1].simulated, 0.3, 1e-12) << "3 mm at 10 mm/s";
  EXPECT_NEAR(stages[1].wall, 0.3 / 1e-5 * 1000 / 1e7, 1e-9);
  EXPECT_LT(stages[0].wall, stages[0].simulated / 1e-5 * 1000 / 1e7) << "rain is cheaper than a dense bed";
}

TEST(CheckCommand, BothFormsSayTheSame) {
  const Case c = good();
  const CheckReport r = check_report(c, 1);
  const std::string text = check_text(c, r);
  for (const char* const part : {"spheres", "100, radius 2.5 mm", "dt_crit", "dt_limit", "Bond number", "inertial number",
                                 "memory", "kernels", "expected time", "fill", "compress"})
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
  const auto json = nlohmann::json::parse(check_json(c, r));
  EXPECT_EQ(json.at("kind"), "check");
  EXPECT_EQ(json.at("particles").at("count"), 100);
  EXPECT_EQ(json.at("time_step").at("dt"), r.dt);
  EXPECT_EQ(json.at("kernels").at("scene"), r.scene);
  EXPECT_EQ(json.at("stages").size(), 2u);
  double sum = 0.0;
  for (const auto& stage : json.at("stages")) sum += stage.at("wall_seconds").get<double>();
  EXPECT_NEAR(json.at("wall_seconds").get<double>(), sum, 1e-9);
  EXPECT_GT(json.at("memory").get<double>(), 1e6);
  EXPECT_GT(json.at("speed").at("particle_steps_per_second").get<double>(), 1e4);
}

TEST(CheckProgram, ShippedCasesAreRight) {
  for (const auto& entry : std::filesystem::directory_iterator(PLATEN_SOURCE_DIR "/protocol/cases")) {
    if (entry.path().extension() != ".toml") continue;
    const ProgramResult result = run_program({"check", entry.path().string(), "--json", "--threads", "1"});
    ASSERT_EQ(result.exit_code, 0) << result.report();
    EXPECT_EQ(result.err, "");
    EXPECT_GT(nlohmann::json::parse(result.out).at("wall_seconds").get<double>(), 0.0);
  }
}

TEST(CheckProgram, AForcedInstructionSetIsNamed) {
  ProgramOptions options;
  options.environment = {{"PLATEN_ISA", "scalar"}};
  const ProgramResult result = run_program({"check", PLATEN_SOURCE_DIR "/protocol/cases/quick.toml"}, options);
  ASSERT_EQ(result.exit_code, 0) << result.report();
  EXPECT_NE(result.out.find("scalar: forced by PLATEN_ISA"), std::string::npos) << result.out;
}

TEST(CheckProgram, ATinyCaseWithoutBox) {
  const TemporaryFolder folder;
  write_file(folder / "two.csv", "x,y,z\n0,0,0\n0.0051,0,0\n");
  write_file(folder / "two.toml", R"([particles]
file = "two.csv"
radius = "2.5 mm"
density = 2000
[particles.law]
k1 = 5e3
k2 = 5e3
[plates]
top = false
bottom = false
[[stage]]
kind = "run"
duration = "1 ms"
)");
  const ProgramResult result = run_program({"check", "two.toml"}, {.folder = folder.path()});
  EXPECT_EQ(result.exit_code, 0) << result.report();
  EXPECT_EQ(result.out.find("settled bed"), std::string::npos) << "there is no box for it";
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 2) << "check writes nothing";
}

std::string notes_of(const std::vector<std::string>& overrides, const std::string& text = good_case) {
  std::string all;
  for (const std::string& note : check_report(parse_case(text, "case.toml", ".", overrides), 1).notes) all += note + "\n";
  return all;
}

TEST(CheckCommand, NotesOnWhatARunWouldShowLate) {
  const std::string quick = read_file(std::string(PLATEN_SOURCE_DIR) + "/protocol/cases/quick.toml");
  const auto has = [&](const std::string& what, const std::vector<std::string>& overrides) {
    return notes_of(overrides, quick).find(what) != std::string::npos;
  };
  EXPECT_FALSE(has("rolling_friction = 0 with cohesion", {}));
  EXPECT_TRUE(has("rolling_friction = 0 with cohesion", {"particles.law.rolling_friction=0"}));
  EXPECT_FALSE(has("rolling_friction = 0 with cohesion", {"particles.law.rolling_friction=0", "particles.law.k_adh=0"}));
  EXPECT_FALSE(has("ends at", {}));
  EXPECT_TRUE(has("compress: ends at 2 kPa before strain begins to count at 5 kPa", {"stage.compress.until.stress=\"2 kPa\""}));
  EXPECT_FALSE(has("sides are still there", {}));
  const std::size_t release = quick.find("[[stage]]\nkind = \"release\""), crush = quick.find("[[stage]]", release + 1);
  ASSERT_LT(crush, quick.size());
  EXPECT_NE(notes_of({}, quick.substr(0, release) + quick.substr(crush)).find("crush: the sides are still there"), std::string::npos);
  const std::size_t compress = quick.find("[[stage]]\nkind = \"compress\""), unload = quick.find("[[stage]]", compress + 1);
  ASSERT_LT(unload, release);
  EXPECT_NE(notes_of({}, quick.substr(0, compress) + quick.substr(unload)).find("unload: nothing has pressed before it"), std::string::npos);
  EXPECT_NE(notes_of({}, quick + quick.substr(compress, unload - compress)).find("compress-2: there are no sides"), std::string::npos);
  EXPECT_FALSE(has("nothing has pressed", {}));
  EXPECT_FALSE(has("makes overlaps of", {}));
  EXPECT_TRUE(has("makes overlaps of some", {"stage.compress.until.stress=\"400 kPa\""}));
  EXPECT_FALSE(has("there are no sides", {}));
  // Load steps of one bed have one strain zero.
  const Case steps = parse_case(quick.substr(0, unload) + quick.substr(compress, unload - compress), "case.toml", ".");
  int zeros = 0;
  for (const InertialNumber& i : check_report(steps, 1).inertial) zeros += i.of == "strain zero";
  EXPECT_EQ(zeros, 1);
  // A second step to the same stress has nothing left to press, a first to half of it half.
  const auto strokes = [&](const char* first) {
    Case load = steps;
    for (StageSpec& s : load.stages) s.start_gap = 0.0;
    load.stages[2].until.stress = std::atof(first);
    std::vector<double> out;
    for (const ExpectedStage& e : expected_stages(load, {0.1, 0.05, 0.42}, 1000, 1e-5, 1e7)) if (e.kind == StageKind::compress) out.push_back(e.simulated);
    return out;
  };
  ASSERT_EQ(strokes("40e3").size(), 2u);
  EXPECT_DOUBLE_EQ(strokes("40e3")[1], 0.0);
  EXPECT_NEAR(strokes("20e3")[0], 0.5 * strokes("40e3")[0], 1e-12);
  EXPECT_GT(strokes("20e3")[1], 0.0);
  EXPECT_FALSE(has("near dt_limit", {"time.step=\"5 us\""}));
  EXPECT_TRUE(has("near dt_limit", {"time.step=\"20 us\""}));
}

TEST(CheckCommand, AStageThatItsTimeDoesNotSufficeForHasANote) {
  EXPECT_EQ(notes_of({}).find("max_duration"), std::string::npos) << notes_of({});
  const std::string slow = notes_of({"stage.compress.speed=\"0.01 mm/s\""});
  EXPECT_NE(slow.find("compress: needs about "), std::string::npos) << slow;
  EXPECT_NE(slow.find("max_duration = 60 s ends the run before that (exit code 6)"), std::string::npos) << slow;
}

// Springs so soft that plates are ten thousand times as stiff, and adhesion that pulls a bed of them together: check still says all.
TEST(CheckCommand, SaysItsNumbersOfSoftAndStickySpheres) {
  const std::vector<std::string> fine{"particles.radius=50e-6", "particles.law.k1=0.05", "particles.law.k2=0.25", "particles.law.f0=-1e-6"};
  const CheckReport r = check_report(good(fine), 1);
  EXPECT_GT(r.particle_steps_per_second, 0.0);
  EXPECT_TRUE(r.bond_number);
}

}  // namespace
}  // namespace platen::test
