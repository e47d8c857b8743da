// The second judge of the contact laws: textbook form, one contact at a time, the paper's symbols and equation numbers.
// It shares no line with kernels/ or core/, so that a mistake there cannot hide here.
//
// Sources: [Thakur2016] Eq. 1-11 for pairs of spheres (Edinburgh elasto-plastic adhesive law), [EDEM] total-form
// Hertz-Mindlin for sphere and plate. A1-A50 are the resolved ambiguities in docs/laws.md.
// Signs: overlap positive in contact, repulsion positive, n points from j to i (from the plate to the sphere), forces
// act on i (on the sphere). SI units.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

namespace platen::reference {

struct Vec3 {
  double x = 0.0, y = 0.0, z = 0.0;
};
inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator-(Vec3 a) { return {-a.x, -a.y, -a.z}; }
inline Vec3 operator*(double s, Vec3 a) { return {s * a.x, s * a.y, s * a.z}; }
inline Vec3& operator+=(Vec3& a, Vec3 b) { return a = a + b; }
inline double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(Vec3 a, Vec3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double norm(Vec3 a) { return std::sqrt(dot(a, a)); }

// z = 1/(1 + (pi/ln e)^2), the factor of Eq. 4; 0 at e = 1.
inline double damping_factor(double e) {
  const double l = std::log(e), pi = std::numbers::pi;
  return l * l / (l * l + pi * pi);
}

// ---------------------------------------------------------------------------------------------- pairs of spheres

struct EepaLaw {
  double k1 = 0.0, k2 = 0.0, kadh = 0.0;  // [N/m^n]
  double f0 = 0.0;                        // [N], <= 0 attracts [A1]
  double n = 1.0;                         // exponent [-]
  double e = 1.0, mu = 0.0, mu_r = 0.0;   // [-]
  double kt_ratio = 2.0 / 7.0;            // kt / K1 [-]
  bool plain_limit = false;               // mu |f_hys| in place of Eq. 10
  bool rolling_relative = false;          // against the relative spin instead of each body's own [A12]
};

enum class Branch { none, loading, elastic, adhesive };

// What a pair remembers from step to step.
struct EepaContact {
  bool touching = false;
  double delta = 0.0;  // overlap at the last step [m]
  double sp = 0.0;     // delta_p^n [m^n]
  Vec3 spring;         // tangential spring force on i [N]
  double kt = 0.0;     // tangential stiffness at the last step [N/m]
};

struct EepaNormal {
  Branch branch = Branch::none;  // by Eq. 2, before sp moves
  double f_hys = 0.0;            // [N]
  double limit = 0.0;            // Coulomb limit of the tangential spring, Eq. 10 [N]
  double plastic = 0.0;          // energy lost since the last overlap [J]
  double loading_margin = 0.0;   // k2 (s - sp) - k1 s   before sp moves [N]: 0 at a tie of the branches
  double adhesive_margin = 0.0;  // k2 (s - sp) + kadh s before sp moves [N]
};

// Energy lost per delta^(n+1) when the overlap moves along the branch f = k delta^n on which delta_p = c delta:
// work of the branch less the change of the stored energy E_n.
inline double loss_per_overlap(const EepaLaw& law, double k, double c) {
  const double n = law.n;
  const double stored = law.k2 * ((1.0 - std::pow(c, n + 1.0)) / (n + 1.0) - std::pow(c, n) * (1.0 - c));
  return k / (n + 1.0) - stored;
}

// Eq. 2 with the history of A2-A5: drives the contact to the overlap delta. Independent of the number of steps taken.
inline EepaNormal eepa_normal(const EepaLaw& law, EepaContact& c, double delta) {
  const double k1 = law.k1, k2 = law.k2, kadh = law.kadh, n = law.n;
  const double ratio_loading = 1.0 - k1 / k2, ratio_adhesive = 1.0 + kadh / k2;  // sp / s on the two branches
  EepaNormal r;
  // On the way out every contact follows the adhesive branch down to delta = 0, where it ends [A5].
  const bool open = delta <= 0.0;
  const double s = open ? 0.0 : std::pow(delta, n);
  if (open && !c.touching) return r;
  r.loading_margin = k2 * (s - c.sp) - k1 * s;
  r.adhesive_margin = k2 * (s - c.sp) + kadh * s;
  const double d_here = open ? 0.0 : std::pow(delta, n + 1.0);
  if (!open && r.loading_margin >= 0.0) {
    r.branch = Branch::loading;
    r.f_hys = law.f0 + k1 * s;
    if (ratio_loading > 0.0) {  // entered where the elastic line met it, s = sp/(1 - k1/k2)
      const double d_entry = std::pow(c.sp / ratio_loading, (n + 1.0) / n);
      r.plastic = loss_per_overlap(law, k1, std::pow(ratio_loading, 1.0 / n)) * (d_here - d_entry);
    }
    c.sp = ratio_loading * s;
  } else if (open || r.adhesive_margin <= 0.0) {
    r.branch = open ? Branch::none : Branch::adhesive;
    r.f_hys = open ? 0.0 : law.f0 - kadh * s;
    const double d_entry = std::pow(c.sp / ratio_adhesive, (n + 1.0) / n);
    r.plastic = loss_per_overlap(law, -kadh, std::pow(ratio_adhesive, 1.0 / n)) * (d_here - d_entry);
    c.sp = ratio_adhesive * s;
  } else {
    r.branch = Branch::elastic;
    r.f_hys = law.f0 + k2 * (s - c.sp);
  }
  r.plastic = std::max(r.plastic, 0.0);  // an entry point found by rounding may lie just behind the present one
  r.limit = open ? 0.0 : law.mu * std::abs(law.plain_limit ? r.f_hys : r.f_hys + kadh * s - law.f0);
  c.touching = !open;
  c.delta = open ? 0.0 : delta;
  return r;
}

// Stored normal energy E_n of the k2 spring, zero at delta = delta_p [J]; f0 delta is counted apart.
inline double eepa_stored(const EepaLaw& law, const EepaContact& c) {
  if (!c.touching) return 0.0;
  const double n = law.n, delta_p = std::pow(c.sp, 1.0 / n);
  return law.k2 * ((std::pow(c.delta, n + 1.0) - std::pow(delta_p, n + 1.0)) / (n + 1.0) - c.sp * (c.delta - delta_p));
}

// A body as a contact sees it.
struct Body {
  Vec3 x, v, w;  // position [m], velocity [m/s], spin [rad/s]
  double R = 0.0, m = 0.0, I = 0.0;
};

struct EepaForces {
  EepaNormal normal;
  Vec3 n;                      // from j to i
  double f_damping = 0.0;      // beta_n d(delta)/dt, positive repels [N]
  Vec3 spring, dashpot;        // tangential, on i [N]
  bool cut = false;            // spring at its limit
  double beta_n = 0.0, beta_t = 0.0, kt = 0.0;
  double a_i = 0.0, a_j = 0.0; // lever arms [m]
  Vec3 force;                  // on i; the opposite acts on j [N]
  Vec3 torque_i, torque_j;     // of the tangential force, and of the relative rolling model [N m]
  double rolling_i = 0.0, rolling_j = 0.0;  // mu_r |f_hys| a of the absolute model, Eq. 11 [N m]
  double plastic = 0.0, viscous = 0.0, sliding = 0.0, rolling = 0.0;  // energy lost since the last step [J]
  double model = 0.0;          // energy that a kt changing with delta (n != 1) gives to the spring at rest [J]
};

// Eq. 1-11. x_ij = x_i - x_j (nearest image); velocities are those of the last half step and dt is the last drift step.
// The mean spin about the normal does not turn the spring (as EDEM).
inline EepaForces eepa_contact(const EepaLaw& law, EepaContact& c, const Body& i, const Body& j, Vec3 x_ij, double dt) {
  EepaForces r;
  const double distance = norm(x_ij), delta = i.R + j.R - distance;
  const Vec3 spring_before = c.spring;
  const double kt_before = c.kt;
  r.normal = eepa_normal(law, c, delta);
  r.plastic = r.normal.plastic;
  if (!c.touching) {  // what the spring still held is lost; the surfaces become like new
    if (kt_before > 0.0) r.sliding = dot(spring_before, spring_before) / (2.0 * kt_before);
    c = EepaContact{};
    return r;
  }
  const Vec3 n = (1.0 / distance) * x_ij;
  r.n = n;
  r.a_i = i.R - delta / 2.0;  // centre to contact point [A18]
  r.a_j = j.R - delta / 2.0;
  const Vec3 v = i.v - j.v;
  // The normal of half a step ago, to which the velocities belong, is n - dt/2 dn/dt; the tangent plane is the present one.
  const Vec3 across = v - dot(v, n) * n, spins = r.a_i * i.w + r.a_j * j.w;
  const Vec3 turned = spins + (0.5 * dt / distance) * dot(spins, n) * across;
  const Vec3 v_t = across - cross(turned, n);
  const double rate = -dot(v, n);  // d(delta)/dt

  // Eq. 3, 4 and A8: K1 is the tangent stiffness of the loading branch, K1 = k1 at n = 1.
  const double m_eff = i.m * j.m / (i.m + j.m), z = damping_factor(law.e);
  const double delta_k = law.n < 1.0 ? std::max(delta, 1e-3 * std::min(i.R, j.R)) : delta;
  const double K1 = law.n * law.k1 * std::pow(delta_k, law.n - 1.0);
  const double shape = std::sqrt((law.n + 1.0) / (2.0 * law.n));
  r.kt = law.kt_ratio * K1;
  r.beta_n = shape * std::sqrt(4.0 * m_eff * K1 * z);
  r.beta_t = shape * std::sqrt(4.0 * m_eff * r.kt * z);
  r.f_damping = r.beta_n * rate;
  r.viscous += r.beta_n * rate * rate * dt;

  // Eq. 5-9: the spring follows the tangent plane with its length kept, then takes up the slip of this step.
  Vec3 T = spring_before - dot(spring_before, n) * n;
  const double length = norm(spring_before), projected = norm(T);
  if (projected > 0.0) T = (length / projected) * T;
  if (kt_before > 0.0) r.model = 0.5 * length * length * (1.0 / r.kt - 1.0 / kt_before);
  T = T - (r.kt * dt) * v_t;

  // Eq. 10: limit of the spring alone; no dashpot while it slides [A10].
  const double trial = norm(T), limit = r.normal.limit;
  r.cut = !(trial < limit);
  if (trial > limit) {
    T = (limit / trial) * T;
    r.sliding += (trial * trial - limit * limit) / (2.0 * r.kt);
  }
  r.spring = T;
  if (!r.cut) {
    r.dashpot = (-r.beta_t) * v_t;
    r.viscous += r.beta_t * dot(v_t, v_t) * dt;
  }
  c.spring = T;
  c.kt = r.kt;

  const Vec3 f_t = r.spring + r.dashpot;
  r.force = (r.normal.f_hys + r.f_damping) * n + f_t;  // Eq. 1
  r.torque_i = cross(-r.a_i * n, f_t);
  r.torque_j = cross(r.a_j * n, -f_t);

  // Eq. 11. The relative model's cap keeps one step from turning the relative spin round [A13].
  const double F_r = law.mu_r * std::abs(r.normal.f_hys);
  if (!law.rolling_relative) {
    r.rolling_i = F_r * r.a_i;
    r.rolling_j = F_r * r.a_j;
  } else {
    const Vec3 w_rel = i.w - j.w;
    const double w = norm(w_rel);
    if (w > 0.0 && dt > 0.0) {
      const double a_eff = r.a_i * r.a_j / (r.a_i + r.a_j), I_eff = i.I * j.I / (i.I + j.I);
      const double M = std::min(F_r * a_eff, I_eff * w / (8.0 * dt));
      r.torque_i += (-M / w) * w_rel;
      r.torque_j += (M / w) * w_rel;
      r.rolling = M * w * dt;
    }
  }
  return r;
}

// ---------------------------------------------------------------------------------------------- sphere and plate

struct HertzMindlinLaw {
  double E_s = 2.6e8, nu_s = 0.3, E_p = 2.5e10, nu_p = 0.25;  // sphere, plate [Pa, -]; defaults of A16
  double e = 0.4, mu = 0.3, mu_r = 0.001;
  double E_star() const { return 1.0 / ((1.0 - nu_s * nu_s) / E_s + (1.0 - nu_p * nu_p) / E_p); }
  double G_star() const {
    const double G_s = E_s / (2.0 * (1.0 + nu_s)), G_p = E_p / (2.0 * (1.0 + nu_p));
    return 1.0 / ((2.0 - nu_s) / G_s + (2.0 - nu_p) / G_p);
  }
};

struct PlateContact {
  bool touching = false;
  double delta = 0.0;  // [m]
  Vec3 xi;             // tangential elongation [m]
  double S_t = 0.0;    // tangential stiffness at the last step [N/m]
};

struct PlateForces {
  double F_spring = 0.0, F_damping = 0.0;  // normal, positive repels [N]
  Vec3 F_t;                                // tangential, on the sphere [N]
  bool cut = false;
  double S_n = 0.0, S_t = 0.0, c_n = 0.0, c_t = 0.0;
  double a = 0.0;        // lever arm [m]
  Vec3 force, torque;    // on the sphere
  double rolling = 0.0;  // mu_r F_spring a [N m]
  double viscous = 0.0, sliding = 0.0;  // energy lost since the last step [J]
  double model = 0.0;    // energy that S_t(delta) gives to the elongation at rest [A17] [J]
};

// Total form, F_t = -S_t(delta) xi [A17]. v is relative to the plate's velocity; n points from the plate to the sphere.
inline PlateForces hertz_mindlin_contact(const HertzMindlinLaw& law, PlateContact& c, const Body& b, double delta,
                                         Vec3 n, Vec3 v, double dt) {
  PlateForces r;
  if (delta <= 0.0) {
    r.sliding = 0.5 * c.S_t * dot(c.xi, c.xi);
    c = PlateContact{};
    return r;
  }
  r.a = b.R - delta;  // the contact point lies on the plate's surface [A18]
  const Vec3 v_c = v + cross(b.w, -r.a * n);
  const double v_n = dot(v, n);
  const Vec3 v_t = v_c - dot(v_c, n) * n;
  r.F_spring = 4.0 / 3.0 * law.E_star() * std::sqrt(b.R) * std::pow(delta, 1.5);
  r.S_n = 2.0 * law.E_star() * std::sqrt(b.R * delta);
  r.S_t = 8.0 * law.G_star() * std::sqrt(b.R * delta);
  const double z = damping_factor(law.e), root = 2.0 * std::sqrt(5.0 / 6.0);
  r.c_n = root * std::sqrt(z * b.m * r.S_n);
  r.c_t = root * std::sqrt(z * b.m * r.S_t);
  r.F_damping = -r.c_n * v_n;
  r.viscous = r.c_n * v_n * v_n * dt;

  if (c.touching) r.model = 0.5 * (r.S_t - c.S_t) * dot(c.xi, c.xi);
  Vec3 xi = c.xi + dt * v_t;
  xi = xi - dot(xi, n) * n;
  const double trial = norm(xi), limit = law.mu * r.F_spring / r.S_t;
  r.cut = !(trial < limit);
  if (trial > limit) {
    xi = (limit / trial) * xi;
    r.sliding = 0.5 * r.S_t * (trial * trial - limit * limit);
  }
  r.F_t = (-r.S_t) * xi;
  if (!r.cut) {
    r.F_t += (-r.c_t) * v_t;
    r.viscous += r.c_t * dot(v_t, v_t) * dt;
  }
  c = PlateContact{true, delta, xi, r.S_t};
  r.force = (r.F_spring + r.F_damping) * n + r.F_t;  // no clamp of the total normal force [A7]
  r.torque = cross(-r.a * n, r.F_t);
  r.rolling = law.mu_r * r.F_spring * r.a;
  return r;
}

// Stored energy, normal and tangential [J].
inline double hertz_mindlin_stored(const HertzMindlinLaw& law, const PlateContact& c, double R) {
  if (!c.touching) return 0.0;
  return 8.0 / 15.0 * law.E_star() * std::sqrt(R) * std::pow(c.delta, 2.5) + 0.5 * c.S_t * dot(c.xi, c.xi);
}

}  // namespace platen::reference
