// What kernels see: plain pointers and numbers, owned by core.
//
// A particle's row, twelve doubles (96 bytes), written by the motion kernel, read by the contact kernels and others. The state
// itself is kept as a structure of arrays; the row is its copy in the shape that a contact fetches with three loads.
// While a large bed makes a run of steps the rows alone hold the state [docs/architecture.md, "Data"].
//
//     x  y  z  R | vx vy vz m | ux uy uz 1/R        u = R omega [m/s]
//
// A record, eight doubles (64 bytes), the sums over contacts of one particle:
//
//     Fx Fy Fz S | Tx Ty Tz P
//
//     F force [N];  T = torque / R [N];  S = sum of |f_hys| a/R over pairs [N], to be multiplied by mu_r;
//     P the same over plates, mu_r included [N]
#pragma once

#include <cstdint>

namespace platen {

inline constexpr int row_size = 12;    // doubles of a particle's row
inline constexpr int record_size = 8;  // doubles of a record
inline constexpr int record_bytes = 64;
inline constexpr int chunk_size = 64;  // contacts between two conversions of energies to integers
inline constexpr int padding = 8;        // particles are padded to a multiple of the widest vector
inline constexpr int pair_padding = 16;  // contacts to what a kernel takes at once: two such vectors

// x rounded to a multiple of q: (x + magic) - magic with magic = 1.5 * 2^52 * q. Sums of such numbers are exact as long
// as they stay below 2^53 q, hence the same in any order.
struct Quantum {
  double magic = 0.0;
  double bound = 0.0;    // credible contributions are below this; up to 4 times as much is rounded exactly
  double inverse = 0.0;  // 1/q
};

// Energy terms that a step adds up, in units of the energy quantum.
enum EnergyTerm { term_plastic, term_viscous, term_sliding, term_rolling, term_model, term_count };

// Constants of the pair law, [docs/laws.md, "Pairs"].
struct LawConstants {
  double k1, k2, k_adh, f0;
  double exponent;           // n
  double sp_lower;           // 1 - k1/k2:    s_p = sp_lower s while loading
  double sp_upper;           // 1 + k_adh/k2: s_p = sp_upper s on the adhesive branch
  double mu;
  double limit_k, limit_f;   // Coulomb limit mu |k2 (s - s_p) + limit_k s + limit_f|: k_adh and 0 [Eq. 10], or 0 and f0
  double mu_r;
  double k_t;                // n = 1: tangential_ratio k1
  double half_over_k_t;      // n = 1: 1/(2 k_t)
  double ratio;              // tangential_ratio
  double damping;            // 4 z (n+1)/(2n): beta_n^2 = damping m* K1
  double beta_ratio;         // sqrt(tangential_ratio) = beta_t / beta_n
  double beta_n;             // equal spheres, n = 1
  double overlap_floor;      // smallest overlap put into K1 where n < 1
  double plastic_loading;    // D = plastic_loading  * change of sp^((n+1)/n) where sp grows
  double plastic_adhesive;   // D = plastic_adhesive * change where sp falls; <= 0
  double radius, inverse_radius;  // equal spheres
  double width, inverse_width, depth, inverse_depth;  // periodic lengths; all 0 where not periodic
  double rolling_share;      // relative rolling: largest part of the relative spin that one contact may take in a step
  double watched_lever;      // forces of pairs with a shorter lever a/R are compared with their bound
  Quantum force, energy;
  double dt;                 // last drift; 0 when forces are evaluated without advancing springs
};

// The contacts that a batch owns. Sorted by owner, then j; `count` is a multiple of `pair_padding`, padded with i = j.
//
//   contact:      0      1      2      3     4   ...
//   owner i       17     17     17     18    20  ...   particle of this batch, in no list of its own: owner_of(to)
//   row_j         216    300    10836  300   252 ...   row of the partner j, any particle: 12 j, in doubles from `rows`
//   to.partner    64     512    32768  512   256 ...   where j's share goes, in bytes from `sum`: an own particle, or a halo slot
//   own_of(to)    0      0      0      64    192 ...   where the owner's sum is, in the same bytes
//   again_of(to)         yes    yes                    the owner is that of the contact before
//
// Bytes, because an address that takes a multiplication costs a tenth of the output phase.
struct PairTargets {
  std::int32_t partner;
  // 256 times the place of the owner's sum, and the lowest eight bits set where the owner is that of the contact before [kernels/owner_runs.h]:
  // one array less to follow, of which a processor can only follow so many. Without a sign, and both parts at its ends, it takes two instructions to
  // take apart, and the output phase has few to spare.
  std::uint32_t own_and_again;
};
inline constexpr std::int32_t most_spheres_of_batch = 1 << 18;  // whose sums lie below 2^24 bytes [core/batch_cuts.h, batches_of]

// The owners of eight contacts that follow each other: mostly within eight places, which one load of a column brings.
struct OwnersOfEight {
  std::int32_t first;     // of such eight places, counted from the batch's first particle; -1 where they are farther apart
  std::uint8_t place[8];  // of each contact's owner from there
};

// Lines of memory that a task to come will need.
struct AskedLines {
  const char* first;
  std::int64_t count;
};

struct PairBatch {
  const double* rows;
  const double* own_rows;  // of the batch's first particle, where owners' rows are counted from
  const std::int32_t* row_j;
  const PairTargets* to;
  const OwnersOfEight* owners;  // of each eight contacts
  double *sp, *tx, *ty, *tz;
  double* k_t_last;     // exponent other than 1: k_t of the step before; null otherwise
  double* sum;          // records: of own particles, halo slots, and one that stays zero
  std::int32_t first;   // first particle of the batch
  std::int32_t count;
  std::int32_t end;     // one past the batch's last particle
  std::int32_t nothing; // place of the record that stays zero, in bytes from `sum`
  bool dense;           // most touched in the pass before: none is looked for that could be left out, which changes no bit
  double leap;          // bound of the change of any pair's distance in the last step [m]
  const double *x, *y, *z, *vx, *vy, *vz, *ux, *uy, *uz;  // state of the batch's spheres, for the owner side; null where rows alone hold it
  double* stage;         // then memory for nine columns of stage_column(end - first); null otherwise
  std::int32_t ahead;    // partners are asked for so many places ahead of their owners; 0 where a near cache holds the bed, few touch, or not asking is quicker
  std::int32_t spheres;  // that have rows
  bool asks_history;     // of contacts as well, where no cache holds the bed
  const AskedLines* lines;  // for others [core/task_asks.h], so many of them with each chunk
  std::int32_t stretches, lines_of_chunk;
};

// Such columns start at different places of a page.
inline constexpr std::int64_t stage_column(std::int64_t spheres) { return spheres + padding; }

// Shares that another batch holds of spheres of this one: records in a row.
struct SharesBatch {
  double* sum;                   // records of this batch's spheres
  const double* shares;
  const std::int32_t* particle;  // whose each of them is
  std::int32_t first;            // first particle of this batch
  std::int32_t count;
};

struct PairTotals {
  std::int64_t contacts = 0;               // touching
  std::int64_t energy[term_count] = {};    // quanta
  bool out_of_range = false;               // an overlap, a force of a deep overlap or an energy beyond its bound, or no number
};

// Spheres in the order of the cells of a grid, padded to a whole vector behind the last.
struct SearchMembers {
  const double *x, *y, *z;
  const double* reach;      // R and margin [m]
  const double* number;     // the particle again, to be compared as the others are
  const std::int32_t* particle;
  double width, inverse_width, depth, inverse_depth;  // where images have to be looked for pair by pair; else 0
};
struct SearchRange {
  std::int32_t first, last;  // members
  double x, y, z;            // place from which the sphere sees them: that of the image next to them
};
struct SearchedSphere {
  double reach;
  double particle, first_of_batch;
};

// Pairs of an outer list, of which the inner one takes those closer than their radii and margins.
struct ChooseBatch {
  const double* rows;
  const float* margin;
  const std::int32_t *i, *j;
  std::int64_t count;
  double width, inverse_width, depth, inverse_depth;  // periodic lengths [m]; 0 where not periodic
  std::uint64_t* chosen;                              // out: a bit for each pair, the first of 64 lowest
};

// Spheres of a batch when lists are looked at: now, and at the last look.
struct LookBatch {
  const double *x, *y, *z, *vx, *vy, *vz;
  const double *then_x, *then_y, *then_z;  // null where nothing has moved since
  float *inner, *outer;                    // what each may still move before either list is made anew; its way since then is taken off [m]
  float* speed2;                           // set to 0
  std::int32_t count, particles;           // multiple of padding; of them particles
};
// Spheres of a batch whose columns are given the state of their rows, and that have moved since the columns had it.
struct SettleBatch {
  const double* rows;
  double *x, *y, *z, *vx, *vy, *vz, *ux, *uy, *uz;
  float *inner, *outer;
  std::int32_t count;  // multiple of padding
};
struct LookConstants {
  double width, inverse_width, depth, inverse_depth;  // periodic lengths; 0 where not periodic
  double drift[3];                                    // that all have in common since [m]
  double mean[3];                                     // common velocity [m/s]
  double boundless;                                   // room of what fills up the last vector
};
struct LookTotals {
  double fastest = 0.0;  // largest speed over room [1/s]
  double closest = 0.0;  // largest inverse of a room [1/m]
};

// One plane: a plate or a wall, its outward normal along an axis.
struct Plane {
  int axis = 2;
  double sign = 1.0;       // normal = sign * e_axis, pointing to the spheres
  double position = 0.0;   // coordinate along the axis [m]
  double velocity = 0.0;   // along the axis [m/s]
};

struct PlateConstants {
  double hertz;            // 4/3 E*
  double stiffness_n;      // 2 E*
  double stiffness_t;      // 8 G*
  double damping;          // 4 * 5/6 * z: c^2 = damping m S
  double normal_to_tangential;  // sqrt(S_n/S_t), the ratio of the dashpots
  double mu, mu_r;
  double slip_ratio;       // mu (4/3 E*)/(8 G*): largest elongation = slip_ratio delta
  Quantum force, energy;
  double dt;
};

// Spheres of a batch that may touch one plane. `count` is a multiple of `padding`; entries from `used` on repeat a
// particle and are ignored.
struct PlateBatch {
  const double* rows;
  const std::int32_t* particle;
  double *xi_x, *xi_y, *xi_z, *stiffness_last;  // elongation [m], S_t of the step before [N/m]
  double* records;                              // out: one record an entry
  double* overlap;                              // out [m], <= 0 when apart
  std::int32_t count, used;
};

struct PlateTotals {
  std::int64_t energy[term_count] = {};
  std::int64_t work = 0;   // of the moving plane on the spheres, quanta
  bool out_of_range = false;
};

struct MotionConstants {
  double kick;             // (dt_old + dt_new)/2
  double drift;            // dt_new
  double gravity;          // along -z
  double mu_r;             // of pairs
  double inverse_mass, mass, radius, inverse_radius;  // equal spheres
  double width, depth;     // periodic lengths; 0 where not periodic
  double strongest2;       // records of spheres that are pushed harder are left as they are; squared [N2]
  double mean_x, mean_y, mean_z;  // common velocity, taken out of `speed2`
  Quantum energy;
};

struct MotionBatch {
  double *x, *y, *z, *vx, *vy, *vz, *ux, *uy, *uz;               // null where rows alone hold the state
  const double *inverse_mass, *mass, *radius, *inverse_radius;  // null where spheres are equal
  double* rows;            // of this batch's first particle
  std::int8_t* crossed;    // 2 per particle: box lengths left behind, to which those of this step are added
  double* sum;             // records: the forces
  bool clears;             // sets them to zero
  float* speed2;           // of each particle: |v - mean|^2 is added [m2/s2]
  std::int32_t count;      // multiple of padding
  bool asks;               // for spheres ahead, where a near cache does not hold the bed
};

struct MotionTotals {
  double fastest2 = 0.0;         // largest |v - mean|^2 [m2/s2]
  double strongest = 0.0;        // largest force on a sphere, squared [N2]
  std::int64_t rolling = 0;      // rolling dissipation, quanta
  bool out_of_range = false;     // an energy beyond its bound, or no number
};

}  // namespace platen
