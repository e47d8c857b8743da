// Mean stress and fabric of a bed from its contacts.
//
//   stress_ab = 1/V sum over contacts of F_a l_b        [Love1927, Weber1966]; compression positive
//   fabric_ab = mean over pairs of n_a n_b              [Satake1982]; trace 1
//
// F is the force on sphere i; l goes to its centre from that of j (pairs) or from the nearest point of the plane (plates
// and walls). At rest, and without friction at walls, moments of the forces give, without approximation,
//   V stress_zz = stress_top A h + sum m g (z - z_bottom)
// so the tensor and the plates' forces judge each other. Kinetic stress is left out: a bed in motion has more.
#pragma once

#include <array>
#include <cstdint>

#include "core/snapshot.h"

namespace platen {

using Tensor = std::array<std::array<double, 3>, 3>;

struct BedStress {
  Tensor stress{};                    // [Pa]; symmetric at rest where no rolling friction acts
  Tensor fabric{};                    // [-]; zero without pairs
  std::array<double, 3> principal{};  // eigenvalues of the symmetric part of the stress, largest first [Pa]
  std::array<double, 3> principal_direction{};  // unit vector of the largest, z component not negative
  double pressure = 0.0;              // trace/3 [Pa]
  double deviator = 0.0;              // sqrt(3/2 s:s) of the symmetric deviatoric part [Pa]
  double fabric_deviator = 0.0;       // sqrt(3/2 a:a) of the fabric's deviatoric part [-]
  double mean_overlap = 0.0, largest_overlap = 0.0;  // of pairs, over the sum of their radii [-]
  double volume = 0.0;                // width x depth x (z_top - z_bottom) [m3]
  std::int64_t pairs = 0;
};

// `snapshot` with contacts; width, depth [m] of the box. Throws std::invalid_argument for an empty volume.
BedStress bed_stress(const Snapshot& snapshot, double width, double depth);

}  // namespace platen
