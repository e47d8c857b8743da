// Samples of equal porosity: the search on made-up beds, what may be asked for, and whole tiny studies, also interrupted.
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <functional>
#include <random>
#include <set>
#include <thread>
#include <vector>

#include "protocol/output/hdf5_file.h"
#include "protocol/study/plan.h"
#include "protocol/study/porosity_match.h"
#include "protocol/study/porosity_search.h"
#include "protocol/study/study_file.h"
#include "tests/case_texts.h"
#include "tests/program.h"
#include "tests/study_folder.h"

namespace platen::test {
namespace {

namespace fs = std::filesystem;

// ------------------------------------------------------------------------------------------------------------- search

using Bed = std::function<std::optional<double>(std::int64_t)>;  // porosity of a setting; empty: cannot be made

struct Search {
  SearchStep end;
  std::vector<PorosityTry> tries;
  std::optional<double> found() const {
    for (const PorosityTry& one : tries)
      if (one.knob == end.knob) return one.porosity;
    return std::nullopt;
  }
};

// What every search must keep to: settings within the range, none twice, no more tries than allowed.
Search search(const PorosityKnob& knob, const PorosityAim& aim, const Bed& bed) {
  Search out;
  std::set<std::int64_t> used;
  for (;;) {
    out.end = next_step(knob, aim, out.tries);
    if (out.end.kind != SearchStep::Kind::attempt) return out;
    EXPECT_GE(out.end.knob, knob.low);
    EXPECT_LE(out.end.knob, knob.high);
    out.tries.push_back({out.end.knob, bed(out.end.knob)});
    if (!used.insert(out.end.knob).second || static_cast<int>(out.tries.size()) > aim.most_tries) {
      ADD_FAILURE() << "try " << out.tries.size() << " at " << out.end.knob;
      return out;
    }
  }
}

// Periods of vibration, as in the shipped case: looser than 0.42 nowhere, denser by 0.006 for each factor of e.
constexpr PorosityKnob shaken{1, 480, 120, -0.006};
double shaken_bed(std::int64_t periods) { return 0.42 - 0.006 * std::log(static_cast<double>(periods)); }
// Porosity of growth in units of 1e-5: settles densely above 0.44 whatever it was.
constexpr PorosityKnob grown{37000, 47000, 42000, 0.42};
double grown_bed(std::int64_t setting) { return 0.03 + 0.85 * std::min(1e-5 * static_cast<double>(setting), 0.44); }
// A number in -1 ... 1 that belongs to the setting: another packing, the same at every look.
double scatter(std::int64_t setting) {
  std::mt19937_64 random(static_cast<std::uint64_t>(setting));
  return std::uniform_real_distribution<double>(-1.0, 1.0)(random);
}

TEST(PorositySearch, FindsEveryPorosityWithinReach) {
  for (int k = 0; k <= 20; ++k) {
    // The guess of the slope may be wrong by a factor of ten: a few tries more. Neighbours are no more than twice the
    // tolerance apart.
    for (const double wrong : {0.1, 1.0, 10.0}) {
      const PorosityAim aim{shaken_bed(480) + 0.05 * k * (shaken_bed(6) - shaken_bed(480)), 5e-4, 12};
      PorosityKnob knob = shaken;
      knob.slope *= wrong;
      const Search s = search(knob, aim, shaken_bed);
      EXPECT_EQ(s.end.kind, SearchStep::Kind::met) << aim.porosity;
      EXPECT_NEAR(*s.found(), aim.porosity, aim.tolerance);
      EXPECT_LE(s.tries.size(), wrong == 1.0 ? 3u : 6u) << aim.porosity << " " << wrong;
    }
    const PorosityAim aim{grown_bed(37000) + 0.05 * k * (0.404 - grown_bed(37000)), 2e-4, 12};
    const Search s = search(grown, aim, grown_bed);
    EXPECT_EQ(s.end.kind, SearchStep::Kind::met) << aim.porosity;
    EXPECT_NEAR(*s.found(), aim.porosity, aim.tolerance);
  }
  // A start that is right is all.
  EXPECT_EQ(search(shaken, {shaken_bed(120), 1e-9, 12}, shaken_bed).tries.size(), 1u);
}

TEST(PorositySearch, ScatterMisleadsButEnds) {
  int met = 0;
  for (int k = 1; k < 40; ++k) {
    const PorosityAim aim{shaken_bed(480) + 0.025 * k * (shaken_bed(1) - shaken_bed(480)), 1e-3, 12};
    const auto with_scatter = [](double size) {
      return [size](std::int64_t n) { return shaken_bed(n) + size * scatter(n); };
    };
    // Up to the tolerance: met wherever there are settings enough to choose from (three periods make 0.001 at 15).
    const Search fine = search(shaken, aim, with_scatter(1e-3));
    if (aim.porosity < shaken_bed(15) && aim.porosity > shaken_bed(400)) {
      EXPECT_EQ(fine.end.kind, SearchStep::Kind::met) << aim.porosity;
    }
    // Five times as large it may fail, but it ends (checked by `search`), and says met only if it is.
    const Search coarse = search(shaken, aim, with_scatter(5e-3));
    if (coarse.end.kind == SearchStep::Kind::met) {
      EXPECT_NEAR(*coarse.found(), aim.porosity, aim.tolerance);
      ++met;
    }
  }
  EXPECT_GT(met, 10);
}

TEST(PorositySearch, OutOfReach) {
  const Search dense = search(shaken, {0.35, 1e-3, 12}, shaken_bed);
  EXPECT_EQ(dense.end.kind, SearchStep::Kind::out_of_range);
  EXPECT_EQ(dense.end.knob, 480);  // the end of the range was tried and came nearest
  const Search loose = search(shaken, {0.43, 1e-3, 12}, shaken_bed);
  EXPECT_EQ(loose.end.kind, SearchStep::Kind::out_of_range);
  EXPECT_EQ(loose.end.knob, 1);
  const Search collapsed = search(grown, {0.41, 1e-3, 12}, grown_bed);
  EXPECT_EQ(collapsed.end.kind, SearchStep::Kind::out_of_range);
  EXPECT_EQ(*collapsed.found(), 0.404);
  // A jump between neighbours: no setting is left.
  const Search jump = search(shaken, {0.40, 1e-3, 100}, [](std::int64_t n) { return n < 77 ? 0.41 : 0.38; });
  EXPECT_EQ(jump.end.kind, SearchStep::Kind::not_met);
  EXPECT_EQ(*jump.found(), 0.41);
  // And no tries.
  const Search short_of = search(shaken, {0.415, 1e-9, 3}, shaken_bed);
  EXPECT_EQ(short_of.end.kind, SearchStep::Kind::not_met);
  EXPECT_EQ(short_of.tries.size(), 3u);
}

TEST(PorositySearch, BedsThatAreTooDenseToBeMade) {
  const auto from = [](std::int64_t least) {
    return [least](std::int64_t n) { return n < least ? std::optional<double>() : std::optional(grown_bed(n)); };
  };
  const Search found = search(grown, {grown_bed(38500), 1e-3, 12}, from(38300));
  EXPECT_EQ(found.end.kind, SearchStep::Kind::met);
  // Also where the first one could not be made.
  EXPECT_EQ(search(grown, {grown_bed(43000), 1e-3, 12}, from(42500)).end.kind, SearchStep::Kind::met);
  const Search never = search(grown, {grown_bed(37500), 1e-3, 12}, from(38300));
  EXPECT_EQ(never.end.kind, SearchStep::Kind::not_met);
  EXPECT_GE(never.end.knob, 38300);
  EXPECT_EQ(search(grown, {0.40, 1e-3, 12}, from(60000)).end.knob, 0);  // none at all
}

// ---------------------------------------------------------------------------------------------------- what is adjusted

// 80 spheres, grown, shaken and compressed: a tenth of a second.
const std::string base_text = R"([case]
title = "tiny"
[particles]
radius = "2.5 mm"
density = "2000 kg/m3"
count = 80
[particles.law]
k1 = "5 kN/m"
k2 = "25 kN/m"
[box]
width = "16 mm"
depth = "16 mm"
height = "60 mm"
[time]
step = "15 us"
[output]
frames = "off"
slabs = 6
[[stage]]
kind = "fill"
method = "grow"
porosity = 0.42
[[stage]]
kind = "vibrate"
frequency = "100 Hz"
amplitude = "0.3 mm"
duration = "0.1 s"
[[stage]]
kind = "settle"
until = { kinetic_to_potential = 1e-3, coordination_change = 0.05, window = "10 ms" }
[[stage]]
kind = "compress"
speed = "200 mm/s"
until = { stress = "5 kPa" }
strain_zero = "1 kPa"
start_gap = "0.1 mm"
)";

const std::string study_text = R"([study]
title = "tiny"
base = "tiny.toml"
seeds = [1, 2]
match_porosity = { tolerance = 0.003, adjust = "growth" }

[[curve]]
name = "reference"

[[curve]]
name = "coarse"
radius = "3 mm"
stiffness = 1
)";

