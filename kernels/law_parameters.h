// Parameters of the contact laws as a user gives them, SI units. Plain data: the laws themselves are in eepa.h,
// hertz_mindlin.h and rolling.h; symbols in docs/notation.md.
#pragma once

namespace platen {

// How the rolling torque of a pair is directed, [A12 in docs/laws.md].
enum class RollingModel {
  absolute,  // each body against its own angular velocity (EDEM type A, the paper's Eq. 11)
  relative   // both bodies against their relative angular velocity; equal and opposite torques
};

// What the Coulomb limit between spheres is mu times of [A11 in docs/laws.md].
enum class FrictionLimit {
  adhesive,  // the height of the spring force above the adhesive branch (the paper's Eq. 10)
  normal     // the spring force: adhesion does not help friction
};

// Edinburgh elasto-plastic adhesive law between spheres [Thakur2016, Eq. 1-11].
struct PairLaw {
  double k1 = 0.0;                      // loading stiffness [N/m^n]
  double k2 = 0.0;                      // unloading and re-loading stiffness [N/m^n], k2 >= k1
  double k_adh = 0.0;                   // adhesive stiffness [N/m^n], >= 0
  double f0 = 0.0;                      // constant pull-on force [N], <= 0 attracts
  double exponent = 1.0;                // n [-]
  double tangential_ratio = 2.0 / 7.0;  // k_t / (n k1 delta^(n-1)) [-]
  double restitution = 0.4;             // e [-], 0 < e <= 1
  double friction = 0.0;                // mu [-]
  double rolling_friction = 0.0;        // mu_r [-]
  RollingModel rolling_model = RollingModel::absolute;
  FrictionLimit friction_limit = FrictionLimit::adhesive;
  bool operator==(const PairLaw&) const = default;
};

// Hertz-Mindlin between a sphere and a plane (plate or wall), total form [EDEM, A16 and A17 in docs/laws.md].
struct PlateLaw {
  double particle_young_modulus = 2.6e8;  // E_s [Pa]
  double particle_poisson_ratio = 0.3;    // nu_s [-]
  double young_modulus = 2.5e10;          // E_p [Pa]
  double poisson_ratio = 0.25;            // nu_p [-]
  double restitution = 0.4;               // e [-]
  double friction = 0.3;                  // mu [-]
  double rolling_friction = 0.001;        // mu_r [-]
  bool operator==(const PlateLaw&) const = default;
};

}  // namespace platen
