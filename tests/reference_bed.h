// Brute-force bed of spheres on top of reference_contact.h: every pair is looked at in every step, there are no lists
// and no threads. For comparison with the engine step by step, with the same time conventions:
//
//   forces at step n        see x_n and v_{n-1/2}; springs advance by the last drift step dt_old (0 at step 0)
//   v_{n+1/2} = v_{n-1/2} + a_n (dt_old + dt_new)/2      (step 0: dt_old = 0, so the given v(0) gets half a kick)
//   x_{n+1}   = x_n + v_{n+1/2} dt_new
//   v_n       = v_{n-1/2} + a_n dt_old/2                 velocity at the full time
//
// Rolling in the absolute model and at plates: after the other torques, |omega| is reduced by
// h sum(mu_r |f| a)/I within a kick of length h, not below zero, its direction kept [A12, A13].
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "reference_contact.h"

namespace platen::reference {

// Bottom and top plate, then the walls at low x, high x, low y, high y.
enum PlaneId : int { bottom = 0, top = 1, x_low = 2, x_high = 3, y_low = 4, y_high = 5, plane_count = 6 };

struct Plane {
  bool present = false;
  Vec3 point, normal;  // a point on it [m]; normal into the bed
  Vec3 velocity;       // of the last drift, forces see this [m/s]; a plate without `motion` keeps it
  std::function<double(double)> motion;  // optional: height [m] at time t [s]; velocity is the secant of each drift
  double force = 0.0;  // normal force on the plane, compression positive, with damping [N]
};

// Terms of the energy ledger [J]. Dissipations and works are integrals since step 0; energy lost before it
// (overlapping pairs start as fresh contacts) is not counted. An integral takes the force at n with the velocity at
// n-1/2 and dt_old.
struct Energy {
  double kinetic = 0.0, potential = 0.0;  // at the full time; potential sum m g z
  double elastic = 0.0, adhesion = 0.0, tangential = 0.0, plate = 0.0;
  double plastic = 0.0, viscous = 0.0, sliding = 0.0, rolling = 0.0;
  double plate_work = 0.0;        // done by moving plates on the bed
  double plate_model_work = 0.0;  // given to elongations by S_t(delta) [A17]
  double pair_model_work = 0.0;   // the same between spheres, n != 1 only
  double stored() const { return elastic + adhesion + tangential + plate; }
  double dissipated() const { return plastic + viscous + sliding + rolling; }
  // Constant up to O(dt).
  double total() const {
    return kinetic + potential + stored() + dissipated() - plate_work - plate_model_work - pair_model_work;
  }
};

class Bed {
 public:
  EepaLaw pair_law;
  HertzMindlinLaw plate_law;
  double g = 0.0;                // along -z [m/s2]
  bool periodic = false;         // in x and y
  double Lx = 0.0, Ly = 0.0;     // [m]
  std::array<Plane, plane_count> planes;
  std::vector<Body> spheres;     // x unwrapped; v, w of the last half step (those at t = 0 before start())
  std::map<std::pair<int, int>, EepaContact> contacts;           // touching pairs i < j
  std::vector<std::array<PlateContact, plane_count>> at_planes;  // per sphere
  double time = 0.0, dt_old = 0.0;
  long step = 0;

  // A solid sphere, R [m], density [kg/m3].
  void add(Vec3 x, Vec3 v, Vec3 w, double R, double density) {
    const double m = 4.0 / 3.0 * std::numbers::pi * R * R * R * density;
    spheres.push_back({x, v, w, R, m, 0.4 * m * R * R});
  }
  void add_bottom(double z = 0.0) { planes[bottom] = {true, {0, 0, z}, {0, 0, 1}, {}, {}, 0.0}; }
  void add_top(double z, double velocity = 0.0) {
    planes[top] = {true, {0, 0, z}, {0, 0, -1}, {0, 0, velocity}, {}, 0.0};
  }
  // Rigid mould 0 <= x <= Lx, 0 <= y <= Ly.
  void add_walls() {
    planes[x_low] = {true, {0, 0, 0}, {1, 0, 0}, {}, {}, 0.0};
    planes[x_high] = {true, {Lx, 0, 0}, {-1, 0, 0}, {}, {}, 0.0};
    planes[y_low] = {true, {0, 0, 0}, {0, 1, 0}, {}, {}, 0.0};
    planes[y_high] = {true, {0, Ly, 0}, {0, -1, 0}, {}, {}, 0.0};
  }