Case case_of(const std::string& text) { return parse_case(text, "case.toml", "."); }

const StageSpec& stage_of(const Case& c, const std::string& name) {
  return *std::find_if(c.stages.begin(), c.stages.end(), [&](const StageSpec& s) { return s.name == name; });
}

TEST(PorosityKnob, VibrationIsCountedInWholePeriods) {
  const std::string two = replaced("[[stage]]\nkind = \"settle\"",
                                   "[[stage]]\nkind = \"vibrate\"\nname = \"after-shock\"\nfrequency = \"50 Hz\"\namplitude = \"0.1 mm\"\nduration = \"0.105 s\"\n"
                                   "[[stage]]\nkind = \"settle\"", base_text);
  const Case c = case_of(two);
  PorosityMatch match;
  const PorosityKnob free = knob_of(match, c);
  EXPECT_EQ(free.low, 1);
  EXPECT_EQ(free.start, 10);
  EXPECT_EQ(free.high, 40);
  EXPECT_EQ(adjusted_key(match, c), "stage.vibrate.duration");
  EXPECT_EQ(knob_value(match, c, 7), 0.07);
  // Five periods beside ten, in proportion: 3.5 are rounded, and one is the least.
  EXPECT_EQ(*stage_of(with_knob(match, c, 7), "vibrate").duration, 0.07);
  EXPECT_EQ(*stage_of(with_knob(match, c, 7), "after-shock").duration, 0.08);
  EXPECT_EQ(*stage_of(with_knob(match, c, 1), "after-shock").duration, 0.02);
  match.range = {0.025, 0.07};
  const PorosityKnob given = knob_of(match, c);
  EXPECT_EQ(given.low, 3);
  EXPECT_EQ(given.high, 7);
  EXPECT_EQ(given.start, 7);
}

