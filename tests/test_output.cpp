// The contents of a run folder: what is written is what is read back, by our own reader and by h5py.
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "protocol/output/files.h"
#include "protocol/output/hdf5_file.h"
#include "tests/sample_run.h"

namespace platen {
namespace {

using namespace sample;
using Json = nlohmann::json;

class Output : public OutputTest {};

std::vector<std::string> lines_of(const fs::path& file) {
  std::istringstream in(contents(file));
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

TEST_F(Output, SeriesHasTheAgreedColumnsInOrder) {
  write_run(root / "run", 1);
  EXPECT_EQ(lines_of(root / "run/series.csv").at(0),
            "time [s],step [-],stage [-],height [m],strain [-],stress_top [Pa],stress_bottom [Pa],porosity [-],"
            "coordination_number [-],contacts [-],kinetic_energy [J],potential_energy [J],kinetic_to_potential [-],"
            "inertial_number [-],energy_residual [J],elastic_energy [J],adhesion_energy [J],tangential_energy [J],"
            "plate_energy [J],plastic_dissipation [J],viscous_dissipation [J],sliding_dissipation [J],"
            "rolling_dissipation [J],plate_model_work [J],plate_work [J],inserted_energy [J],removed_energy [J]");
}

TEST_F(Output, SeriesRowIsWrittenAtOnceWithSeventeenDigits) {
  RunFolder run = RunFolder::create(root / "run", case_text, false);
  run.append(row(0, 0), 0);
  run.append(row(1, 1), 1);
  const auto lines = lines_of(root / "run/series.csv");
  ASSERT_EQ(lines.size(), 3u);
  // Strain and inertial number have no value yet: empty cells.
  EXPECT_EQ(lines[1].substr(0, 26), "0,0,settle,0.25,,0,2900,0.");
  EXPECT_EQ(lines[2].substr(0, 54), "0.0060000000000000001,600,compress,0.24399999999999999");
  EXPECT_NE(lines[1].find(",0.10000000000000001,3.3333333333333331e-300,,"), std::string::npos) << lines[1];
  EXPECT_EQ(run.rows(), 2u);
}

TEST_F(Output, SeriesReadsBackToTheSameBits) {
  write_run(root / "run");
  const SeriesTable table = read_series(root / "run/series.csv");
  ASSERT_EQ(table.rows(), 20u);
  EXPECT_EQ(table.stage_names, stage_names());
  for (std::size_t n = 0; n < table.rows(); ++n) {
    const SeriesRow expected = row(static_cast<int>(n) / rows_per_stage, static_cast<int>(n) % rows_per_stage);
    for (std::size_t c = 0; c < series_columns().size(); ++c) {
      if (series_columns()[c].value == nullptr) continue;
      const double value = series_columns()[c].value(expected);
      if (std::isnan(value)) EXPECT_TRUE(std::isnan(table.columns[c][n]));
      else EXPECT_EQ(table.columns[c][n], value) << series_columns()[c].name << " row " << n;
    }
  }
}

TEST_F(Output, StageNamesWithCommasStayOneCell) {
  RunFolder run = RunFolder::create(root / "run", case_text, false);
  SeriesRow odd = row(0, 0);
  odd.stage = "first, \"slow\" part";
  run.append(odd, 0);
  EXPECT_EQ(read_series(root / "run/series.csv").stage_names.at(0), odd.stage);
}

TEST_F(Output, ResultsReadBackThroughHdf5) {
  write_run(root / "run");
  const Hdf5File file = Hdf5File::open(root / "run/results.h5");
  const Hdf5Group h5 = file.root();
  for (int stage = 0; stage < 4; ++stage) {
    const std::string name = stage_names()[static_cast<std::size_t>(stage)];
    const Hdf5Group particles = h5.group("stages/" + name + "/particles");
    const Snapshot expected = snapshot(stage);
    EXPECT_EQ(particles.read<double>("position"), expected.particles.position) << name;
    EXPECT_EQ(particles.read<std::int32_t>("image"), expected.particles.image);
    EXPECT_EQ(particles.read<std::int64_t>("id"), expected.particles.id);
    EXPECT_EQ(particles.shape("position").size, (std::vector<std::uint64_t>{40, 3}));
    EXPECT_EQ(h5.group("stages").text_attribute(name, "end_reason"), result(stage).end_reason);
    EXPECT_EQ(h5.group("profiles/" + name).read<double>("porosity"), profile(stage).porosity);
  }
  EXPECT_EQ(h5.group("particles").read<double>("position"), snapshot(3).particles.position);
  EXPECT_EQ(h5.group("contacts").read<double>("tangential_force"), snapshot(3).contacts.tangential_force);
  EXPECT_EQ(h5.group("contacts").read<std::int8_t>("branch"), snapshot(3).contacts.branch);
  EXPECT_EQ(h5.group("plate_contacts").read<std::int8_t>("plate"), snapshot(3).plate_contacts.plate);
  EXPECT_EQ(h5.read_text("case"), case_text);
  EXPECT_EQ(h5.group("contacts").text_attribute("normal_force", "unit"), "N");
}

TEST_F(Output, StrainCountsForTheWholeStageOnceItsZeroIsKnown) {
  write_run(root / "run");
  const Hdf5File file = Hdf5File::open(root / "run/results.h5");
  const std::vector<double> strain = file.root().group("series").read<double>("strain");
  ASSERT_EQ(strain.size(), 20u);
  for (int n = 0; n < 20; ++n) {
    const int stage = n / rows_per_stage;
    const auto zero = result(stage).strain_zero_height;
    const double height = row(stage, n % rows_per_stage).measures.height;
    if (!zero) EXPECT_TRUE(std::isnan(strain[static_cast<std::size_t>(n)]));
    else EXPECT_EQ(strain[static_cast<std::size_t>(n)], (*zero - height) / *zero) << n;
  }
  // The log keeps what was known at the time.
  EXPECT_TRUE(std::isnan(read_series(root / "run/series.csv").column("strain")[rows_per_stage]));
}

TEST_F(Output, ResultsAfterEachStageHoldAllStagesSoFar) {
  RunFolder run = RunFolder::create(root / "run", case_text, false);
  run.set_info(info());
  for (int stage = 0; stage < 4; ++stage) {
    write_stage(run, stage);
    const Hdf5File file = Hdf5File::open(root / "run/results.h5");
    EXPECT_EQ(file.root().group("stages").names().size(), static_cast<std::size_t>(stage) + 1);
    EXPECT_EQ(file.root().group("particles").read<double>("position"), snapshot(stage).particles.position);
    EXPECT_EQ(file.root().group("series").read<double>("time").size(), 5u * (static_cast<std::size_t>(stage) + 1));
  }
}

TEST_F(Output, ContactsAreLeftOutWhenTheCaseSaysSo) {
  write_run(root / "run", 4, false);
  const Hdf5File file = Hdf5File::open(root / "run/results.h5");
  EXPECT_FALSE(file.root().has("contacts"));
  EXPECT_FALSE(file.root().has("plate_contacts"));
  EXPECT_TRUE(file.root().has("particles"));
}

TEST_F(Output, AnEmptyBedIsWrittenToo) {
  RunFolder run = RunFolder::create(root / "run", case_text, false);
  run.set_info(info());
  run.close_stage(result(0), Snapshot{}, Profile{});  // not even a row of the series
  const Hdf5File file = Hdf5File::open(root / "run/results.h5");
  EXPECT_EQ(file.root().group("particles").shape("position").size, (std::vector<std::uint64_t>{0, 3}));
  EXPECT_EQ(file.root().group("series").read<double>("time").size(), 0u);
}

TEST_F(Output, H5pyReadsEverything) {
  write_run(root / "run");
  const std::string command = PLATEN_PYTHON " " PLATEN_SOURCE_DIR "/tests/check_results.py " + (root / "run").string();
  EXPECT_EQ(std::system((command + " --sample").c_str()), 0);
  // The script must notice a difference, or it proves nothing: here a changed number in the log.
  std::string text = contents(root / "run/series.csv");
  text.replace(text.find("0.24399999999999999"), 19, "0.24399999999999998");
  put(root / "run/series.csv", text);
  EXPECT_NE(std::system((command + " 2>/dev/null").c_str()), 0);
}

TEST_F(Output, SummaryHasTheAgreedKeysAndLeavesOutWhatHasNoMeaning) {
  write_run(root / "run");
  const Json summary = Json::parse(contents(root / "run/summary.json"));
  EXPECT_EQ(summary.at("state_hash"), "0000000000000abc");
  EXPECT_EQ(summary.at("exit_code"), 0);
  EXPECT_EQ(summary.at("performance").at("particle_steps_per_second"), 32000.0);
  EXPECT_EQ(summary.at("performance").at("reproducible"), true);
  const Json& settle = summary.at("stages").at(0);
  EXPECT_EQ(settle.at("name"), "settle");
  EXPECT_EQ(settle.at("kind"), "settle");
  EXPECT_EQ(settle.at("steps"), 400);
  EXPECT_DOUBLE_EQ(settle.at("time"), 4e-3);
  EXPECT_EQ(settle.at("particle_steps_per_second"), 400 * 40 / 0.5);
  for (const char* key : {"strength", "strength_strain", "initial_stiffness", "peak_found"})
    EXPECT_FALSE(settle.contains(key)) << key;
  EXPECT_FALSE(settle.at("values").contains("strain"));
  EXPECT_EQ(settle.at("values").at("contacts"), 1004);
  EXPECT_TRUE(settle.at("warnings").empty());
  const Json& crush = summary.at("stages").at(3);
  EXPECT_EQ(crush.at("strength"), 5432.1);
  EXPECT_EQ(crush.at("peak_found"), true);
  EXPECT_EQ(crush.at("energy_residual"), -1e-9);
  EXPECT_EQ(crush.at("values").at("strain"), (0.235 - (0.25 - 1e-3 * 19)) / 0.235);
  EXPECT_EQ(crush.at("warnings").at(0), "made up warning");
}

TEST_F(Output, SummaryOfAFailedRunHasNoHash) {
  RunFolder run = RunFolder::create(root / "run", case_text, false);
  run.finish(4, std::nullopt, performance(), {});
  const Json summary = Json::parse(contents(root / "run/summary.json"));
  EXPECT_FALSE(summary.contains("state_hash"));
  EXPECT_EQ(summary.at("exit_code"), 4);
  EXPECT_TRUE(summary.at("stages").is_array());
}

TEST_F(Output, ForceLeavesWhatNoRunWrote) {
  for (const char* name : {"results.h5", "series.csv", "checkpoint.prev.h5", "case.toml", "frames.hdf.series"}) {
    const fs::path folder = root / (std::string("mine-") + name);
    fs::create_directories(folder);
    write_whole_file(folder / name, "mine");
    EXPECT_THROW(RunFolder::create(folder, case_text, true), OutputError) << name;
    EXPECT_EQ(contents(folder / name), "mine");
  }
  fs::create_directories(root / "framed/frames");
  write_whole_file(root / "framed/frames/1.hdf", "mine");
  EXPECT_THROW(RunFolder::create(root / "framed", case_text, true), OutputError);
  // Neither does a resume that finds no run make it one.
  write_whole_file(root / "mine-results.h5/case.toml", case_text);
  EXPECT_THROW(RunFolder::hold(root / "mine-results.h5"), OutputError);
  EXPECT_FALSE(fs::exists(root / "mine-results.h5/.lock"));
  // The case itself may stand there, and what a run wrote goes.
  fs::create_directories(root / "here");
  write_whole_file(root / "here/case.toml", case_text);
  { RunFolder run = RunFolder::create(root / "here", case_text, true); }
  write_whole_file(root / "here/results.h5", "of a run");
  RunFolder::create(root / "here", case_text, true);
  EXPECT_FALSE(fs::exists(root / "here/results.h5"));
  // A copy without its lock is known by its log.
  write_whole_file(root / "here/results.h5", "of a run");
  { RunFolder run = RunFolder::create(root / "here", case_text, true); run.log("start", {}); }
  fs::remove(root / "here/.lock");
  write_whole_file(root / "here/results.h5", "of a run");
  RunFolder::create(root / "here", case_text, true);
  EXPECT_FALSE(fs::exists(root / "here/results.h5"));
}

TEST_F(Output, LogIsOneObjectALine) {
  RunFolder run = RunFolder::create(root / "run", case_text, false);
  run.log("stage", {{"name", "line\nbreak"}, {"steps", std::int64_t{12}}, {"time", 0.5}, {"reached", true}});
  run.log("broken", {{"text", "\xff"}}, LogLevel::warning);  // no UTF-8, and still a line of JSON
  const auto lines = lines_of(root / "run/log.jsonl");
  ASSERT_EQ(lines.size(), 2u);
  const Json first = Json::parse(lines[0]);
  EXPECT_EQ(first.at("event"), "stage");
  EXPECT_EQ(first.at("level"), "info");
  EXPECT_EQ(first.at("name"), "line\nbreak");
  EXPECT_TRUE(first.at("steps").is_number_integer());
  EXPECT_TRUE(first.at("time").is_number_float());
  EXPECT_EQ(first.at("reached"), true);
  EXPECT_EQ(first.at("timestamp").get<std::string>().size(), std::string("2026-01-31T12:00:00.000Z").size());
  EXPECT_EQ(Json::parse(lines[1]).at("level"), "warning");
}

TEST_F(Output, TableFitsAHundredColumns) {
  auto stages = results(4);
  stages[0].end_reason = std::string(200, 'x');
  stages[1].name = "a-very-long-name-of-a-stage-that-nobody-needs";
  stages[2].wall_seconds = 3725.0;
  stages[3].warnings.push_back(std::string(60, 'y') + " " + std::string(60, 'z'));
  const std::string table = summary_table(stages);
  std::istringstream in(table);
  for (std::string line; std::getline(in, line);) {
    EXPECT_LE(line.size(), 100u) << line;
    EXPECT_TRUE(line.empty() || line.back() != ' ') << line;
  }
  EXPECT_NE(table.find("crush: unconfined strength 5.43 kPa at strain 4.10 %, initial stiffness 250 kPa"),
            std::string::npos)
      << table;
  EXPECT_NE(table.find("1 h 02 min"), std::string::npos) << table;
  EXPECT_NE(table.find("warning: crush: made up warning"), std::string::npos) << table;
}

}  // namespace
}  // namespace platen