  // Forces at step 0.
  void start() {
    at_planes.assign(spheres.size(), {});
    contacts.clear();
    sums_ = {};
    time = dt_old = 0.0;
    step = 0;
    evaluate();
    sums_ = {};  // the ledger starts here
  }

  // One step: kick, drift, forces at the new positions.
  void advance(double dt) {
    const double h = 0.5 * (dt_old + dt);
    for (std::size_t i = 0; i < spheres.size(); ++i) {
      Body& b = spheres[i];
      sums_.rolling += kick(i, h, b.v, b.w);
      b.x += dt * b.v;
    }
    for (Plane& p : planes) {
      if (p.motion) p.velocity = {0, 0, (p.motion(time + dt) - p.motion(time)) / dt};
      p.point += dt * p.velocity;
      if (p.motion) p.point.z = p.motion(time + dt);
    }
    time += dt;
    dt_old = dt;
    ++step;
    evaluate();
  }

  // At the full time n.
  Vec3 velocity(std::size_t i) const { return full(i).first; }
  Vec3 spin(std::size_t i) const { return full(i).second; }
  // Sums of all contacts and gravity on a sphere; rolling() is the magnitude that the kick takes off the spin.
  Vec3 force(std::size_t i) const { return force_[i]; }
  Vec3 torque(std::size_t i) const { return torque_[i]; }
  double rolling(std::size_t i) const { return rolling_[i]; }

  std::size_t pair_contacts() const { return contacts.size(); }
  std::size_t plane_contacts() const {
    std::size_t count = 0;
    for (const auto& planes_of : at_planes)
      for (const auto& c : planes_of) count += c.touching ? 1 : 0;
    return count;
  }
  double largest_overlap() const {
    double largest = 0.0;
    for (const auto& [ids, c] : contacts) largest = std::max(largest, c.delta);
    return largest;
  }

  Energy energy() const {
    Energy e = sums_;
    for (std::size_t i = 0; i < spheres.size(); ++i) {
      const Body& b = spheres[i];
      Vec3 v = b.v, w = b.w;
      e.rolling += kick(i, 0.5 * dt_old, v, w);  // up to the full time, as the kinetic energy
      e.kinetic += 0.5 * b.m * dot(v, v) + 0.5 * b.I * dot(w, w);
      e.potential += b.m * g * b.x.z;
      for (const PlateContact& c : at_planes[i]) e.plate += hertz_mindlin_stored(plate_law, c, b.R);
    }
    for (const auto& [ids, c] : contacts) {
      e.elastic += eepa_stored(pair_law, c);
      e.adhesion += pair_law.f0 * c.delta;
      if (c.kt > 0.0) e.tangential += dot(c.spring, c.spring) / (2.0 * c.kt);
    }
    return e;
  }

  // Nearest image of x_i - x_j.
  Vec3 separation(const Body& i, const Body& j) const {
    Vec3 d = i.x - j.x;
    if (periodic) {
      d.x -= Lx * std::nearbyint(d.x / Lx);
      d.y -= Ly * std::nearbyint(d.y / Ly);
    }
    return d;
  }

 private:
  // v and w after a kick of length h with the present forces; returns what rolling friction took [J].
  double kick(std::size_t i, double h, Vec3& v, Vec3& w) const {
    const Body& b = spheres[i];
    v += (h / b.m) * force_[i];
    const Vec3 w_free = w + (h / b.I) * torque_[i];
    const double spin_free = norm(w_free), loss = h * rolling_[i] / b.I;
    if (!(spin_free > 0.0)) {
      w = w_free;
      return 0.0;
    }
    const double spin_left = std::max(spin_free - loss, 0.0);
    w = (spin_left / spin_free) * w_free;
    return 0.5 * b.I * (spin_free * spin_free - spin_left * spin_left);
  }

