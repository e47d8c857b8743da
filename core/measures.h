// Quantities of a bed at one instant.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "core/snapshot.h"

namespace platen {

// The terms of the energy ledger [J]; docs/laws.md, "Energy". Dissipations and works are integrals since the run began.
struct Ledger {
  double elastic_energy = 0.0;       // pairs, normal springs
  double adhesion_energy = 0.0;      // f0 * delta
  double tangential_energy = 0.0;    // pairs, |spring|^2 / (2 k_t)
  double plate_energy = 0.0;         // plates and walls, normal and tangential
  double plastic_dissipation = 0.0;
  double viscous_dissipation = 0.0;
  double sliding_dissipation = 0.0;
  double rolling_dissipation = 0.0;
  double plate_model_work = 0.0;     // residual of the total-form spring [A17], a property of the model
  double plate_work = 0.0;           // work of moving plates on the bed
  double inserted_energy = 0.0;      // by filling
  double removed_energy = 0.0;       // stored in contacts deleted by `release`
  double dissipated() const {
    return plastic_dissipation + viscous_dissipation + sliding_dissipation + rolling_dissipation;
  }
};

struct Measures {
  std::int64_t step = 0;
  double time = 0.0;                  // [s]
  double height = 0.0;                // gap between the plates, highest sphere before touch [m]
  double stress_top = 0.0;            // [Pa], compression positive
  double stress_bottom = 0.0;         // [Pa]
  double porosity = std::numeric_limits<double>::quiet_NaN();  // [-]; none where no sides keep the bed in its box
  double coordination_number = 0.0;   // 2 N_c / N
  std::int64_t contacts = 0;          // touching sphere pairs
  double kinetic_energy = 0.0;        // with rotation [J]
  double potential_energy = 0.0;      // sum m g (z - z_bottom) [J]
  double support_force = 0.0;         // upward on the bed by bottom minus top plate plus walls [N]
  double weight = 0.0;                // [N]
  double energy_residual = 0.0;       // [J]
  double highest_point = 0.0;         // highest z of any sphere's surface [m]
  double farthest = 0.0;              // largest coordinate of any centre, without its sign [m]; NaN where a position or velocity is none
  double fastest_spin = 0.0;          // [rad/s]
  double deepest_overlap = 0.0;       // of two spheres, over the diameter of the smaller; with stored energies only
  bool top_touches = false;           // a sphere touches the top plate
  Ledger ledger;
};

// Profile over height in equal slabs between z_bottom and z_top.
struct Profile {
  std::vector<double> z;                    // slab centres [m]
  std::vector<double> porosity;             // exact sphere segments, overlaps not subtracted [A28]
  std::vector<double> coordination_number;  // mean over the spheres whose centre is in the slab; NaN without any
};

// Volume of the part of a sphere (radius R, centre at height z) between the heights a <= b [m3].
double sphere_segment_volume(double R, double z, double a, double b);

// Porosity and coordination number in `slabs` equal slabs between snapshot.z_bottom and snapshot.z_top over the area
// width x depth [m2]. Porosities are no numbers where the area is none.
Profile profile(const Snapshot& snapshot, double area, int slabs);

// 1 - V_s / (area * (z_top - z_bottom)), full sphere volumes [A28].
double bulk_porosity(const ParticleFields& particles, double area, double z_bottom, double z_top);

}  // namespace platen
