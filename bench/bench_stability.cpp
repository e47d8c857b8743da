// Where does it break, and does it say so? Beds under parameters, steps, speeds and overlaps up to and beyond what is
// sensible; each trial ends bounded, stopped with a message, or silently wrong (criteria: accuracy/stability_trial.h).
// Exit code 1 where one is silently wrong.   bench_stability --quick   takes less than a minute.
#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "bench/accuracy/stability_trial.h"
#include "bench/harness.h"

using namespace platen;
using namespace platen::bench;

namespace {

struct Sizes {
  int side = 8;             // spheres along an edge
  std::int64_t steps = 20000;
  bool large = true;
};

class Trials {
 public:
  explicit Trials(const Sizes& sizes) : sizes_(sizes) {}

  std::vector<Trial> all() {
    steps_of_time();
    law_parameters();
    motions();
    sizes_and_overlaps();
    return std::move(trials_);
  }

 private:
  // Spheres with 0.2 m/s at random between two plates, gravity on.
  Trial bed(const std::string& group, const std::string& name, const std::function<void(PairLaw&)>& change = {},
            const std::function<void(scenes::BedOptions&)>& shape = {}) const {
    scenes::BedOptions o;
    o.nx = o.ny = o.nz = sizes_.side;
    o.spacing = 2.02;
    if (shape) shape(o);
    PairLaw law = scenes::full_law();
    if (change) change(law);
    EngineOptions engine;
    engine.instruction_set = available_instruction_sets().back();
    Trial t;
    t.group = group, t.name = name, t.setup = scenes::bed(o, law, engine);
    t.z_top = scenes::height_of(o) + 0.1 * o.R, t.steps = sizes_.steps;
    return t;
  }

  // A bed at rest under pressure: overlapping at the start, left alone for a while.
  void steps_of_time() {
    struct Kind {
      const char* name;
      double k2, e;
    };
    for (const Kind& kind : {Kind{"undamped, k1 = k2", 5e3, 1.0}, Kind{"e = 0.4, k2 = 5 k1", 2.5e4, 0.4}, Kind{"e = 0.05, k1 = k2", 5e3, 0.05}})
      for (const double share : {0.1, 0.5, 0.9, 0.99, 1.05, 1.5, 2.0, 3.0}) {
        Trial t = bed("step", fmt::format("{}, {:g} dt_limit", kind.name, share),
                      [&](PairLaw& law) { law.k2 = kind.k2, law.restitution = kind.e, law.k_adh = law.f0 = 0.0; },
                      [](scenes::BedOptions& o) { o.spacing = 1.84, o.speed = 0.0; });
        t.share_of_limit = share, t.settle_steps = sizes_.steps / 2;
        if (kind.e == 1.0) t.settle_steps = 0;
        trials_.push_back(std::move(t));
      }
  }

  void law_parameters() {
    for (const double ratio : {1.0, 2.0, 5.0, 10.0, 30.0, 100.0})
      trials_.push_back(bed("k2/k1", fmt::format("{:g}", ratio), [&](PairLaw& law) { law.k2 = ratio * law.k1; }));
    for (const double ratio : {0.1, 1.0, 10.0})
      trials_.push_back(bed("k_adh/k1", fmt::format("{:g}", ratio), [&](PairLaw& law) { law.k_adh = ratio * law.k1; }));
    for (const double f0 : {0.0, -0.002, -0.02, -0.4, -4.0})
      trials_.push_back(bed("f0 [N]", fmt::format("{:g}", f0), [&](PairLaw& law) { law.f0 = f0; }));
    for (const double f0 : {-0.02, -0.4})
      trials_.push_back(bed("f0 [N], e = 1, k1 = k2", fmt::format("{:g}", f0), [&](PairLaw& law) { law.f0 = f0, law.k2 = law.k1, law.k_adh = 0.0, law.restitution = 1.0; }));
    for (const double e : {0.01, 0.1, 0.4, 0.9, 1.0})
      trials_.push_back(bed("restitution", fmt::format("{:g}", e), [&](PairLaw& law) { law.restitution = e; }));
    for (const double mu : {0.0, 1.0, 10.0})
      trials_.push_back(bed("friction", fmt::format("{:g}", mu), [&](PairLaw& law) { law.friction = mu; }));
    for (const auto model : {RollingModel::absolute, RollingModel::relative})
      for (const double mu_r : {0.0, 0.1, 1.0})
        trials_.push_back(bed(model == RollingModel::absolute ? "rolling friction, absolute" : "rolling friction, relative", fmt::format("{:g}", mu_r),
                              [&](PairLaw& law) { law.rolling_friction = mu_r, law.rolling_model = model; }));
    for (const double n : {0.8, 1.5, 2.0}) {
      Trial t = bed("exponent", fmt::format("{:g}", n), [&](PairLaw& law) {
        const double scale = std::pow(1e-4, 1.0 - n);  // the same force at 0.1 mm
        law.exponent = n, law.k1 *= scale, law.k2 *= scale, law.k_adh *= scale;
      });
      t.soft_overlap = n < 1.0 ? 2.5e-6 : 5e-4;
      trials_.push_back(std::move(t));
    }
  }

