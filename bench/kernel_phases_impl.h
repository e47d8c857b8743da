// Included by the files that are built for one instruction set.
#pragma once

#include "bench/kernel_phases.h"
#include "kernels/contact_kernel.h"

namespace platen::bench {

// The loops of contact_kernel, each a function of its own so that none is moved into another.
template <class I, SceneTraits scene>
class PhasesOfChunk {
 public:
  PhasesOfChunk(const PairBatch& batch, const LawConstants& constants) : b_(batch), c_(constants) {}

  __attribute__((noinline)) void run(Phase phase, std::int32_t start) {
    switch (phase) {
      case Phase::geometry: return geometry(start);
      case Phase::active: return active();
      case Phase::motion: return motion(start);
      case Phase::springs: return springs(start);
      case Phase::slips: return slips(start);
      case Phase::forces: return forces(start);
      case Phase::output: return output(start);
    }
  }

 private:
  using Wide = typename Interleaved<I>::Type;

  __attribute__((noinline)) void geometry(std::int32_t start) {
    const PairBatch b = b_;
    const LawConstants c = c_;
    for (int at = 0; at < chunk_size; at += I::width) fetch_geometry<I, scene, false, true>(chunk_, at, b, c, start + at);
  }
  __attribute__((noinline)) void active() { find_active<Wide, scene>(chunk_, b_, chunk_size, active_); }
  __attribute__((noinline)) void motion(std::int32_t start) {
    const PairBatch b = b_;
    const LawConstants c = c_;
    typename I::Real shortest = I::set(1.0);
    for (int at = 0; at < chunk_size; at += I::width) shortest = I::min(fetch_motion<I, scene>(chunk_, at, b, c, start + at), shortest);
    kept_ += I::sum(shortest);
  }
  void springs(std::int32_t start) {
    law(start, [](auto&... of) __attribute__((always_inline)) { springs_of_pairs<Wide, scene, false>(of...); });
  }
  void slips(std::int32_t start) {
    law(start, [](auto&... of) __attribute__((always_inline)) { slips_of_pairs<Wide, scene, false>(of...); });
  }
  void forces(std::int32_t start) {
    law(start, [](auto&... of) __attribute__((always_inline)) { forces_of_pairs<Wide, scene, false>(of...); });
  }
  // A third of it.
  template <class Third>
  __attribute__((noinline)) void law(std::int32_t start, const Third& third) {
    const PairBatch b = b_;
    const LawConstants c = c_;
    ChunkSums<Wide> sums;
    for (int at = 0; at < chunk_size; at += Wide::width) {
      const std::int32_t k = start + at;
      third(chunk_, at, b, c, k, sums);
    }
    keep(sums);
  }
  __attribute__((noinline)) void output(std::int32_t start) {
    const PairBatch b = b_;
    const LawConstants c = c_;
    typename I::Record carried = I::zero_record();
    for (int at = 0; at < chunk_size; at += I::width) output_pairs<I, scene>(chunk_, at, b, c, start + at, carried);
  }
  void keep(const ChunkSums<Wide>& sums) {
    using Sum = typename SingleOf<Wide>::Type;
    for_each_energy<Sum, scene>(sums.energy, [&](int, const typename Sum::Real& sum) { kept_ += Sum::sum(sum); });
    kept_ += sums.contacts;
  }

  Chunk<scene> chunk_;
  ActiveVectors active_;
  PairBatch b_;
  LawConstants c_;
  double kept_ = 0.0;  // so that nothing is left out
};

template <class I, SceneTraits scene>
void phase_pass(const PairBatch& b, const LawConstants& c, Phase which, int times) {
  PhasesOfChunk<I, scene> phases(b, c);
  for (std::int32_t start = 0; start + chunk_size <= b.count; start += chunk_size)
    for (const Phase phase : {Phase::geometry, Phase::active, Phase::motion, Phase::springs, Phase::slips, Phase::forces, Phase::output})
      for (int k = phase == which ? times : 1; k > 0; --k) phases.run(phase, start);
}

template <class I>
PhasePasses passes_of() {
  constexpr SceneTraits full = built_scenes[2].traits, linear = built_scenes[0].traits;
  static_assert(full.adhesion && full.plasticity && full.equal_spheres && full.rolling == Rolling::absolute && full.energy);
  static_assert(!linear.plasticity && linear.equal_spheres && linear.rolling == Rolling::none && linear.energy);
  return {&phase_pass<I, full>, &phase_pass<I, linear>};
}

}  // namespace platen::bench
