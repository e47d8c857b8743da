// The kernels alone, on lists taken from a settled bed: ns and bytes per contact by instruction set and scene, with
// lists that fit the first cache, the second, and the third. Google Benchmark's options apply; for figures that are to
// be compared use --benchmark_enable_random_interleaving --benchmark_repetitions=9 --benchmark_report_aggregates_only.
//
//   contacts/<isa>/<scene>/<list>    one pass over the pairs of the list; time step 0, so the state stays what it is
//   motion/<isa>/<spheres>/<list>    kick, drift, rows
//   plates/<isa>                     the spheres near the bottom plate
//   phases/<isa>/<scene>/<phase>     one phase of the contact kernel, sixteen times on each chunk of a list in the second cache: what it
//                                    takes once its numbers are in the first (manual time; ns for eight contacts); `active` is no
//                                    part of contacts/..., whose lists count as dense
//   unguarded/..., guarded/...       the first two without and with the guards (forces, overlaps, energies, velocities in
//                                    range): their cost is the difference
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <map>
#include <utility>

#include "bench/beds.h"
#include "bench/kernel_phases.h"
#include "bench/list_copies.h"
#include "bench/reference_loops.h"
#include "bench/unguarded.h"
#include "core/float_mode.h"

using namespace platen;
using namespace platen::bench;

namespace {

enum class List { l1, l2, l3 };
constexpr const char* list_names[] = {"L1", "L2", "L3"};

// Batches of a bed and everything a kernel needs to go over them.
struct Lists {
  std::unique_ptr<Simulation> sim;
  BenchScene scene;
  StateCopy state;
  std::vector<BatchCopy> batches;
  std::int64_t used = 0, particles = 0;

