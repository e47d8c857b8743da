// Invariants of the reference that hold for any correct program: frame, order of a pair, image, momentum, similarity,
// and the energy ledger, which closes to first order in the time step.
#include "reference_data.h"

namespace platen::reference {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double R = 0.0025, density = 2000.0;

// Every feature of the pair law in one collision; unequal spheres.
Bed rich_pair(double n, bool relative) {
  const double scale = std::pow(1e-4, n - 1.0);
  Bed bed;
  bed.pair_law = {.k1 = 5e3 / scale, .k2 = 1.2e4 / scale, .kadh = 2e2 / scale, .f0 = -0.01, .n = n, .e = 0.9,
                  .mu = 0.4, .mu_r = 0.02, .kt_ratio = 0.3, .rolling_relative = relative};
  const Vec3 d{0.6, 0.48, 0.64};
  bed.add(1.001 * R * d, {-0.8, -0.1, -0.6}, {0, 10, 30}, R, density);
  bed.add(-1.201 * R * d, {0.3, 0.4, 0.2}, {-20, 0, 5}, 1.2 * R, density);
  return bed;
}

Vec3 rotated(Vec3 v, Vec3 axis, double angle) {
  const Vec3 k = (1.0 / norm(axis)) * axis;
  return std::cos(angle) * v + std::sin(angle) * cross(k, v) + ((1.0 - std::cos(angle)) * dot(k, v)) * k;
}

TEST(ReferenceInvariants, RotatedFrame) {
  const std::pair<Vec3, double> turns[] = {{{1, 2, 3}, 0.7}, {{-2, 1, 0.3}, 2.9}, {{0.1, -1, 5}, 4.4}};
  for (double n : {1.0, 1.5})
    for (bool relative : {false, true})
      for (const auto& [axis, angle] : turns) {
        Bed bed = rich_pair(n, relative), turned = bed;
        for (Body& b : turned.spheres) {
          b.x = rotated(b.x, axis, angle);
          b.v = rotated(b.v, axis, angle);
          b.w = rotated(b.w, axis, angle);
        }
        bed.start();
        turned.start();
        bool met = false;
        for (int k = 0; k < 1000; ++k) {
          bed.advance(1e-6);
          turned.advance(1e-6);
          met = met || bed.pair_contacts() > 0;
        }
        EXPECT_TRUE(met);
        for (int i : {0, 1}) {
          EXPECT_LT(norm(rotated(bed.spheres[i].x, axis, angle) - turned.spheres[i].x), 1e-12 * R);
          EXPECT_LT(norm(rotated(bed.velocity(i), axis, angle) - turned.velocity(i)), 1e-12);
          EXPECT_LT(R * norm(rotated(bed.spin(i), axis, angle) - turned.spin(i)), 1e-12);
        }
      }
}

TEST(ReferenceInvariants, SwappedPairGivesTheSameBits) {
  for (double n : {1.0, 1.5})
    for (bool relative : {false, true}) {
      Bed bed = rich_pair(n, relative), swapped = bed;
      std::swap(swapped.spheres[0], swapped.spheres[1]);
      bed.start();
      swapped.start();
      for (int k = 0; k < 1000; ++k) {
        bed.advance(1e-6);
        swapped.advance(1e-6);
      }
      for (int i : {0, 1}) {
        EXPECT_EQ(norm(bed.spheres[i].x - swapped.spheres[1 - i].x), 0.0);
        EXPECT_EQ(norm(bed.velocity(i) - swapped.velocity(1 - i)), 0.0);
        EXPECT_EQ(norm(bed.spin(i) - swapped.spin(1 - i)), 0.0);
      }
    }
}

TEST(ReferenceInvariants, ImageShiftedByTheBox) {
  Bed bed = rich_pair(1.0, false);
  bed.periodic = true;
  bed.Lx = 0.03;
  bed.Ly = 0.025;
  Bed shifted = bed;
  shifted.spheres[1].x += {2.0 * bed.Lx, -bed.Ly, 0.0};
  bed.start();
  shifted.start();
  bool met = false;
  for (int k = 0; k < 1000; ++k) {
    bed.advance(1e-6);
    shifted.advance(1e-6);
    met = met || shifted.pair_contacts() > 0;
  }
  EXPECT_TRUE(met);
  // The overlap is a difference of numbers of the size of the box: eps L / delta_max = 7e-18 / 1e-4 of v.
  for (int i : {0, 1}) EXPECT_LT(norm(bed.velocity(i) - shifted.velocity(i)), 1e-11);
}

Vec3 momentum(const Bed& bed) {
  Vec3 p;
  for (std::size_t i = 0; i < bed.spheres.size(); ++i) p += bed.spheres[i].m * bed.velocity(i);
  return p;
}

Vec3 angular_momentum(const Bed& bed) {
  Vec3 L;
  for (std::size_t i = 0; i < bed.spheres.size(); ++i)
    L += bed.spheres[i].m * cross(bed.spheres[i].x, bed.velocity(i)) + bed.spheres[i].I * bed.spin(i);
  return L;
}

TEST(ReferenceInvariants, Momentum) {
  Bed bed = many_spheres(read_records("many_body").front());
  bed.planes = {};
  bed.g = 0.0;
  double scale = 0.0;
  for (const Body& b : bed.spheres) scale += b.m * norm(b.v);
  bed.start();
  const Vec3 before = momentum(bed);
  std::size_t most = 0;
  for (int k = 0; k < 5000; ++k) {
    bed.advance(2e-6);
    most = std::max(most, bed.pair_contacts());
  }
  EXPECT_GT(most, 2u);
  EXPECT_LT(norm(momentum(bed) - before), 1e-13 * scale);
}

TEST(ReferenceInvariants, AngularMomentum) {
  // Equal spheres: the levers R - delta/2 meet in one point. Each body's own rolling torque breaks it, the relative
  // model does not [A12].
  for (const auto& [relative, mu_r] : {std::pair{false, 0.0}, {true, 0.02}, {false, 0.02}}) {
    Bed bed = rich_pair(1.0, relative);
    bed.pair_law.mu_r = mu_r;
    bed.start();
    const Vec3 before = angular_momentum(bed);
    double largest = 0.0;
    for (int k = 0; k < 1000; ++k) {
      bed.advance(1e-6);
      largest = std::max(largest, norm(angular_momentum(bed) - before));
    }
    const double scale = norm(before);
    // The force acts at x_n while v is a half step aside: x x f uses the same x_n, so only rounding is left.
    if (relative || mu_r == 0.0) EXPECT_LT(largest, 1e-12 * scale);
    else EXPECT_GT(largest, 1e-4 * scale);
  }
}

TEST(ReferenceInvariants, RelativeRollingStopsTheRelativeSpinOnly) {
  Bed bed;
  bed.pair_law = {.k1 = 5e3, .k2 = 5e3, .f0 = -0.2, .e = 0.4, .mu = 0.0, .mu_r = 0.5, .rolling_relative = true};
  // Not at the overlap -f0/k1 where f_hys, and with it the torque, vanishes [A14].
  bed.add({R - 1e-5, 0, 0}, {}, {60, 0, 0}, R, density);
  bed.add({-R + 1e-5, 0, 0}, {}, {20, 0, 0}, R, density);  // spins about the normal: no slip of the contact point
  bed.start();
  double last = 40.0;
  for (int k = 0; k < 40000; ++k) {
    bed.advance(1e-6);
    const double relative = bed.spin(0).x - bed.spin(1).x;
    EXPECT_LE(relative, last * (1.0 + 1e-12) + 1e-12);
    EXPECT_GE(relative, -1e-9);
    last = relative;
  }
  EXPECT_LT(last, 1e-6);
  EXPECT_NEAR(bed.spin(0).x + bed.spin(1).x, 80.0, 1e-9);
}

// All lengths x 2 at the same density and moduli: the same motion, twice as large and twice as slow.
TEST(ReferenceInvariants, ExactSimilarity) {
  Bed bed = many_spheres(read_records("many_body").front());
  bed.planes[bottom].point.z = 0.002;  // closer plates, so that they take part early
  bed.planes[top].point.z = 0.0155;
  Bed twice = bed;
  twice.pair_law.k1 *= 2.0;
  twice.pair_law.k2 *= 2.0;
  twice.pair_law.kadh *= 2.0;
  twice.pair_law.f0 *= 4.0;
  twice.g /= 2.0;
  twice.Lx *= 2.0;
  twice.Ly *= 2.0;
  for (Plane& p : twice.planes) p.point = 2.0 * p.point;
  twice.spheres.clear();
  for (const Body& b : bed.spheres) twice.add(2.0 * b.x, b.v, 0.5 * b.w, 2.0 * b.R, 2000.0);
  bed.start();
  twice.start();
  bool plates = false;
  for (int k = 0; k < 2000; ++k) {
    bed.advance(2e-6);
    twice.advance(4e-6);
    plates = plates || bed.plane_contacts() > 0;
  }
  EXPECT_TRUE(plates);
  EXPECT_GT(bed.pair_contacts(), 3u);
  for (std::size_t i = 0; i < bed.spheres.size(); ++i) {
    EXPECT_LT(norm(2.0 * bed.spheres[i].x - twice.spheres[i].x), 1e-11 * R);
    EXPECT_LT(norm(bed.velocity(i) - twice.velocity(i)), 1e-9);
    EXPECT_LT(norm(4.0 * bed.force(i) - twice.force(i)), 1e-8 * (norm(twice.force(i)) + 1e-3));
  }
}

// --------------------------------------------------------------------------------------------------- energy ledger

// Largest ledger residual on the way, over the energy lost by then at the end. `terms` must never decrease.
double ledger_residual(Bed bed, double dt, double t_end) {
  bed.start();
  const double before = bed.energy().total();
  Energy last = bed.energy();
  double largest = 0.0;
  const long steps = std::lround(t_end / dt);
  for (long k = 0; k < steps; ++k) {
    bed.advance(dt);
    if (k % 10 != 0 && k + 1 != steps) continue;
    const Energy e = bed.energy();
    largest = std::max(largest, std::abs(e.total() - before));
    EXPECT_GE(e.plastic, last.plastic);
    EXPECT_GE(e.sliding, last.sliding);
    EXPECT_GE(e.viscous, last.viscous);
    last = e;
  }
  EXPECT_GT(last.dissipated(), 0.0);
  return largest / last.dissipated();
}

TEST(ReferenceLedger, ClosesToFirstOrderInOneCollision) {
  for (double n : {1.0, 1.5})
    for (bool relative : {false, true}) {
      const double coarse = ledger_residual(rich_pair(n, relative), 1e-6, 1.2e-3);
      const double fine = ledger_residual(rich_pair(n, relative), 1e-7, 1.2e-3);
      EXPECT_LT(coarse, 5e-3) << "n = " << n;
      EXPECT_LT(fine, 0.15 * coarse) << "n = " << n << ", coarse " << coarse << ", fine " << fine;
      EXPECT_GT(fine, 0.05 * coarse) << "n = " << n;
    }
}

TEST(ReferenceLedger, ClosesToFirstOrderAtAMovingPlate) {
  const auto scene = [] {
    Bed bed;
    bed.pair_law = {.k1 = 5e3, .k2 = 2.5e4};
    bed.plate_law.mu_r = 0.02;
    bed.g = 9.81;
    bed.add_bottom();
    bed.planes[bottom].motion = [](double t) { return 1.5e-3 * std::sin(2.0 * pi * 60.0 * t); };
    bed.add({0, 0, R + 2e-5}, {0.3, 0.1, -0.2}, {20, -7, 11}, R, density);
    return bed;
  };
  const double coarse = ledger_residual(scene(), 1e-6, 2e-3), fine = ledger_residual(scene(), 1e-7, 2e-3);
  EXPECT_LT(coarse, 2e-2);
  EXPECT_LT(fine, 0.15 * coarse) << coarse << " " << fine;
}

TEST(ReferenceLedger, ClosesInABed) {
  Bed bed = many_spheres(read_records("many_body").front());
  bed.planes[bottom].motion = [](double t) { return 0.0022 + 2e-4 * std::sin(2.0 * pi * 200.0 * t); };
  bed.planes[bottom].point.z = 0.0022;
  bed.planes[top].point.z = 0.0155;
  const double coarse = ledger_residual(bed, 2e-6, 0.012), fine = ledger_residual(bed, 2.5e-7, 0.012);
  EXPECT_LT(coarse, 2e-2);
  EXPECT_LT(fine, 0.25 * coarse) << coarse << " " << fine;  // about an eighth; contacts open and close
}

}  // namespace
}  // namespace platen::reference