TEST(PorosityKnob, GrowthIsCountedInSmallUnits) {
  const Case c = case_of(base_text);
  PorosityMatch match;
  match.adjust = PorosityMatch::Adjust::growth;
  const PorosityKnob knob = knob_of(match, c);
  EXPECT_EQ(knob.start, 42000);
  EXPECT_EQ(knob.low, 37000);
  EXPECT_EQ(knob.high, 47000);
  EXPECT_EQ(*stage_of(with_knob(match, c, 41234), "fill").porosity, 0.41234);
}

// ------------------------------------------------------------------------------------------------------- study files

TEST(PorosityMatchFile, WrongValues) {
  EXPECT_EQ(complaint(study_text, base_text), "nothing");
  const std::string table = "{ tolerance = 0.003, adjust = \"growth\" }";
  struct {
    const char *by, *expected;
  } cases[] = {
      {"0.003", "study.toml:5:18: study.match_porosity: is a real number, wrong type; allowed: a table"},
      {"{ adjust = \"growth\" }", "study.toml:5:18: study.match_porosity.tolerance: is missing; allowed: a plain number in (0, 0.1]"},
      {"{ tolerance = 0.003 }", "study.match_porosity.adjust: is missing; allowed: \"vibration\", \"growth\""},
      {"{ tolerance = 0, adjust = \"growth\" }", "study.toml:5:32: study.match_porosity.tolerance: 0 is out of range; allowed: a plain number in (0, 0.1]"},
      {"{ tolerance = 0.003, adjust = \"grow\" }", "nearest known word: growth"},
      {"{ tolerence = 0.003, adjust = \"growth\" }", "study.toml:5:20: study.match_porosity.tolerence: unknown key; allowed in match_porosity: tolerance, adjust, range, most_tries; nearest known key: tolerance"},
      {"{ tolerance = 0.003, adjust = \"growth\", most_tries = 0 }", "allowed: a whole number from 1 to 1000"},
      {"{ tolerance = 0.003, adjust = \"growth\", range = [0.45, 0.38] }", "study.match_porosity.range: is not a range; allowed: the least and the largest porosity of the growth, as [0.38, 0.45]"},
      {"{ tolerance = 0.003, adjust = \"growth\", range = [\"1 s\", \"2 s\"] }", "study.match_porosity.range: "},
      {"{ tolerance = 0.003, adjust = \"vibration\", range = [\"1 s\"] }", "allowed: the least and the largest duration of the vibration"},
      {"{ tolerance = 0.003, adjust = \"vibration\", range = [\"1 ms\", \"2 ms\"] }", "match_porosity.range holds no setting of stage.vibrate.duration; allowed: a wider range, at least one whole period of 100 Hz"},
      {"{ tolerance = 0.003, adjust = \"growth\" }\ntimed = true", "samples of timed runs are not matched"},
  };
  for (const auto& c : cases) {
    const std::string text = complaint(replaced(table, c.by, study_text), base_text);
    EXPECT_NE(text.find(c.expected), std::string::npos) << c.by << "\n" << text;
  }
}

