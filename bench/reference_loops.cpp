#include "bench/reference_loops.h"

#include <immintrin.h>
#include <pthread.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <map>
#include <thread>
#include <vector>

#include "bench/harness.h"
#include "core/aligned.h"

namespace platen::bench {

namespace {

volatile double sink;  // keeps the loops' results, hence the loops

// Twelve independent accumulators: enough for two units with a latency of four to six cycles.
constexpr int chains = 12;

double fma_scalar(long n) {  // baseline code has no fma instruction: multiply and add, as the scalar kernels' hardware
  double a[chains];
  for (int k = 0; k < chains; ++k) a[k] = k;
  for (long i = 0; i < n; ++i)
#pragma GCC unroll 12
    for (int k = 0; k < chains; ++k) {
      a[k] = a[k] * 0.999 + 1e-3;
      __asm__ volatile("" : "+x"(a[k]));
    }
  double sum = 0.0;
  for (double x : a) sum += x;
  return sum;
}

__attribute__((target("avx2,fma"))) double fma_avx2(long n) {
  __m256d a[chains];
  const __m256d b = _mm256_set1_pd(0.999), c = _mm256_set1_pd(1e-3);
  for (int k = 0; k < chains; ++k) a[k] = _mm256_set1_pd(k);
  for (long i = 0; i < n; ++i)
#pragma GCC unroll 12
    for (int k = 0; k < chains; ++k) a[k] = _mm256_fmadd_pd(a[k], b, c);
  for (int k = 1; k < chains; ++k) a[0] = _mm256_add_pd(a[0], a[k]);
  return _mm256_cvtsd_f64(a[0]);
}

__attribute__((target("avx512f"))) double fma_avx512(long n) {
  __m512d a[chains];
  const __m512d b = _mm512_set1_pd(0.999), c = _mm512_set1_pd(1e-3);
  for (int k = 0; k < chains; ++k) a[k] = _mm512_set1_pd(k);
  for (long i = 0; i < n; ++i)
#pragma GCC unroll 12
    for (int k = 0; k < chains; ++k) a[k] = _mm512_fmadd_pd(a[k], b, c);
  for (int k = 1; k < chains; ++k) a[0] = _mm512_add_pd(a[0], a[k]);
  double out[8];
  _mm512_storeu_pd(out, a[0]);
  return out[0];
}

double read_scalar(const double* p, std::size_t n) {
  double a[8] = {};
  for (std::size_t i = 0; i + 8 <= n; i += 8)
#pragma GCC unroll 8
    for (std::size_t k = 0; k < 8; ++k) a[k] += p[i + k];
  return ((a[0] + a[1]) + (a[2] + a[3])) + ((a[4] + a[5]) + (a[6] + a[7]));
}

__attribute__((target("avx2"))) double read_avx2(const double* p, std::size_t n) {
  __m256d a[8];
  for (auto& x : a) x = _mm256_setzero_pd();
  for (std::size_t i = 0; i + 32 <= n; i += 32)
#pragma GCC unroll 8
    for (std::size_t k = 0; k < 8; ++k) a[k] = _mm256_add_pd(a[k], _mm256_load_pd(p + i + 4 * k));
  for (int k = 1; k < 8; ++k) a[0] = _mm256_add_pd(a[0], a[k]);
  return _mm256_cvtsd_f64(a[0]);
}

__attribute__((target("avx512f"))) double read_avx512(const double* p, std::size_t n) {
  __m512d a[8];
  for (auto& x : a) x = _mm512_setzero_pd();
  for (std::size_t i = 0; i + 64 <= n; i += 64)
#pragma GCC unroll 8
    for (std::size_t k = 0; k < 8; ++k) a[k] = _mm512_add_pd(a[k], _mm512_load_pd(p + i + 8 * k));
  for (int k = 1; k < 8; ++k) a[0] = _mm512_add_pd(a[0], a[k]);
  double out[8];
  _mm512_storeu_pd(out, a[0]);
  return out[0];
}

// Largest work per second of five parts of `seconds`; work() does `unit` of it.
template <class Work>
double best_rate(double seconds, double unit, const Work& work) {
  double best = 0.0;
  for (int part = 0; part < 5; ++part) {
    const double start = seconds_now();
    double taken = 0.0;
    long done = 0;
    do {
      sink = work();
      ++done;
      taken = seconds_now() - start;
    } while (taken < 0.2 * seconds);
    best = std::max(best, unit * static_cast<double>(done) / taken);
  }
  return best;
}

double read_rate(InstructionSet set, std::size_t bytes, double seconds) {
  AlignedArray<double> array;
  array.assign(bytes / sizeof(double) / 64 * 64, 1.0);
  const auto read = set == InstructionSet::avx512 ? read_avx512 : set == InstructionSet::avx2 ? read_avx2 : read_scalar;
  // AlignedArray staggers by whole cache lines, so vector loads are aligned.
  return best_rate(seconds, 1e-9 * static_cast<double>(array.size() * sizeof(double)),
                   [&] { return read(array.data(), array.size()); });
}

// Two threads, one on each of the first two processors, write to the same line in turn. Some 50 ns where they share a third cache,
// several times as long where they do not: a hypervisor may move a machine between the two.
double round_trip() {
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  if (sched_getaffinity(0, sizeof allowed, &allowed) != 0) return 0.0;
  std::vector<int> processors;
  for (int k = 0; k < CPU_SETSIZE && processors.size() < 2; ++k)
    if (CPU_ISSET(k, &allowed)) processors.push_back(k);
  if (processors.size() < 2) return 0.0;
  alignas(64) std::atomic<int> line{0};
  constexpr int turns = 4000, parts = 5;
  double taken[parts] = {};
  const auto play = [&](int me) {
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(processors[static_cast<std::size_t>(me)], &one);
    pthread_setaffinity_np(pthread_self(), sizeof one, &one);
    for (int part = 0; part < parts; ++part) {
      const double start = seconds_now();
      for (int turn = 0; turn < turns; ++turn) {
        const int mine = 2 * (part * turns + turn) + me;
        while (line.load(std::memory_order_acquire) != mine) {
        }
        line.store(mine + 1, std::memory_order_release);
      }
      if (me == 0) taken[part] = seconds_now() - start;
    }
  };
  std::thread first(play, 0), second(play, 1);
  first.join(), second.join();
  std::sort(taken, taken + parts);
  return 1e9 * taken[parts / 2] / turns;
}

std::size_t cache_size(int name, std::size_t otherwise) {
  const long size = sysconf(name);
  return size > 0 ? static_cast<std::size_t>(size) : otherwise;
}

}  // namespace

ReferenceLoops reference_loops(InstructionSet set, double seconds) {
  const auto fma = set == InstructionSet::avx512 ? fma_avx512 : set == InstructionSet::avx2 ? fma_avx2 : fma_scalar;
  const double width = set == InstructionSet::avx512 ? 8 : set == InstructionSet::avx2 ? 4 : 1;
  constexpr long turns = 20000;
  const std::size_t l2 = cache_size(_SC_LEVEL2_CACHE_SIZE, std::size_t{1} << 20);
  const std::size_t l3 = cache_size(_SC_LEVEL3_CACHE_SIZE, std::size_t{32} << 20);
  ReferenceLoops loops;
  loops.fma = best_rate(seconds, 1e-9 * 2.0 * chains * width * turns, [&] { return fma(turns); });
  loops.l2 = read_rate(set, l2 / 2, seconds);
  loops.l3 = read_rate(set, std::clamp(l3 / 4, 2 * l2, std::size_t{16} << 20), seconds);
  loops.cores = round_trip();
  return loops;
}

void add_reference(nlohmann::json& row, InstructionSet set) {
  static std::map<InstructionSet, double> largest;
  const ReferenceLoops loops = reference_loops(set);
  double& most = largest[set];
  most = std::max(most, loops.fma);
  row["fma"] = loops.fma, row["l2"] = loops.l2, row["l3"] = loops.l3, row["cores"] = loops.cores;
  row["state"] = loops.fma / most;
}

}  // namespace platen::bench
