// Turns the kernel templates into function pointers; included by the isa_<name>.cpp files only.
#pragma once

#include <utility>

#include "kernels/choose_kernel.h"
#include "kernels/contact_kernel.h"
#include "kernels/kernel_table.h"
#include "kernels/look_kernel.h"
#include "kernels/merge_kernel.h"
#include "kernels/motion_kernel.h"
#include "kernels/plate_kernel.h"
#include "kernels/search_kernel.h"
#include "kernels/settle_kernel.h"

namespace platen {

template <class I, int scene, bool energy, bool exact>
constexpr auto contact_pointer() {
  constexpr SceneTraits traits = [] {
    SceneTraits t = built_scenes[scene].traits;
    t.energy = energy;
    return t;
  }();
  return &contact_kernel<I, traits, exact>;
}

template <class I, bool energy, bool exact, int... scenes>
auto contact_of_scene(int scene, std::integer_sequence<int, scenes...>) {
  decltype(KernelTable::contacts) found = nullptr;
  ((scene == scenes ? void(found = contact_pointer<I, scenes, energy, exact>()) : void()), ...);
  return found;
}

template <class I, int... scenes>
bool equal_spheres_of(int scene, std::integer_sequence<int, scenes...>) {  // by constants: the list itself is not emitted
  bool equal = false;
  ((scene == scenes ? void(equal = std::bool_constant<built_scenes[scenes].traits.equal_spheres>::value) : void()), ...);
  return equal;
}

template <class I, bool energy>
auto motion_of(bool equal_spheres, bool rolling) {
  decltype(KernelTable::motion) all[2][2] = {
      {&motion_kernel<I, false, false, energy>, &motion_kernel<I, false, true, energy>},
      {&motion_kernel<I, true, false, energy>, &motion_kernel<I, true, true, energy>}};
  return all[equal_spheres][rolling];
}

template <class I>
KernelTable kernels_of(InstructionSet set, const KernelRequest& request) {
  constexpr auto scenes = std::make_integer_sequence<int, static_cast<int>(built_scenes.size())>();
  KernelTable table;
  table.instruction_set = set;
  table.scene = request.scene;  // choose_kernels has chosen
  table.energy = request.needed.energy;
  table.reproducible = request.reproducible;
  const bool equal_spheres = equal_spheres_of<I>(table.scene, scenes);
  if (request.reproducible) {
    table.contacts = table.energy ? contact_of_scene<I, true, true>(table.scene, scenes)
                                  : contact_of_scene<I, false, true>(table.scene, scenes);
    table.plates = &plate_kernel<I, true>;
  } else {
    table.contacts = table.energy ? contact_of_scene<I, true, false>(table.scene, scenes)
                                  : contact_of_scene<I, false, false>(table.scene, scenes);
    table.plates = &plate_kernel<I, false>;
  }
  table.stages = I::picks && equal_spheres;
  table.motion = table.energy ? motion_of<I, true>(equal_spheres, request.rolling)
                              : motion_of<I, false>(equal_spheres, request.rolling);
  table.merge = &merge_kernel<I>;
  table.search = &search_kernel<I>;
  table.choose = &choose_kernel<I>;
  table.look = &look_kernel<I>;
  table.settle = &settle_kernel<I>;
  return table;
}

KernelTable kernels_scalar(const KernelRequest& request);
KernelTable kernels_avx2(const KernelRequest& request);
KernelTable kernels_avx512(const KernelRequest& request);

}  // namespace platen