TEST(PorosityMatchFile, CasesWithNothingToAdjust) {
  const std::string shaken_study = replaced("\"growth\"", "\"vibration\"", study_text);
  const std::string vibrate = "[[stage]]\nkind = \"vibrate\"\nfrequency = \"100 Hz\"\namplitude = \"0.3 mm\"\nduration = \"0.1 s\"\n";
  struct {
    std::string study, base, expected;
  } cases[] = {
      {shaken_study, replaced(vibrate, "", base_text),
       "study.toml:5:18: study.match_porosity: does not fit the base case: there is no vibration to adjust; allowed: cases with a vibrate stage before compress"},
      {study_text, replaced("method = \"grow\"\nporosity = 0.42", "", base_text), "there is no growth to adjust; allowed: cases with a fill stage of method \"grow\""},
      {study_text, replaced("slabs = 6", "slabs = 2", base_text), "allowed: output.slabs of at least 3"},
      {study_text, replaced("kind = \"compress\"", "kind = \"crush\"", base_text), "there is no sample to match"},
      {shaken_study, replaced("duration = \"0.1 s\"", "duration = \"0.1 s\"\nmax_duration = \"0.2 s\"", base_text),
       "stage.vibrate.max_duration is 0.2 s, match_porosity wants up to 0.4 s; allowed: a larger max_duration, or a shorter range"},
      // One curve alone does not fit.
      {replaced("stiffness = 1", "set = \"output.slabs=1\"", study_text), base_text, "study.toml:10:1: curve: \"coarse\" is not a possible case"},
      // Tolerances would add up along a chain.
      {study_text + "against = \"reference\"\n[[curve]]\nname = \"finer\"\nradius = \"2.2 mm\"\nagainst = \"coarse\"\n", base_text,
       "curve.against: \"finer\" is compared with \"coarse\", which is compared with another curve"},
  };
  for (const auto& c : cases) {
    const std::string text = complaint(c.study, c.base);
    EXPECT_NE(text.find(c.expected), std::string::npos) << c.expected << "\n" << text;
  }
  // The program says so before it writes anything.
  const StudyFolder study(cases[0].study, cases[0].base);
  EXPECT_EQ(run_program(study.words("out")).exit_code, 3);
  EXPECT_FALSE(fs::exists(study.folder / "out"));
}