  std::pair<Vec3, Vec3> full(std::size_t i) const {
    Vec3 v = spheres[i].v, w = spheres[i].w;
    kick(i, 0.5 * dt_old, v, w);
    return {v, w};
  }

  void evaluate() {
    const std::size_t N = spheres.size();
    force_.assign(N, {});
    torque_.assign(N, {});
    rolling_.assign(N, 0.0);
    for (std::size_t i = 0; i < N; ++i) force_[i].z = -spheres[i].m * g;
    for (std::size_t i = 0; i < N; ++i)
      for (std::size_t j = i + 1; j < N; ++j) add_pair(i, j);
    for (Plane& p : planes) p.force = 0.0;
    for (std::size_t i = 0; i < N; ++i)
      for (int k = 0; k < plane_count; ++k)
        if (planes[k].present) add_plane(i, k);
  }

  void add_pair(std::size_t i, std::size_t j) {
    const Body &a = spheres[i], &b = spheres[j];
    const Vec3 x_ij = separation(a, b);
    const double reach = a.R + b.R;
    const auto key = std::make_pair(static_cast<int>(i), static_cast<int>(j));
    // Far apart and without history: nothing to do. The small margin leaves the decision to the law itself.
    if (dot(x_ij, x_ij) > 1.000001 * reach * reach && !contacts.contains(key)) return;
    EepaContact& c = contacts[key];
    const EepaForces r = eepa_contact(pair_law, c, a, b, x_ij, dt_old);
    if (!c.touching) contacts.erase(key);
    force_[i] += r.force;
    force_[j] += -r.force;
    torque_[i] += r.torque_i;
    torque_[j] += r.torque_j;
    rolling_[i] += r.rolling_i;
    rolling_[j] += r.rolling_j;
    sums_.plastic += r.plastic;
    sums_.viscous += r.viscous;
    sums_.sliding += r.sliding;
    sums_.rolling += r.rolling;
    sums_.pair_model_work += r.model;
  }

  void add_plane(std::size_t i, int k) {
    Plane& p = planes[k];
    const Body& b = spheres[i];
    const double delta = b.R - dot(b.x - p.point, p.normal);
    const PlateForces r =
        hertz_mindlin_contact(plate_law, at_planes[i][k], b, delta, p.normal, b.v - p.velocity, dt_old);
    force_[i] += r.force;
    torque_[i] += r.torque;
    rolling_[i] += r.rolling;
    p.force += r.F_spring + r.F_damping;
    sums_.viscous += r.viscous;
    sums_.sliding += r.sliding;
    sums_.plate_model_work += r.model;
    sums_.plate_work += dot(r.force, p.velocity) * dt_old;
  }

  std::vector<Vec3> force_, torque_;
  std::vector<double> rolling_;
  Energy sums_;
};

// Volume of the part of a sphere between the planes z = lower and z = upper: integral of pi (R^2 - t^2) [m3].
inline double segment_volume(double R, double z, double lower, double upper) {
  const double s = std::clamp(lower - z, -R, R), t = std::clamp(upper - z, -R, R);
  const auto primitive = [R](double h) { return R * R * h - h * h * h / 3.0; };
  return std::numbers::pi * (primitive(t) - primitive(s));
}

// Porosity of each of `slabs` equal slabs between z_bottom and z_top; overlaps are not subtracted [A28].
inline std::vector<double> slab_porosity(const std::vector<Vec3>& x, double R, double area, double z_bottom,
                                         double z_top, int slabs) {
  const double thickness = (z_top - z_bottom) / slabs;
  std::vector<double> porosity;
  for (int k = 0; k < slabs; ++k) {
    double solid = 0.0;
    for (const Vec3& p : x) solid += segment_volume(R, p.z, z_bottom + k * thickness, z_bottom + (k + 1) * thickness);
    porosity.push_back(1.0 - solid / (area * thickness));
  }
  return porosity;
}

}  // namespace platen::reference
