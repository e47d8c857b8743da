// The state at one full time, in the order and form in which files want it: particles sorted by id, contacts by
// (lower id, higher id). Rows of vectors are x, y, z next to each other.
#pragma once

#include <cstdint>
#include <vector>

namespace platen {

enum PlateId : int { plate_bottom = 0, plate_top = 1, wall_x_low = 2, wall_x_high = 3, wall_y_low = 4, wall_y_high = 5, plate_count = 6 };

enum class Branch : std::int8_t { none = 0, loading = 1, elastic = 2, adhesive = 3 };

struct ParticleFields {
  std::vector<std::int64_t> id;
  std::vector<double> position;          // N x 3 [m], wrapped into the box
  std::vector<std::int32_t> image;       // N x 2, box lengths left behind in x and y
  std::vector<double> velocity;          // N x 3 [m/s] at full time
  std::vector<double> angular_velocity;  // N x 3 [rad/s] at full time
  std::vector<double> radius;            // N [m]
  std::vector<double> mass;              // N [kg]
  std::size_t size() const { return id.size(); }
};

// Touching pairs. pair[0] has the lower id; the normal points from pair[1] to pair[0]; forces act on pair[0].
struct ContactFields {
  std::vector<std::int64_t> pair;        // M x 2 ids
  std::vector<std::int32_t> image;       // M x 2: pair[1] stands at its position + image * (width, depth)
  std::vector<double> overlap;           // M [m]
  std::vector<double> plastic_overlap;   // M [m]
  std::vector<double> normal_force;      // M [N] f_hys, positive repels, without damping
  std::vector<double> damping_force;     // M [N] normal dashpot, positive repels
  std::vector<double> tangential_force;  // M x 3 [N] spring and dashpot
  std::vector<std::int8_t> branch;       // M, enum Branch
  std::size_t size() const { return overlap.size(); }
};

struct PlateContactFields {
  std::vector<std::int64_t> id;     // M
  std::vector<std::int8_t> plate;   // M, enum PlateId
  std::vector<double> overlap;      // M [m]
  std::vector<double> force;        // M x 3 [N] on the sphere
  std::size_t size() const { return id.size(); }
};

struct Snapshot {
  std::int64_t step = 0;
  double time = 0.0;                 // [s]
  double z_bottom = 0.0;             // bottom plate (0 when absent) [m]
  double z_top = 0.0;                // top plate, or the highest point of a sphere when it is absent or above the bed [m]
  ParticleFields particles;
  ContactFields contacts;
  PlateContactFields plate_contacts;
};

}  // namespace platen