TEST(PorosityMatchPlan, AllButReferencesAreMatched) {
  const StudyFolder folder(replaced("radius = \"3 mm\"\nstiffness = 1", "radii = [\"2.5 mm\", \"3 mm\"]\nstiffness = [0, 1]", study_text), base_text);
  const Study study = read_study(folder.file());
  const StudyPlan plan = make_plan(study);
  // At the reference's radius powers mean nothing: those curves are the reference, and share its runs.
  ASSERT_EQ(plan.jobs.size(), 2u * 3u);
  for (const PlannedCurve& curve : plan.parts.at(0).curves)
    for (std::size_t k = 0; k < 2; ++k) {
      const Job& job = plan.jobs[curve.jobs.at(k)];
      ASSERT_EQ(job.match.has_value(), curve.radius == 3e-3) << job.name;
      if (job.match) {
        EXPECT_EQ(plan.jobs[job.match->reference].c.seed, job.c.seed);
        EXPECT_NE(job.name.find("-matched-s"), std::string::npos) << job.name;
      }
    }
}

// ------------------------------------------------------------------------------------------------------ whole studies

// Every table, and what each run was made of.
std::string tables_of(const fs::path& folder) {
  std::vector<fs::path> files{folder / "runs.csv"};
  for (const auto& entry : fs::directory_iterator(folder / "tables")) files.push_back(entry.path());
  for (const auto& entry : fs::directory_iterator(folder / "runs")) files.push_back(entry.path() / "case.toml");
  std::sort(files.begin(), files.end());
  std::string out;
  for (const fs::path& file : files) out += file.string().substr(folder.string().size()) + "\n" + read_file(file);
  return out;
}

std::vector<double> numbers(const std::string& list) {
  std::vector<double> out;
  std::istringstream in(list);
  for (std::string one; std::getline(in, one, ';');) out.push_back(std::stod(one));
  return out;
}

