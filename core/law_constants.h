// Constants of the contact laws from the parameters that a user gives: everything that does not depend on the spheres.
#pragma once

#include "kernels/law_parameters.h"
#include "kernels/views.h"

namespace platen {

// z = 1/(1 + (pi/ln e)^2) of a restitution e, 0 < e <= 1 [Thakur2016, Eq. 4]; 0 at e = 1.
double damping_share(double restitution);

// What kernels/eepa.h needs. Left at 0, because they depend on the spheres, the box or the step: beta_n, overlap_floor,
// radius, width, depth and their inverses, rolling_share, force, energy, dt.
LawConstants pair_constants(const PairLaw& law);

// What kernels/hertz_mindlin.h needs; force, energy and dt are left at 0.
PlateConstants plate_constants(const PlateLaw& law);

}  // namespace platen
