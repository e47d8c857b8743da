// Where the time of a step goes, and how far it is from what the memory allows.
#include <algorithm>

#include "bench/parallel_for_step.h"
#include "bench/reference_loops.h"
#include "bench/step_modes.h"

namespace platen::bench {

void table_of_phases(const StepOptions& o) {
  Table table("Where the time of a step goes, one thread, scene full: ns per particle and step",
              {{"particles", "particles", 10, 0},
               {"contacts", "contacts", 9, 1},
               {"integrate", "integrate", 10, 1},
               {"lists", "lists, saving", 14, 1},
               {"whole", "whole step", 11, 1},
               {"bytes", "bytes", 7, 0},
               {"GB/s", "GB/s", 7, 1},
               {"memory_bound", "L3 alone", 9, 1},
               {"l2", "L2 GB/s", 8, 0},
               {"l3", "L3 GB/s", 8, 0}});
  for (const std::int64_t particles : either(o.particles, {5000, 35000})) {
    const Bed bed = dense_bed(particles, o.beds);
    const BenchScene scene = bench_scene("full");
    const InstructionSet set = sets_of(o).front();
    const auto sim = make_simulation(bed, scene, engine_of(o, set, 1));
    sim->advance(o.warm);
    const std::int64_t steps = o.steps > 0 ? o.steps : std::max<std::int64_t>(64, 10000000 / particles);
    // Both in turn, so that a machine that changes its speed changes it for both; the medians are of the rounds.
    std::vector<double> whole, contacts, integrate;
    double bytes = 0.0;
    const double n = static_cast<double>(particles);
    for (int round = 0; round < o.rounds; ++round) {
      whole.push_back(1e9 * seconds_of([&] { sim->advance(steps); }) / (n * static_cast<double>(steps)));
      sim->rebuild_now();
      ParallelForStep tasks(*sim, scene.law, scene.gravity, 1);
      double sums[2] = {0.0, 0.0};
      for (const auto& t : tasks.times(40)) sums[0] += t.contacts, sums[1] += t.integrate;
      contacts.push_back(1e9 * sums[0] / n), integrate.push_back(1e9 * sums[1] / n);
      bytes = tasks.bytes() / n;
    }
    const ReferenceLoops loops = reference_loops(set);
    const double w = median(whole), c = median(contacts), i = median(integrate);
    table.add({{"particles", particles},
               {"contacts", c},
               {"integrate", i},
               {"lists", w - c - i},
               {"whole", w},
               {"bytes", bytes},
               {"GB/s", bytes / w},
               {"memory_bound", bytes / loops.l3},
               {"l2", loops.l2},
               {"l3", loops.l3}});
  }
  write_json(o.json, "phases", table);
}

}  // namespace platen::bench
