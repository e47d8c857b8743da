// Things that must not go unnoticed although every number is still finite. They end a run by a RunError that names the step, the
// worst sphere and what to change.
#pragma once

#include "core/simulation.h"
#include "protocol/case_file.h"

namespace platen {

// Of the box, or of the space that the spheres take at the start where that is larger [m].
double size_of_space(const Case& c, const Simulation& sim);

// A sphere that turns by more than half a radian in a step: springs and rolling cannot follow.
void refuse_fast_spins(const Simulation& sim, const Measures& m);

// A sphere farther out than that, in any coordinate [m], or nowhere.
void refuse_lost_spheres(const Simulation& sim, const Measures& m, double farthest_allowed);

}  // namespace platen
