// What room each sphere of a batch has left until a list no longer holds, and how soon it may use it up
// [core/simulation_lists.cpp, Simulation::look_at].
#pragma once

#include "kernels/vec3.h"
#include "kernels/views.h"

namespace platen {

// Sets `room` and clears `speed2`. What fills up the last vector has all the room there is.
template <class I>
void look_kernel(const LookBatch& b, const LookConstants& c, LookTotals& totals) noexcept {
  using Real = typename I::Real;
  const Real zero = I::set(0.0), one = I::set(1.0), tiny = I::set(1e-100);
  const auto length = [](const Real& x, const Real& y, const Real& z) { return I::sqrt((x * x + y * y) + z * z); };
  double lanes[I::width];
  for (int lane = 0; lane < I::width; ++lane) lanes[lane] = lane;
  const Real lane_numbers = I::load(lanes);
  Real fastest = zero, closest = zero;
  for (std::int32_t k = 0; k < b.count; k += I::width) {
    Real left = I::load(b.margin + k);
    if (b.then_x != nullptr) {
      const Real dx = nearest_image<I>(I::load(b.x + k) - I::load(b.then_x + k) - I::set(c.drift[0]), c.width, c.inverse_width);
      const Real dy = nearest_image<I>(I::load(b.y + k) - I::load(b.then_y + k) - I::set(c.drift[1]), c.depth, c.inverse_depth);
      left = left - length(dx, dy, I::load(b.z + k) - I::load(b.then_z + k) - I::set(c.drift[2]));
    }
    const Real speed = length(I::load(b.vx + k) - I::set(c.mean[0]), I::load(b.vy + k) - I::set(c.mean[1]), I::load(b.vz + k) - I::set(c.mean[2]));
    const auto exists = lane_numbers < I::set(b.particles - k);
    // Finite where no room is left, so that a speed of 0 times it is a number.
    const Real inverse = one / I::where(left < tiny, tiny, left);
    I::store(b.room + k, I::where(exists, I::where(left < zero, zero, left), I::set(c.boundless)));
    I::store(b.speed2 + k, zero);
    // What is no number leaves the second operand as it is.
    fastest = I::max(I::where(exists, speed * inverse, zero), fastest);
    closest = I::max(I::where(exists, inverse, zero), closest);
  }
  totals = {I::largest(fastest), I::largest(closest)};
}

}  // namespace platen
