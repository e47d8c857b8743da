// Kernels of the full scene without their guards; one translation unit for each instruction set.
#pragma once

#include "bench/unguarded.h"
#include "kernels/contact_kernel.h"
#include "kernels/motion_kernel.h"

namespace platen::bench {

template <class Isa>
UnguardedKernels unguarded_full() {
  constexpr SceneTraits full = [] {
    SceneTraits t = built_scenes[2].traits;
    t.energy = true;
    return t;
  }();
  static_assert(full.adhesion && full.plasticity && full.equal_spheres && full.rolling == Rolling::absolute);
  return {&contact_kernel<Isa, full, false, false>, &motion_kernel<Isa, true, true, true, false>};
}

}  // namespace platen::bench
