// No memory is asked for inside a step: what a run of steps asks for does not depend on how many they are.
#include <gtest/gtest.h>

#include <atomic>
#include <cstddef>

#include "tests/scenes.h"

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && defined(__GLIBC__)
// glibc's own functions under the names by which everything, operator new included, asks for memory.
namespace {
std::atomic<long> asked{0};
}
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* malloc(std::size_t bytes) { return asked.fetch_add(1, std::memory_order_relaxed), __libc_malloc(bytes); }
void* realloc(void* old, std::size_t bytes) { return asked.fetch_add(1, std::memory_order_relaxed), __libc_realloc(old, bytes); }
void* aligned_alloc(std::size_t alignment, std::size_t bytes) {
  return asked.fetch_add(1, std::memory_order_relaxed), __libc_memalign(alignment, bytes);
}
}

namespace platen {
namespace {

using scenes::BedOptions;

long asked_by(Simulation& sim, std::int64_t steps) {
  const long before = asked.load();
  sim.advance(steps);
  return asked.load() - before;
}

TEST(Allocation, NoneInsideAStep) {
  BedOptions o;
  o.nx = o.ny = 8, o.nz = 8, o.speed = 0.0, o.spacing = 1.98;
  EngineOptions engine;
  engine.executor = Executor::serial, engine.batch = 64, engine.inner_gap = 0.3 * o.R, engine.skin = 0.8 * o.R;
  engine.instruction_set = available_instruction_sets().back();
  Simulation sim(scenes::bed(o, scenes::full_law(), engine));
  sim.set_time_step(1e-6);
  sim.advance(64);
  EXPECT_GT(asked.load(), 0) << "the counter sees nothing";
  const auto lists = [&] { return sim.counters().rebuilds + sim.counters().prunes; };
  const auto before = lists();
  asked_by(sim, 32);
  const long one = asked_by(sim, 1), many = asked_by(sim, 32);
  ASSERT_EQ(lists(), before) << "lists were made in between: nothing is learnt";
  EXPECT_EQ(one, many);
  EXPECT_GT(sim.measure().contacts, 100);
}

}  // namespace
}  // namespace platen
#else
TEST(Allocation, NoneInsideAStep) { GTEST_SKIP() << "memory is the sanitizer's"; }
#endif
