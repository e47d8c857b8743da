// The largest stable time step of a contact network (docs/laws.md, "Stability").
//
// Linearised about the present state, with u the displacements and turns of all bodies, M their masses and moments of
// inertia (2/5 m R^2), K the springs and C the dashpots of all contacts, the leapfrog with forces at velocities of the
// half step before reads
//     M (u[n+1] - 2 u[n] + u[n-1]) = -dt^2 K u[n] - dt C (u[n] - u[n-1])
// Its fastest mode turns unstable where it flips sign every step, u[n+1] = -u[n]:
//     lambda_max[M^-1 (dt^2 K + 2 dt C)] = 4    gives dt_limit,  without dashpots  dt_crit = 2/omega_max      [own]
// A contact acts on the relative displacement of the two surfaces at the contact point (n from j to i, levers a)
//     u_c = u_i - u_j - (a_i theta_i + a_j theta_j) x n        F = -[k_n n n + k_t (1 - n n)] u_c
// i.e. sticking, on the stiffest branch of its law; dashpots likewise. The change of n with the motion is left out: it
// is of the order of force/(stiffness x radius).
//
// The largest eigenvalue is found by Lanczos' method [Lanczos1950, Parlett1998] without a matrix. Everything is serial
// and in the order of the arguments, so the same bodies and contacts in the same order give the same bits on any
// machine.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

namespace platen {

// A touching contact, linearised.
struct StiffContact {
  int i = 0;                      // body
  int j = -1;                     // body; < 0: a plate or wall, which does not move
  double n[3] = {0.0, 0.0, 0.0};  // unit normal from j (or the plane) to i
  double a_i = 0.0, a_j = 0.0;    // lever arms, centre to contact point [m]; a_j is not read for a plate
  double k_n = 0.0, k_t = 0.0;    // tangent stiffnesses [N/m], >= 0
  double c_n = 0.0, c_t = 0.0;    // dashpots [N s/m], >= 0
};

struct NetworkBody {
  double mass = 0.0;    // [kg]
  double radius = 0.0;  // [m], of the solid sphere that gives the moment of inertia
};

struct StepLimits {
  double dt_crit = std::numeric_limits<double>::infinity();   // 2/omega_max [s]; infinite without contacts
  double dt_limit = std::numeric_limits<double>::infinity();  // the same with the dashpots [s], <= dt_crit
  double dt_pairs = std::numeric_limits<double>::infinity();  // dt_crit without the contacts to plates and walls [s], >= dt_crit;
                                                              // dt_crit itself where it is not asked for
  double omega_max = 0.0;                                     // [rad/s]
  int ruling_body = -1;     // body that moves most in the mode that rules dt_limit; -1: none, or not asked for
  int ruling_contact = -1;  // contact that holds most of that mode's energy
  int operator_passes = 0;  // passes over all contacts that the answer took
};

struct StepLimitOptions {
  int max_iterations = 40;   // of Lanczos' method for one eigenvalue
  double tolerance = 1e-3;   // relative error bound of an eigenvalue at which it stops earlier, after 24 at least
  bool damped = true;        // false: dt_limit is left at dt_crit
  double dt_guess = 0.0;     // a dt_limit found before, which saves about half of the passes; 0: none [s]. The answer
                             // depends on it within the tolerance, so it has to be part of the state
  bool pairs_alone = false;  // find dt_pairs too, which costs up to max_iterations more passes
  bool find_ruling = false;  // costs up to max_iterations more passes
};

// Limits of a network. `ids` (one per body, or empty: the index) seed the start vector, so that the answer does not
// depend on how bodies are stored as long as they, and the contacts, are passed in order of ids. Eigenvalues are
// rounded up by the error bound of the method, hence the steps down: they are within 1 % of the exact ones in random
// beds (tests/test_stability.cpp). Throws std::invalid_argument for a body or contact that is out of range or not
// finite.
StepLimits step_limits(const std::vector<NetworkBody>& bodies, const std::vector<StiffContact>& contacts,
                       const std::vector<std::int64_t>& ids = {}, const StepLimitOptions& options = {});

// Limits to assume before contacts exist: m_min [kg] is the smallest sphere's mass; k2, k_t [N/m] and c_n, c_t [N s/m]
// are those of a contact between two such spheres. They are the limits of 27 equal spheres in hexagonal close packing,
// less 7 % for the worst places of random beds: dt_crit = 0.75 sqrt(m_min/k2) for k_t up to 0.06 k2 (k_t = 2/7 k1,
// k2 = 5 k1), less beyond: 0.64 at k2 = k1.
StepLimits free_limits(double m_min, double k2, double k_t, double c_n, double c_t);

// The largest 2^(k/16), k an integer, that is not above dt (dt > 0 and finite; anything else is returned as it is).
// Steps on this grid do not follow the noise of a changing network.
double floor_to_grid(double dt);

}  // namespace platen