TEST(PorosityMatchStudy, MeetsTheToleranceAlsoWhenInterrupted) {
  // Two samples of 80 spheres differ by more than the tolerance: whether a search meets it hangs on the last bits, which are the same on every instruction set then.
  const std::string seeds[2] = {"1", "4"};
  const StudyFolder study(replaced("[1, 2]", "[" + seeds[0] + ", " + seeds[1] + "]", study_text), base_text);
  const ProgramResult result = run_program(study.words("whole", {"--reproducible"}));
  ASSERT_EQ(result.exit_code, 0) << result.report();
  const fs::path folder = study.folder / "whole";
  const CsvTable table = read_csv(folder / "tables/porosity_match.csv");
  ASSERT_EQ(table.rows.size(), 2u);
  std::size_t tries = 0;
  std::vector<double> wanted, reached;
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(table.cell(k, "met"), "yes");
    EXPECT_EQ(table.cell(k, "key"), "stage.fill.porosity");
    EXPECT_EQ(table.cell(k, "matched to"), "tiny-R2.5mm-s" + seeds[k]);
    wanted.push_back(table.number(k, "wanted porosity"));
    reached.push_back(table.number(k, "porosity"));
    EXPECT_NEAR(reached[k], wanted[k], 0.003);
    tries += numbers(table.cell(k, "tried values")).size();
    const Case c = read_case(folder / "runs" / table.cell(k, "run") / "case.toml");
    EXPECT_EQ(*c.stages.front().porosity, table.number(k, "value"));
  }
  EXPECT_GT(tries, 2u) << "nothing had to be searched: the test shows nothing";
  // The runs themselves have these porosities, to the bit: what was tried is what was run.
  const CsvTable scalars = read_csv(folder / "tables/scalars.csv");
  for (std::size_t k = 0; k < scalars.rows.size(); ++k)
    if (scalars.cell(k, "quantity") == "porosity_settled") {
      EXPECT_EQ(numbers(scalars.cell(k, "values")), scalars.cell(k, "curve") == "reference" ? wanted : reached);
    }
  const std::string expected = tables_of(folder);

  // Without its runs and the last try of each, the study makes just these again.
  std::set<fs::path> kept;
  for (std::size_t k = 0; k < 2; ++k) {
    const fs::path own = folder / "tries" / table.cell(k, "run");
    const std::size_t count = numbers(table.cell(k, "tried values")).size();
    fs::remove_all(folder / "runs" / table.cell(k, "run"));
    fs::remove_all(own / std::to_string(count));
    for (std::size_t n = 1; n < count; ++n) kept.insert(own / std::to_string(n) / "summary.json");
  }
  const auto before = fs::file_time_type::clock::now();
  const ProgramResult again = run_program(study.words("whole", {"--reproducible"}));
  EXPECT_EQ(again.exit_code, 0) << again.report();
  EXPECT_EQ(tables_of(folder), expected);
  for (const fs::path& file : kept) EXPECT_LT(fs::last_write_time(file), before) << file;

  // Killed and stopped at random, then left alone.
  std::mt19937 random(std::random_device{}());
  for (int k = 0; k < 3; ++k) {
    RunningProgram victim(study.words("killed", {"--reproducible"}), {});
    const int wait = static_cast<int>(random() % 500) + 20;
    SCOPED_TRACE("killed after " + std::to_string(wait) + " ms");
    std::this_thread::sleep_for(std::chrono::milliseconds(wait));
    victim.send(k % 2 == 0 ? SIGKILL : SIGTERM);
    victim.wait(60.0);
  }
  const ProgramResult last = run_program(study.words("killed", {"--reproducible"}));
  ASSERT_EQ(last.exit_code, 0) << last.report();
  EXPECT_EQ(tables_of(study.folder / "killed"), expected);
}

TEST(PorosityMatchStudy, ReproducibleOnesTakeNoOtherTries) {
  const StudyFolder study(replaced("[1, 2]", "[1]", study_text), base_text);
  const int plain = run_program(study.words("out")).exit_code;
  ASSERT_TRUE(plain == 0 || plain == 6) << plain;  // whether it meets the tolerance hangs on the last bits of an instruction set
  const fs::path tries = study.folder / "out/tries";
  const auto of_first_try = [&] { return fs::last_write_time(fs::directory_iterator(tries)->path() / "1/results.h5"); };
  const auto before = of_first_try();
  const ProgramResult exact = run_program(study.words("out", {"--reproducible"}));
  ASSERT_EQ(exact.exit_code, 0) << exact.report();
  EXPECT_GT(of_first_try(), before);
  // Matched to the reference's run as it is made now.
  EXPECT_LT(fs::last_write_time(study.folder / "out/runs/tiny-R2.5mm-s1/summary.json"), of_first_try());
  EXPECT_GT(fs::last_write_time(study.folder / "out/runs/tiny-R2.5mm-s1/summary.json"), before);
  for (const auto& run : fs::directory_iterator(study.folder / "out/runs"))
    EXPECT_EQ(Hdf5File::open(run.path() / "results.h5").root().integer_attribute("provenance", "reproducible", -1), 1) << run.path();
  const auto then = of_first_try();
  EXPECT_EQ(run_program(study.words("out", {"--reproducible"})).exit_code, 0);
  EXPECT_EQ(of_first_try(), then);
}

