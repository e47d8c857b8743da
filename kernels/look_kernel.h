// What room each sphere of a batch has left until a list no longer holds, and how soon it may use it up
// [core/simulation_lists.cpp, Simulation::look_at].
#pragma once

#include "kernels/vec3.h"
#include "kernels/views.h"

namespace platen {

// Takes what each sphere has moved off its room and clears `speed2`. What fills up the last vector has all the room there is.
template <class I>
void look_kernel(const LookBatch& b, const LookConstants& c, LookTotals& totals) noexcept {
  using Real = typename I::Real;
  const Real zero = I::set(0.0), one = I::set(1.0), tiny = I::set(1e-100), boundless = I::set(c.boundless);
  const Real downwards = I::set(1.0 - 0x1p-23);  // so that single precision rounds to no more than it is
  const auto length = [](const Real& x, const Real& y, const Real& z) { return I::sqrt((x * x + y * y) + z * z); };
  double lanes[I::width];
  for (int lane = 0; lane < I::width; ++lane) lanes[lane] = lane;
  const Real lane_numbers = I::load(lanes);
  Real fastest = zero, closest = zero;
  for (std::int32_t k = 0; k < b.count; k += I::width) {
    const auto exists = lane_numbers < I::set(b.particles - k);
    Real left = I::load_floats(b.inner + k);
    if (b.then_x != nullptr) {
      const Real dx = nearest_image<I>(I::load(b.x + k) - I::load(b.then_x + k) - I::set(c.drift[0]), c.width, c.inverse_width);
      const Real dy = nearest_image<I>(I::load(b.y + k) - I::load(b.then_y + k) - I::set(c.drift[1]), c.depth, c.inverse_depth);
      const Real moved = length(dx, dy, I::load(b.z + k) - I::load(b.then_z + k) - I::set(c.drift[2]));
      left = (left - moved) * downwards;
      const Real left_outside = (I::load_floats(b.outer + k) - moved) * downwards;
      I::store_floats(b.outer + k, I::where(exists, I::where(left_outside < zero, zero, left_outside), boundless));
    }
    const Real speed = length(I::load(b.vx + k) - I::set(c.mean[0]), I::load(b.vy + k) - I::set(c.mean[1]), I::load(b.vz + k) - I::set(c.mean[2]));
    // Finite where no room is left, so that a speed of 0 times it is a number.
    const Real inverse = one / I::where(left < tiny, tiny, left);
    I::store_floats(b.inner + k, I::where(exists, I::where(left < zero, zero, left), boundless));
    I::store_floats(b.speed2 + k, zero);
    // What is no number leaves the second operand as it is.
    fastest = I::max(I::where(exists, speed * inverse, zero), fastest);
    closest = I::max(I::where(exists, inverse, zero), closest);
  }
  totals = {I::largest(fastest), I::largest(closest)};
}

}  // namespace platen
