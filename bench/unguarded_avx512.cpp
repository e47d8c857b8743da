#include "bench/unguarded.h"
#include "kernels/contact_kernel.h"
#include "kernels/motion_kernel.h"

namespace platen::bench {

UnguardedKernels unguarded_avx512() {
  constexpr SceneTraits full = [] {
    SceneTraits t = built_scenes[2].traits;
    t.energy = true;
    return t;
  }();
  static_assert(full.adhesion && full.plasticity && full.equal_spheres && full.rolling == Rolling::absolute);
  return {&contact_kernel<Avx512, full, false, false>, &motion_kernel<Avx512, true, true, true, false>};
}

}  // namespace platen::bench
