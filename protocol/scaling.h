// Scaling laws: which contact parameters a coarser (or finer) sphere gets so that the bulk answers like the reference.
//
//   lambda = R / R_ref
//   k1, k2, k_adh   ~ lambda^a     a = "stiffness";  k_t follows, it is a fixed part of k1   [Thakur2016, Eq. 12-15]
//   f0              ~ lambda^b     b = "adhesion"                                            [Thakur2016, Eq. 16-22]
//   beta_n          ~ lambda^c     only where c = "dashpots" is given; else restitution is kept and c = (2 + a + n)/2
//   N               = round(N_ref / lambda^3)               equal solid volume in the box    [A20 in docs/scaling.md]
// Density, friction, rolling friction and the plates' law are kept.
//
// With exponent n = 1, a = 1 and b = 2 the equations of motion are exactly similar under lengths and times x lambda at
// equal speeds and stresses; for other n that needs a = 2 - n [own, docs/scaling.md].
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "kernels/law_parameters.h"
#include "protocol/case_file.h"

namespace platen {

struct ScalingPowers {
  double stiffness = 1.0;            // a
  double adhesion = 2.0;             // b
  std::optional<double> dashpots{};  // c; empty: restitution is kept
  double time_step = 0.0;            // a fixed time.step ~ lambda^this; no effect on "auto"
};

// The law of spheres that are `lambda` times as large as the reference's. Throws std::domain_error where the wanted
// dashpots need a restitution that does not exist (z >= 1), naming both.
PairLaw scaled_law(const PairLaw& reference, const ScalingPowers& powers, double lambda);

// Spheres of equal solid volume, at least 1.
std::int64_t scaled_count(std::int64_t reference_count, double lambda);

// A number as a TOML value that reads back to the same bits.
std::string toml_number(double value);

// What has to change in the case `base` (as `--set` texts) so that its spheres are `lambda` times as large: radius or size
// distribution, count, law, time step. Nothing for lambda = 1. Throws std::domain_error for a case whose spheres come
// from a file, and as scaled_law.
std::vector<std::string> scaling_overrides(const Case& base, const ScalingPowers& powers, double lambda);

// ---- where reference values come from [Thakur2016, Eq. 12-22, as far as its text is known: docs/scaling.md] ----

// Effective modulus of two equal materials, E* = E / (2 (1 - nu^2)) [Pa].
double effective_modulus(double young_modulus, double poisson_ratio);

// Linear spring that stores the energy of a Hertz impact at its largest overlap [Thakur2016, Eq. 12, 13; Maw1976]:
//   k = 16/15 sqrt(R*) E* (15 m* V^2 / (16 sqrt(R*) E*))^(1/5),  equal spheres: R* = R/2, m* = m/2.
// k ~ R at equal speed V and density. [N/m]; R [m], density [kg/m3], E [Pa], V [m/s].
double stiffness_of_impact(double radius, double density, double young_modulus, double poisson_ratio, double speed);

// Twice the effective modulus over the effective radius [Thakur2016, Eq. 14]: k = 2 E* R*, equal spheres, R* = R/2. [N/m]
double stiffness_of_contact(double radius, double young_modulus, double poisson_ratio);

// Tangent of a cylinder of the sphere's section between two centres [Thakur2016, Eq. 15; PFC]: k = pi R E / 2. [N/m]
double stiffness_of_modulus(double radius, double young_modulus);

enum class AdhesionModel { dmt, jkr, plastic_jkr };

// Pull-off force of two equal spheres with surface energy gamma [J/m2] a surface (work of adhesion 2 gamma), R* = R/2:
//   DMT f0 = -4 pi gamma R*, JKR f0 = -3 pi gamma R*, both ~ R [Thakur2016, Eq. 16, 17]; plastic JKR: JKR on a contact
// that flow has flattened, `flattening` = R_plastic / R* (about 2) [Thakur2016, Eq. 18]. Returns f0 <= 0 [N].
double f0_of_surface_energy(double radius, double surface_energy, AdhesionModel model, double flattening = 2.0);

// Van der Waals attraction of two equal spheres at the distance z0 [m], Hamaker constant A [J] [Thakur2016, Eq. 19]:
//   f0 = -A R* / (6 z0^2). [N]
double f0_of_hamaker(double radius, double hamaker_constant, double distance);

// From a tensile strength sigma_t [Pa] by Rumpf, sigma_t = phi CN |f0| / (4 pi R^2) [Thakur2016, Eq. 20, 21], with phi the
// solid fraction and CN the coordination number: f0 ~ R^2 at equal strength. [N]
double f0_of_tensile_strength(double radius, double tensile_strength, double solid_fraction,
                              double coordination_number);

// |f0| over the weight of a sphere, f_g = 4/3 pi R^3 rho g [Thakur2016, Eq. 22]: constant for f0 ~ R^3. [-]
double bond_number(double f0, double radius, double density, double gravity);

// The other way round: f0 = -Bo 4/3 pi R^3 rho g [Thakur2016, Eq. 22]. [N]
double f0_of_bond_number(double radius, double bond_number, double density, double gravity);

}  // namespace platen
