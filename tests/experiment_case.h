// Small experiments for the tests of stages, series and ledger: a case in a few lines, a whole run in a folder of its
// own, and single stages driven by hand.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "protocol/experiment.h"
#include "protocol/stages.h"
#include "tests/program.h"
#include "tests/results_reader.h"

namespace platen::test {

// A cohesive bed of R = 2.5 mm; stages are added behind it. 1e-5 s is about a fifth of its critical step; a look at the
// stop conditions falls on every 32nd step, hence on every multiple of 0.32 ms.
inline const std::string small_bed = R"([case]
title = "test"
seed = 3
[particles]
radius = "2.5 mm"
density = "2000 kg/m3"
count = 100
[particles.law]
k1 = "5 kN/m"
k2 = "25 kN/m"
k_adh = "5 kN/m"
restitution = 0.4
friction = 0.5
rolling_friction = 0.001
[box]
width = "20 mm"
depth = "20 mm"
height = "80 mm"
[time]
step = "10 us"
[output]
series = "0.32 ms"
)";

inline const std::string fill = "[[stage]]\nkind = \"fill\"\n";
inline const std::string quick_settle =
    "[[stage]]\nkind = \"settle\"\nuntil = { kinetic_to_potential = 1e-4, window = \"20 ms\" }\n";
inline const std::string press =
    "[[stage]]\nkind = \"compress\"\nspeed = \"50 mm/s\"\nstart_gap = \"0.1 mm\"\nuntil = { stress = \"20 kPa\" }\n";
inline const std::string unload = "[[stage]]\nkind = \"unload\"\nspeed = \"50 mm/s\"\n";
inline std::string time_passes(const std::string& duration) {
  return "[[stage]]\nkind = \"run\"\nduration = \"" + duration + "\"\n";
}

// Spheres from a table instead of a fill; no plates, no sides, no gravity unless said otherwise.
inline std::string table_case(const std::string& more, const std::string& sides = "",
                              const std::string& gravity = "0") {
  return R"([case]
title = "table"
[particles]
file = "spheres.csv"
radius = "2.5 mm"
density = "2000 kg/m3"
[particles.law]
k1 = "5 kN/m"
k2 = "25 kN/m"
restitution = 0.4
friction = 0.5
[environment]
gravity = )" +
         gravity + "\n" + (sides.empty() ? "[plates]\ntop = false\nbottom = false\n" : sides) +
         "[time]\nstep = \"10 us\"\n[output]\nseries = \"0.32 ms\"\n" + more;
}

// A finished run and what it left behind.
struct Trial {
  std::unique_ptr<TemporaryFolder> folder;
  Case c;
  RunOutcome outcome;
  CsvTable series;

  const StageResult& stage(const std::string& name) const {
    for (const StageResult& s : outcome.stages)
      if (s.name == name) return s;
    throw std::runtime_error("no stage " + name + ": " + outcome.message);
  }
  // Rows of series.csv that belong to a stage.
  std::vector<std::size_t> rows(const std::string& name) const {
    std::vector<std::size_t> found;
    for (std::size_t r = 0; r < series.rows.size(); ++r)
      if (series.cell(r, "stage") == name) found.push_back(r);
    return found;
  }
  double at(std::size_t row, const std::string& column) const { return series.number(row, column); }
  double weight_stress() const {  // [Pa]
    double weight = 0.0;
    const double R = c.particles.sizes.radius;
    weight = static_cast<double>(c.particles.count) * 4.0 / 3.0 * M_PI * R * R * R * c.particles.density * c.gravity;
    return weight / (c.box.width * c.box.depth);
  }
  std::filesystem::path path() const { return folder->path() / "run"; }
};

inline Trial run_case(const std::string& text, const std::vector<std::string>& overrides = {},
                      const RunOptions& options = {}, const std::string& table = "") {
  Trial run;
  run.folder = std::make_unique<TemporaryFolder>();
  if (!table.empty()) write_file(*run.folder / "spheres.csv", table);
  run.c = parse_case(text, "case.toml", run.folder->path(), overrides);
  RunFolder folder = RunFolder::create(run.path(), run.c.text, false);
  run.outcome = run_experiment(run.c, folder, options);
  run.series = read_csv(run.path() / "series.csv");
  return run;
}

// One stage after the other by hand, for what no file shows: where planes are, and the instant at which a stage begins.
struct Bench {
  TemporaryFolder folder;
  Case c;
  std::unique_ptr<Simulation> sim;
  std::optional<double> strain_zero_height;

  explicit Bench(const std::string& text, const std::vector<std::string>& overrides = {},
                 const std::string& table = "") {
    if (!table.empty()) write_file(folder / "spheres.csv", table);
    c = parse_case(text, "case.toml", folder.path(), overrides);
    sim = make_simulation(c, 1, false);
  }
  Stand stand(std::size_t k) {
    return {*sim, c, c.stages[k], sim->step(), sim->time(), strain_zero_height, sim->step(), 0.0};
  }

  // A stage from begin to end; most steps that it may take.
  void drive(std::size_t k, std::int64_t most = 400000) {
    Stand s = stand(k);
    Stage stage = make_stage(c.stages[k]);
    std::visit([&](auto& it) { it.begin(s); }, stage);
    for (std::int64_t n = 0; n < most; n += 32) {
      const auto exact = std::visit([&](auto& it) { return it.last_step(s); }, stage);
      sim->advance(exact ? std::min<std::int64_t>(32, *exact - sim->step()) : 32);
      Look look{sim->measure(false), std::nan("")};
      if (s.strain_zero_height) look.strain = 1.0 - look.m.height / *s.strain_zero_height;
      std::visit([&](auto& it) { it.update(s, look); }, stage);
      const bool over = std::visit([&](auto& it) { return it.done(s, look).has_value(); }, stage);
      if (over || (exact && sim->step() >= *exact)) {
        StageResult result;
        std::visit([&](auto& it) { it.end(s, result); }, stage);
        strain_zero_height = s.strain_zero_height;
        return;
      }
    }
    throw std::runtime_error("stage " + c.stages[k].name + " does not end");
  }
};

}  // namespace platen::test