TEST(PorosityMatchStudy, VibrationAndAnAutomaticStep) {
  // Shaken for so short a time that it must be searched.
  const std::string finer = replaced("\"growth\"", "\"vibration\"", replaced("3 mm\"", "2.2 mm\"\nset = \"stage.vibrate.duration=0.02\"", replaced("[1, 2]", "[1]", study_text)));
  const StudyFolder study(finer, replaced("\"15 us\"", "\"auto\"", base_text));
  const ProgramResult result = run_program(study.words("out", {"--reproducible"}));
  ASSERT_EQ(result.exit_code, 0) << result.report();
  const CsvTable table = read_csv(study.folder / "out/tables/porosity_match.csv");
  ASSERT_EQ(table.rows.size(), 1u);
  EXPECT_NEAR(table.number(0, "porosity"), table.number(0, "wanted porosity"), 0.003);
  EXPECT_GT(numbers(table.cell(0, "tried values")).size(), 1u) << "nothing had to be searched: the test shows nothing";
  const Case c = read_case(study.folder / "out/runs" / table.cell(0, "run") / "case.toml");
  EXPECT_EQ(*stage_of(c, "vibrate").duration, table.number(0, "value"));
}

TEST(PorosityMatchStudy, ARunThatCannotBeMatchedIsMarkedAndTheRestFinishes) {
  // Even the densest bed of this range is too loose. A curve that is compared with itself is not matched.
  const StudyFolder study(replaced("adjust = \"growth\" }", "adjust = \"growth\", range = [0.44, 0.47] }", replaced("[1, 2]", "[1]", study_text)) +
                          "[[curve]]\nname = \"on its own\"\nradius = \"2.2 mm\"\nagainst = \"on its own\"\n", base_text);
  const ProgramResult result = run_program(study.words("out"));
  EXPECT_EQ(result.exit_code, 6) << result.report();
  const CsvTable runs = read_csv(study.folder / "out/runs.csv");
  ASSERT_EQ(runs.rows.size(), 3u);
  EXPECT_EQ(runs.cell(0, "state"), "done");
  EXPECT_EQ(runs.cell(1, "state"), "done");
  EXPECT_EQ(runs.cell(2, "state"), "failed");
  const std::string message = runs.cell(2, "message");
  const CsvTable table = read_csv(study.folder / "out/tables/porosity_match.csv");
  ASSERT_EQ(table.rows.size(), 1u);
  EXPECT_EQ(table.cell(0, "met"), "no");
  char wanted[64];
  std::snprintf(wanted, sizeof wanted, "porosity %.4f +- 0.003 is out of reach: ", table.number(0, "wanted porosity"));
  EXPECT_EQ(message.substr(0, std::string(wanted).size()), wanted);
  EXPECT_NE(message.find("stage.fill.porosity from 0.44 to "), std::string::npos) << message;
  EXPECT_NE(message.find(" reached 0."), std::string::npos) << message;
  EXPECT_FALSE(fs::exists(study.folder / "out/runs" / table.cell(0, "run")));
}

TEST(PorosityMatchStudy, AFailingTryAndAFailingReferenceAreSaid) {
  const std::string slow = replaced("until = { kinetic_to_potential = 1e-3,", "max_duration = 1e-3\nuntil = { kinetic_to_potential = 1e-3,", base_text);
  const StudyFolder reference(replaced("[1, 2]", "[1]", study_text), slow);
  EXPECT_EQ(run_program(reference.words("out")).exit_code, 6);
  EXPECT_EQ(read_csv(reference.folder / "out/runs.csv").cell(1, "message"), "its reference tiny-R2.5mm-s1 has no settled sample");
  const StudyFolder coarse(replaced("stiffness = 1", "set = \"stage.settle.max_duration=1e-3\"", replaced("[1, 2]", "[1]", study_text)), base_text);
  EXPECT_EQ(run_program(coarse.words("out")).exit_code, 6);
  const std::string message = read_csv(coarse.folder / "out/runs.csv").cell(1, "message");
  EXPECT_EQ(message.substr(0, 20), "try 1: stage settle:") << message;
}

}  // namespace
}  // namespace platen::test