  Lists(std::unique_ptr<Simulation> s, const BenchScene& of, List list)
      : sim(std::move(s)), scene(of), state(sim->state()), batches(copies_of(*sim)) {
    // One batch from the middle of the curve where the list is to be small: 64 spheres fit the first cache, 1024 the
    // second; all batches of 35,000 spheres go through the third.
    if (list != List::l3) {
      BatchCopy middle = std::move(batches[batches.size() / 2]);
      batches.clear();
      batches.push_back(std::move(middle));
    }
    for (const BatchCopy& b : batches) used += b.used, particles += b.count;
  }
};

std::filesystem::path beds;

// Kept for all instruction sets: making them takes longer than running them.
Lists& lists(InstructionSet set, const BenchScene& scene, List list) {
  static std::map<std::string, std::unique_ptr<Lists>> known;
  auto& entry = known[fmt::format("{}/{}/{}", to_string(set), scene.name, list_names[static_cast<int>(list)])];
  if (!entry) {
    const Bed bed = dense_bed(list == List::l3 ? 35000 : 5000, beds);
    BenchEngine engine;
    engine.set = set;
    engine.batch = list == List::l1 ? 64 : 1024;
    auto sim = make_simulation(bed, scene, engine);
    sim->advance(32);
    sim->rebuild_now();
    entry = std::make_unique<Lists>(std::move(sim), scene, list);
  }
  return *entry;
}

void finish(benchmark::State& state, double items, double bytes, const char* item) {
  const double passes = static_cast<double>(state.iterations());
  // A rate inverted: seconds per item times 1e9.
  state.counters[fmt::format("ns/{}", item)] =
      benchmark::Counter(1e-9 * items * passes, benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
  state.counters[fmt::format("bytes/{}", item)] = bytes / items;
  state.counters["GB/s"] = benchmark::Counter(1e-9 * bytes * passes, benchmark::Counter::kIsRate);
  state.counters[fmt::format("{}s", item)] = items;
}

void contacts(benchmark::State& state, InstructionSet set, const BenchScene& scene, List list, decltype(KernelTable::contacts) kernel) {
  Lists& l = lists(set, scene, list);
  if (kernel == nullptr) kernel = l.sim->kernels().contacts;
  const FloatMode mode;
  LawConstants law = l.sim->law();
  law.dt = 0.0;
  PairTotals totals;
  double bytes = 0.0;
  for (const BatchCopy& b : l.batches) bytes += static_cast<double>(b.list_bytes() + b.row_bytes() + b.sum_bytes());
  std::int64_t touching = 0;
  for (auto _ : state) {
    touching = 0;
    for (BatchCopy& b : l.batches) {
      std::memset(b.sum.data(), 0, b.sum.size() * sizeof(double));  // part of a pass: core does it too
      totals.contacts = 0;
      kernel(b.pairs(l.state), law, totals);
      touching += totals.contacts;
    }
    benchmark::ClobberMemory();
  }
  if (totals.out_of_range) state.SkipWithError("forces out of range");
  finish(state, static_cast<double>(touching), bytes, "contact");
  state.counters["listed/contact"] = static_cast<double>(l.used) / static_cast<double>(touching);
}

void phase(benchmark::State& state, InstructionSet set, const BenchScene& scene, PhasePass pass, Phase which) {
  Lists& l = lists(set, scene, List::l2);
  const FloatMode mode;
  LawConstants law = l.sim->law();
  law.dt = 0.0;
  BatchCopy& b = l.batches.front();
  const auto seconds = [&](int times) {
    std::memset(b.sum.data(), 0, b.sum.size() * sizeof(double));
    const auto start = std::chrono::steady_clock::now();
    pass(b.pairs(l.state), law, which, times);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  constexpr int times = 16;
  // A difference that noise makes negative counts as next to nothing, or the library would never end.
  for (auto _ : state) state.SetIterationTime(std::max(1e-9, (seconds(times + 1) - seconds(1)) / times));
  const double eights = static_cast<double>(b.padded / chunk_size) * (chunk_size / 8);
  state.counters["ns/8"] = benchmark::Counter(1e-9 * eights * static_cast<double>(state.iterations()),
                                              benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

void motion(benchmark::State& state, InstructionSet set, const BenchScene& scene, List list, decltype(KernelTable::motion) kernel) {
  Lists& l = lists(set, scene, list);
  if (kernel == nullptr) kernel = l.sim->kernels().motion;
  const FloatMode mode;
  // Forces stay those of the lists; without kick and drift nothing runs away however often this is repeated.
  MotionConstants c = motion_constants(*l.sim, scene.law, scene.gravity);
  c.kick = c.drift = 0.0;
  MotionTotals totals;
  for (auto _ : state) {
    for (BatchCopy& b : l.batches) kernel(b.motion(l.state), c, totals);
    benchmark::ClobberMemory();
  }
  if (totals.out_of_range) state.SkipWithError("velocities out of range");
  // Reads a record and ten columns, writes nine columns and a row.
  const double bytes_each = 8.0 * (record_size + 10 + 9 + row_size);
  finish(state, static_cast<double>(l.particles), bytes_each * static_cast<double>(l.particles), "particle");
}

void plates(benchmark::State& state, InstructionSet set) {
  Lists& l = lists(set, bench_scene("full"), List::l3);
  const FloatMode mode;
  PlateConstants law = l.sim->plate_law();
  law.dt = 0.0;
  PlateTotals totals;
  std::int64_t used = 0;
  for (const BatchCopy& b : l.batches)
    for (const PlateCopy& p : b.plates) used += p.plate == plate_bottom ? p.used : 0;
  for (auto _ : state) {
    for (BatchCopy& b : l.batches)
      for (PlateCopy& p : b.plates)
        if (p.plate == plate_bottom) l.sim->kernels().plates(p.view(l.state), plane_shape(plate_bottom), law, totals);
    benchmark::ClobberMemory();
  }
  if (totals.out_of_range) state.SkipWithError("forces out of range");
  // Index, row, four columns read and written, a record and the overlap written.
  finish(state, static_cast<double>(used), static_cast<double>(used) * (4 + 8.0 * (row_size + 2 * 4 + record_size + 1)),
         "sphere");
}

void add_all() {
  const std::vector<std::string> names = {"linear",       "no_adhesion",      "full",
                                          "no_energy",    "unequal_radii",    "three_halves",
                                          "any_exponent", "relative_rolling", "reproducible"};
  for (const InstructionSet set : available_instruction_sets()) {
    for (const std::string& name : names)
      for (const List list : {List::l1, List::l2, List::l3}) {
        const BenchScene scene = bench_scene(name);
        if (list != List::l2 && name != "full" && name != "linear") continue;  // the cache matters once
        benchmark::RegisterBenchmark(
            fmt::format("contacts/{}/{}/{}", to_string(set), name, list_names[static_cast<int>(list)]).c_str(),
            contacts, set, scene, list, nullptr);
      }
    for (const List list : {List::l1, List::l2, List::l3})
      for (const char* name : {"full", "unequal_radii"})
        benchmark::RegisterBenchmark(
            fmt::format("motion/{}/{}/{}", to_string(set), name, list_names[static_cast<int>(list)]).c_str(), motion,
            set, bench_scene(name), list, nullptr);
    benchmark::RegisterBenchmark(fmt::format("plates/{}", to_string(set)).c_str(), plates, set);
    if (const PhasePasses passes = phase_passes(set); passes.full != nullptr)
      for (const auto& [name, pass] : {std::pair{"full", passes.full}, std::pair{"linear", passes.linear}})
        for (const Phase which : {Phase::geometry, Phase::active, Phase::motion, Phase::springs, Phase::slips, Phase::forces, Phase::output})
          benchmark::RegisterBenchmark(
              fmt::format("phases/{}/{}/{}", to_string(set), name, phase_names[static_cast<int>(which)]).c_str(), phase,
              set, bench_scene(name), pass, which)
              ->UseManualTime()
              ->MinTime(0.01);  // of what is counted, behind which stands some thirty to a hundred times as much
    if (const UnguardedKernels bare = unguarded_kernels(set); bare.contacts != nullptr) {
      const BenchScene full = bench_scene("full");
      benchmark::RegisterBenchmark(fmt::format("guarded/contacts/{}/L1", to_string(set)).c_str(), contacts, set, full, List::l1, nullptr);
      benchmark::RegisterBenchmark(fmt::format("unguarded/contacts/{}/L1", to_string(set)).c_str(), contacts, set, full, List::l1, bare.contacts);
      benchmark::RegisterBenchmark(fmt::format("guarded/motion/{}/L1", to_string(set)).c_str(), motion, set, full, List::l1, nullptr);
      benchmark::RegisterBenchmark(fmt::format("unguarded/motion/{}/L1", to_string(set)).c_str(), motion, set, full, List::l1, bare.motion);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  const char* folder = std::getenv("PLATEN_BENCH_BEDS");
  beds =
      folder != nullptr ? std::filesystem::path(folder) : std::filesystem::temp_directory_path() / "platen-bench-beds";
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  try {
    const auto note = [](const char* when, InstructionSet set) {
      const ReferenceLoops loops = reference_loops(set);
      benchmark::AddCustomContext(
          fmt::format("reference_{}_{}", to_string(set), when),
          fmt::format("FMA {:.1f} Gflop/s, L2 {:.0f} GB/s, L3 {:.0f} GB/s", loops.fma, loops.l2, loops.l3));
    };
    for (const InstructionSet set : available_instruction_sets()) note("at_start", set);
    add_all();
    benchmark::RunSpecifiedBenchmarks();
    for (const InstructionSet set : available_instruction_sets()) {
      const ReferenceLoops loops = reference_loops(set);
      fmt::print(stderr, "at the end, {}: FMA {:.1f} Gflop/s, L2 {:.0f} GB/s, L3 {:.0f} GB/s\n", to_string(set),
                 loops.fma, loops.l2, loops.l3);
    }
  } catch (const std::exception& error) {
    fmt::print(stderr, "bench_kernels: {}\n", error.what());
    return 2;
  }
  benchmark::Shutdown();
  return 0;
}