  void motions() {
    const double R = 2.5e-3, m = 4.0 / 3.0 * std::numbers::pi * R * R * R * 2000.0;
    for (const double share : {0.1, 0.5, 0.9, 1.2}) {  // relative speed whose head-on overlap is that share of R, by k1 alone
      const double v = share * R * std::sqrt(5e3 / (0.5 * m));
      Trial t = bed("head-on impact, overlap", fmt::format("{:g} R ({:.1f} m/s)", share, v), [](PairLaw& law) { law.restitution = 1.0, law.k_adh = law.f0 = 0.0; },
                    [](scenes::BedOptions& o) { o.nx = 2, o.ny = o.nz = 1, o.periodic = false, o.speed = 0.0; });
      t.setup.spheres.position[4] = t.setup.spheres.position[1], t.setup.spheres.position[5] = t.setup.spheres.position[2];
      t.setup.spheres.velocity[0] = 0.5 * v, t.setup.spheres.velocity[3] = -0.5 * v;
      t.setup.gravity = 0.0, t.bottom = false, t.z_top = 0.0;
      t.look_every = 1, t.steps = 400;
      trials_.push_back(std::move(t));
      Trial gas = bed("random impacts, head-on overlap", fmt::format("{:g} R", share), [](PairLaw& law) { law.restitution = 0.9, law.k_adh = law.f0 = 0.0; },
                      [&](scenes::BedOptions& o) { o.speed = 0.5 * v, o.spacing = 2.4; });
      trials_.push_back(std::move(gas));
    }
    for (const double speed : {0.01, 0.1, 1.0}) {
      Trial t = bed("top plate [m/s]", fmt::format("{:g}", speed));
      t.plate_speed = speed;
      trials_.push_back(std::move(t));
    }
    for (const double g : {10.0, 50.0}) {
      Trial t = bed("vibration, 60 Hz", fmt::format("{:g} g", g));
      t.amplitude = g * 9.81 / std::pow(2.0 * std::numbers::pi * 60.0, 2);
      t.z_top *= 1.5;
      trials_.push_back(std::move(t));
    }
    // From two spheres for 10^8 steps to 10^5 for 10^4: what creeps shows with time, what adds up shows with numbers.
    struct Rest {
      int nx, ny, nz;
      std::int64_t steps;
    };
    for (const Rest& r : {Rest{2, 1, 1, 100'000'000}, Rest{3, 4, 2, 100'000'000}, Rest{10, 10, 10, 1'000'000}, Rest{47, 47, 47, 10'000}})
      for (const bool cohesive : {true, false}) {
        if (!sizes_.large && r.nx > 10) continue;
        Trial rest = bed("long rest", fmt::format("{} spheres, {}", r.nx * r.ny * r.nz, cohesive ? "cohesive" : "cohesionless"),
                         [&](PairLaw& law) { if (!cohesive) law.k_adh = law.f0 = 0.0; },
                         [&](scenes::BedOptions& o) { o.nx = r.nx, o.ny = r.ny, o.nz = r.nz, o.periodic = r.ny > 1; });
        rest.steps = sizes_.large ? r.steps : std::min<std::int64_t>(r.steps / 100, 10'000);
        rest.look_every = std::max<std::int64_t>(250, rest.steps / 400), rest.z_top = 0.0;
        trials_.push_back(std::move(rest));
      }
  }

  void sizes_and_overlaps() {
    for (const double ratio : {2.0, 5.0, 10.0})
      trials_.push_back(bed("radius ratio", fmt::format("{:g}", ratio), {}, [&](scenes::BedOptions& o) { o.spread = 1.0 - 1.0 / ratio, o.speed = 2.0; }));
    for (const double spacing : {1.9, 1.6, 1.3, 0.9})
      trials_.push_back(bed("overlap at the start", fmt::format("{:.1f} R", 2.0 - spacing), {}, [&](scenes::BedOptions& o) { o.spacing = spacing; }));
    Trial walls = bed("box", "walls", {}, [](scenes::BedOptions& o) { o.periodic = false; });
    walls.walls = true;
    trials_.push_back(std::move(walls));
    Trial open = bed("box", "open, no plates", {}, [](scenes::BedOptions& o) { o.periodic = false; });
    open.bottom = false, open.z_top = 0.0;
    trials_.push_back(std::move(open));
    for (const int side : sizes_.large ? std::vector<int>{10, 22, 47} : std::vector<int>{10, 22}) {
      Trial t = bed("spheres", std::to_string(side * side * side), {}, [&](scenes::BedOptions& o) { o.nx = o.ny = o.nz = side; });
      t.steps = side > 12 ? sizes_.steps / 10 : sizes_.steps;
      trials_.push_back(std::move(t));
    }
    Trial two = bed("spheres", "2", {}, [](scenes::BedOptions& o) { o.nx = 2, o.ny = o.nz = 1, o.periodic = false; });
    trials_.push_back(std::move(two));
  }

  Sizes sizes_;
  std::vector<Trial> trials_;
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("where the program stays bounded, stops, or is silently wrong");
  bool quick = false;
  std::string markdown, json, only;
  app.add_flag("--quick", quick, "small beds, few steps: less than a minute");
  app.add_option("--only", only, "groups whose name contains this");
  app.add_option("--markdown", markdown, "write the table here too");
  app.add_option("--json", json, "write all figures here");
  CLI11_PARSE(app, argc, argv);

  const Sizes sizes = quick ? Sizes{4, 2000, false} : Sizes{8, 20000, true};
  std::string table = "| group | value | verdict | why | dt (s) | steps | energy gain | ledger residual | deepest overlap / R |\n|---|---|---|---|---|---|---|---|---|\n";
  std::fputs(table.c_str(), stdout);
  nlohmann::json rows = nlohmann::json::array();
  int wrong = 0, stopped = 0, bounded = 0;
  for (const Trial& t : Trials(sizes).all()) {
    if (t.group.find(only) == std::string::npos) continue;
    const double begin = seconds_now();
    const Verdict v = run_trial(t);
    (v.verdict == "bounded" ? bounded : v.verdict == "stopped" ? stopped : wrong)++;
    const std::string row = fmt::format("| {} | {} | {} | {} | {:.2e} | {} | {:.1e} | {:.1e} | {:.2f} |\n", t.group, t.name,
                                        v.verdict == "silently wrong" ? "**silently wrong**" : v.verdict, v.why, v.dt, v.steps, v.gain, v.residual, v.deepest);
    std::fputs(row.c_str(), stdout);
    std::fflush(stdout);
    table += row;
    rows.push_back({{"group", t.group}, {"value", t.name}, {"verdict", v.verdict}, {"why", v.why}, {"dt", v.dt}, {"steps", v.steps},
                    {"gain", v.gain}, {"residual", v.residual}, {"deepest", v.deepest}, {"spheres", t.setup.spheres.id.size()},
                    {"seconds", seconds_now() - begin}});
  }
  const std::string sum = fmt::format("\n{} bounded, {} stopped, {} silently wrong\n", bounded, stopped, wrong);
  std::fputs(sum.c_str(), stdout);
  table += sum;
  if (!markdown.empty()) std::ofstream(markdown) << table;
  if (!json.empty()) std::ofstream(json) << nlohmann::json{{"bench", "stability"}, {"processor", processor_name()}, {"quick", quick}, {"rows", rows}}.dump(1) << "\n";
  return wrong > 0 ? 1 : 0;
}
