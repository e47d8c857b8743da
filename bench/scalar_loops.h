// The loops of the yardstick in scalar_step.h: plain data and three functions, compiled in a file of their own with
// -O3 -mavx2 -mfma. Textbook form: one pair at a time, a half list, Newton's third law.
#pragma once

#include <cstdint>

namespace platen::bench {

struct ScalarSphere {
  double x[3];  // [m]
  double v[3];  // half-step velocity [m/s]
  double u[3];  // R omega [m/s]
};

struct ScalarSum {
  double F[3];  // force [N]
  double T[3];  // torque over R [N]
  double S;     // sum of |f_hys| a/R over pairs [N]
};

struct ScalarHistory {
  double sp;    // plastic overlap [m]
  double T[3];  // tangential spring on i [N]
};

struct ScalarPlateContact {
  std::int32_t sphere;
  double xi[3];           // elongation [m]
  double stiffness_last;  // S_t of the step before [N/m]
};

struct ScalarPlate {
  double sign, position, velocity;  // normal = sign e_z; [m], [m/s]
  ScalarPlateContact* contacts;
  std::int32_t count;
};

// Equal spheres, exponent 1; symbols of docs/laws.md.
struct ScalarConstants {
  double R, m, gravity, width, depth;
  double k1, k2, k_adh, f0, mu, mu_r, k_t, beta_n, beta_t, sp_lower, sp_upper, plastic_loading, plastic_adhesive;
  double hertz, S_n, S_t, plate_damping, plate_mu, plate_mu_r, slip_ratio;
};

struct ScalarLedger {
  double plastic = 0, viscous = 0, sliding = 0, rolling = 0, model = 0, work = 0;  // [J]
};

struct ScalarBed {
  ScalarSphere* spheres;
  ScalarSum* sums;
  const std::int32_t *start, *partner;  // pairs of i: partner[start[i]] ... partner[start[i+1] - 1], all above i
  ScalarHistory* history;               // of each pair
  std::int32_t count;
};

// Sums over pairs and plates; dt = 0 leaves springs where they are. Returns the number of touching pairs.
std::int64_t scalar_forces(const ScalarBed& bed, const ScalarConstants& c, double dt, ScalarLedger& ledger);
void scalar_plate_forces(const ScalarBed& bed, const ScalarConstants& c, const ScalarPlate& plate, double dt,
                         double* rolling_strength, ScalarLedger& ledger);
// Kick, rolling friction, drift, wrap. Returns the square of the largest speed [m2/s2].
double scalar_motion(const ScalarBed& bed, const ScalarConstants& c, double kick, double drift,
                     const double* rolling_strength, ScalarLedger& ledger);

}  // namespace platen::bench
