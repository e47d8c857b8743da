// A small made-up run with every piece that a run folder can hold. Its numbers follow simple formulas, so that readers
// of the files (here and in check_results.py) can work out what must be in them.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "protocol/output.h"

namespace platen::sample {

namespace fs = std::filesystem;

inline const char* case_text = "# made up\n[case]\ntitle = \"sample: R = 2.5 mm, \u03c3\"\nseed = 7\n";
inline constexpr int rows_per_stage = 5;

// A folder of its own for each test, gone afterwards.
class OutputTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "platen-output-XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    root = pattern;
  }
  void TearDown() override {
    if (!root.empty()) fs::remove_all(root);
  }
  fs::path root;
};

inline std::string contents(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline void put(const fs::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

// Every file below a folder with its bytes.
inline std::map<std::string, std::string> all_files(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    files[fs::relative(entry.path(), folder).string()] = entry.is_regular_file() ? contents(entry.path()) : "folder";
  return files;
}

inline const std::vector<std::string>& stage_names() {
  static const std::vector<std::string> names{"settle", "compress", "unload", "crush"};
  return names;
}

// Height falls by 1 mm a row from 0.25 m; strain is known in the second half of a stage.
inline SeriesRow row(int stage, int k) {
  const int n = stage * rows_per_stage + k;
  SeriesRow r;
  r.stage = stage_names()[static_cast<std::size_t>(stage)];
  r.measures.step = 100LL * n;
  r.measures.time = 1e-5 * 100.0 * n;
  r.measures.height = 0.25 - 1e-3 * n;
  if (stage > 0 && k >= 3) r.strain = 0.5;  // a live value that the file's own must replace
  r.measures.stress_top = 1000.0 / 3.0 * n;
  r.measures.stress_bottom = r.measures.stress_top + 2900.0;
  r.measures.porosity = 0.4 - 0.001 * n;
  r.measures.coordination_number = 5.0 + 0.1 * n;
  r.measures.contacts = 1000 + n;
  r.measures.kinetic_energy = 1e-300 / 3.0;
  r.measures.potential_energy = 0.1;
  r.kinetic_to_potential = 1e-299 / 3.0;
  r.inertial_number = n == 0 ? std::numeric_limits<double>::quiet_NaN() : 1e-4;
  r.measures.energy_residual = -1e-9;
  r.measures.ledger.elastic_energy = 0.01 * n;
  r.measures.ledger.removed_energy = 0.02 * n;
  return r;
}

inline StageResult result(int stage) {
  StageResult s;
  s.name = stage_names()[static_cast<std::size_t>(stage)];
  s.kind = std::vector{StageKind::settle, StageKind::compress, StageKind::unload, StageKind::crush}
      [static_cast<std::size_t>(stage)];
  s.end_reason = stage == 1 ? "stress 40 kPa reached" : "made up";
  s.first_step = 100LL * stage * rows_per_stage;
  s.last_step = s.first_step + 100LL * (rows_per_stage - 1);
  s.time_begin = 1e-5 * static_cast<double>(s.first_step);
  s.time_end = 1e-5 * static_cast<double>(s.last_step);
  s.wall_seconds = 0.5;
  s.particles = 40;
  if (stage == 1 || stage == 2) s.strain_zero_height = 0.243;  // unload keeps compress's zero
  if (stage == 3) {
    s.strain_zero_height = 0.235;
    s.strength = 5432.1;
    s.strength_strain = 0.041;
    s.initial_stiffness = 2.5e5;
    s.peak_found = true;
    s.warnings = {"made up warning"};
  }
  s.last = row(stage, rows_per_stage - 1);
  return s;
}

// 40 spheres; numbers depend on the stage so that states cannot be mixed up.
inline Snapshot snapshot(int stage) {
  Snapshot s;
  s.step = result(stage).last_step;
  s.time = result(stage).time_end;
  s.z_top = 0.2;
  for (int i = 0; i < 40; ++i) {
    s.particles.id.push_back(2 * i);
    for (int c = 0; c < 3; ++c) {
      s.particles.position.push_back(0.001 * i + 0.1 * c + stage);
      s.particles.velocity.push_back(-0.5 * i + c);
      s.particles.angular_velocity.push_back(1.0 / 3.0 * i - c);
    }
    s.particles.image.insert(s.particles.image.end(), {i % 3 - 1, -(i % 2)});
    s.particles.radius.push_back(0.0025 + 1e-6 * i);
    s.particles.mass.push_back(1e-4);
  }
  for (int k = 0; k < 30; ++k) {
    s.contacts.pair.insert(s.contacts.pair.end(), {2 * k, 2 * k + 2});
    s.contacts.image.insert(s.contacts.image.end(), {k % 2, 0});
    s.contacts.overlap.push_back(1e-5 * (k + 1));
    s.contacts.plastic_overlap.push_back(0.8e-5 * (k + 1));
    s.contacts.normal_force.push_back(0.01 * k);
    s.contacts.damping_force.push_back(-0.001 * k);
    s.contacts.tangential_force.insert(s.contacts.tangential_force.end(), {0.1 * k, 0.2 * k, 0.3 * k});
    s.contacts.branch.push_back(static_cast<std::int8_t>(k % 4));
  }
  for (int k = 0; k < 6; ++k) {
    s.plate_contacts.id.push_back(2 * k);
    s.plate_contacts.plate.push_back(static_cast<std::int8_t>(k));
    s.plate_contacts.overlap.push_back(1e-6 * k);
    s.plate_contacts.force.insert(s.plate_contacts.force.end(), {0.0, 0.5, 1.0 * k});
  }
  return s;
}

inline Profile profile(int stage) {
  return {{0.05, 0.15}, {0.4 + 0.01 * stage, 0.39}, {5.0, std::numeric_limits<double>::quiet_NaN()}};
}

inline RunInfo info(bool contacts = true) {
  return {"sample: R = 2.5 mm, \u03c3", 7, 2, "avx2", true, "adhesive", contacts};
}

inline Performance performance() { return {2, "avx2", "adhesive", true, 64000, 2.0, 3}; }

inline void append_stage(RunFolder& run, int stage) {
  for (int k = 0; k < rows_per_stage; ++k) run.append(row(stage, k), stage);
}

inline void write_stage(RunFolder& run, int stage) {
  append_stage(run, stage);
  run.close_stage(result(stage), snapshot(stage), profile(stage));
}

inline std::vector<StageResult> results(int stages) {
  std::vector<StageResult> list;
  for (int s = 0; s < stages; ++s) list.push_back(result(s));
  return list;
}

// A run on its way: two stages closed, two rows of the third. Whoever drops it has killed it.
inline RunFolder write_half_a_run(const fs::path& folder) {
  RunFolder run = RunFolder::create(folder, case_text, false);
  run.set_info(info());
  write_stage(run, 0);
  write_stage(run, 1);
  run.append(row(2, 0), 2);
  run.append(row(2, 1), 2);
  return run;
}

// A finished run of `stages` stages.
inline void write_run(const fs::path& folder, int stages = 4, bool contacts = true) {
  RunFolder run = RunFolder::create(folder, case_text, false);
  run.set_info(info(contacts));
  run.log("start", {{"threads", 2}, {"title", "sample"}});
  for (int s = 0; s < stages; ++s) write_stage(run, s);
  run.finish(0, 0xabcULL, performance(), results(stages));
  run.log("end", {{"exit_code", 0}});
}

}  // namespace platen::sample
