// What a case needs from the kernels, and the closed list of what is built. A scene that covers a case gives the same
// bits as the narrowest one: what is covered but unused runs with neutral parameters.
#pragma once

#include <array>

namespace platen {

enum class Exponent { one, three_halves, any };
enum class Rolling { none, absolute, relative };

struct SceneTraits {
  Exponent exponent = Exponent::one;
  bool adhesion = false;    // k_adh or f0
  bool plasticity = false;  // k2 > k1
  Rolling rolling = Rolling::none;
  bool equal_spheres = true;  // one radius and one mass
  bool energy = true;         // the ledger's sums
};

struct Scene {
  const char* name;
  SceneTraits traits;
};

// From cheap to dear. Friction is in all of them: no bed stands without it.
inline constexpr std::array<Scene, 7> built_scenes = {{
    {"elastic", {Exponent::one, false, false, Rolling::none, true, true}},
    {"cohesionless", {Exponent::one, false, true, Rolling::absolute, true, true}},
    {"full", {Exponent::one, true, true, Rolling::absolute, true, true}},
    {"full_wide", {Exponent::one, true, true, Rolling::absolute, false, true}},
    {"three_halves", {Exponent::three_halves, true, true, Rolling::absolute, false, true}},
    {"any_exponent", {Exponent::any, true, true, Rolling::absolute, false, true}},
    {"relative_rolling", {Exponent::any, true, true, Rolling::relative, false, true}},
}};

// Whether kernels built for `built` can run a case that needs `needed`. Exponent 1 run as a general power would not give
// the same bits, yet it is right; rolling models exclude each other.
constexpr bool covers(const SceneTraits& built, const SceneTraits& needed) {
  return (built.exponent == needed.exponent || built.exponent == Exponent::any) &&
         (built.adhesion || !needed.adhesion) && (built.plasticity || !needed.plasticity) &&
         (built.rolling == needed.rolling || needed.rolling == Rolling::none) &&
         (!built.equal_spheres || needed.equal_spheres);
}

// The first scene of the list that covers the case; the last one covers everything but absolute rolling, the one before
// it everything but relative rolling, so there always is one.
constexpr int cheapest_scene(const SceneTraits& needed) {
  for (int k = 0; k < static_cast<int>(built_scenes.size()); ++k)
    if (covers(built_scenes[static_cast<std::size_t>(k)].traits, needed)) return k;
  return -1;
}

}  // namespace platen
