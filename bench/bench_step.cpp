// The whole time step through Simulation::advance, the way `platen run` takes: bench_step --help.
#include <CLI/CLI.hpp>

#include <cstdio>
#include <exception>

#include "bench/step_modes.h"

using namespace platen;
using namespace platen::bench;

namespace {

StepOptions options;
std::vector<std::string> set_names;

void common(CLI::App& mode) {
  mode.add_option("-n,--particles", options.particles, "numbers of particles")->delimiter(',');
  mode.add_option("-t,--threads", options.threads, "numbers of threads")->delimiter(',');
  mode.add_option("-i,--isa", set_names, "scalar, avx2, avx512, or all")->delimiter(',');
  mode.add_option("-s,--scene", options.scenes, "scenes by name")->delimiter(',');
  mode.add_option("--seconds", options.seconds, "length of a block, about");
  mode.add_option("--steps", options.steps, "length of a block, exactly");
  mode.add_option("--warm", options.warm, "steps before anything is timed");
  mode.add_option("-r,--rounds", options.rounds, "blocks that count");
  mode.add_option("--batch", options.batch, "particles in a batch; 0 = chosen");
  mode.add_option("--cache", options.cache, "that cuts and orders of a large bed's tasks count on, in MiB for each thread; 0 = chosen");
  mode.add_option("--unroll", options.unroll, "most steps between two looks at the lists; 0 = chosen");
  mode.add_option("--skin", options.skin, "of the outer lists, in radii; 0 = chosen");
  mode.add_option("--gap", options.gap, "of the inner lists, in radii; 0 = chosen");
  mode.add_option("--beds", options.beds, "folder where beds are kept");
  mode.add_option("--json", options.json, "file for the table");
}

void find_sets() {
  const auto available = available_instruction_sets();
  for (const std::string& name : set_names) {
    bool found = false;
    for (const InstructionSet set : available)
      if (name == "all" || name == to_string(set)) options.sets.push_back(set), found = true;
    if (!found) throw std::invalid_argument("no instruction set '" + name + "' here");
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("platen's time step: M particle-steps/s, with the state of the machine beside each figure");
  app.require_subcommand(1);
  options.beds = std::filesystem::temp_directory_path() / "platen-bench-beds";
  for (const auto& [name, what] : std::vector<std::pair<std::string, std::string>>{
           {"steps", "numbers of particles x scenes x instruction sets x threads"},
           {"pairs", "one thread against many, in interleaved pairs; as many beds side by side"},
           {"features", "time of every scene over that of the full one"},
           {"scalar", "against a plain scalar half-list step, checked to agree"},
           {"executors", "flow graph against two parallel_for a step"},
           {"rain", "loose falling spheres, rebuilds included"},
           {"rebuilds", "the cost of making all lists anew"},
           {"phases", "where the time of a step goes"},
           {"schedule", "the graph on more cores than there are, simulated from measured task times"},
           {"orders", "bytes that the order of a large bed's tasks brings from memory, by count"},
           {"one", "blocks of one scene as one JSON line"},
           {"one-rain", "the same for rain"},
           {"scenes", "lists the scenes"},
           {"sets", "lists the instruction sets of this processor, the best last"}}) {
    CLI::App* mode = app.add_subcommand(name, what);
    if (name != "scenes" && name != "sets") common(*mode);
  }
  CLI11_PARSE(app, argc, argv);
  try {
    find_sets();
    const std::string mode = app.get_subcommands().front()->get_name();
    if (mode == "steps") table_of_steps(options);
    if (mode == "pairs") table_of_threads(options);
    if (mode == "features") table_of_features(options);
    if (mode == "scalar" && !table_of_scalar(options)) return 1;
    if (mode == "executors" && !table_of_executors(options)) return 1;
    if (mode == "rain") table_of_rain(options);
    if (mode == "rebuilds") table_of_rebuilds(options);
    if (mode == "phases") table_of_phases(options);
    if (mode == "schedule") table_of_schedules(options);
    if (mode == "orders") table_of_orders(options);
    if (mode == "one") one_block(options, false);
    if (mode == "one-rain") one_block(options, true);
    if (mode == "scenes")
      for (const BenchScene& scene : bench_scenes()) std::printf("%s\n", scene.name.c_str());
    if (mode == "sets")
      for (const InstructionSet set : available_instruction_sets()) std::printf("%s\n", to_string(set));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_step: %s\n", error.what());
    return 2;
  }
  return 0;
}
