// Plates and walls: planes whose position is a function of the step number alone, so that no sample, rebuild or restart
// can change it.
#pragma once

#include <array>
#include <cstdint>

#include "core/snapshot.h"
#include "kernels/views.h"

namespace platen {

struct PlaneMotion {
  bool present = false;
  double origin = 0.0;        // position at step `start` [m]
  double velocity = 0.0;      // steady [m/s]
  double amplitude = 0.0;     // of the vibration [m]; 0 = none
  double frequency = 0.0;     // [Hz]
  double vibrated = 0.0;      // time since the vibration began, at `start` [s]
  double vibration_end = 0.0; // the same when it has come back to 0 for good [s]
  std::int64_t start = 0;     // step
  double dt = 0.0;            // [s] from `start` on

  double position_at(std::int64_t step) const;
  double velocity_at(std::int64_t step) const;
  double largest_speed() const;  // bound for any step
};

// The six planes in the order of PlateId.
using Planes = std::array<PlaneMotion, plate_count>;

// Axis and normal of a plane.
Plane plane_shape(int plate);

}  // namespace platen
