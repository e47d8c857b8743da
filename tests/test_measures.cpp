// Quantities of a bed: exact sphere segments, profiles over height, porosity.
#include "core/measures.h"

#include <array>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "reference_data.h"

namespace platen {
namespace {

constexpr double pi = std::numbers::pi;

Snapshot bed_of(const std::vector<std::array<double, 3>>& places, double R, double z_bottom, double z_top) {
  Snapshot snapshot;
  snapshot.z_bottom = z_bottom;
  snapshot.z_top = z_top;
  for (std::size_t k = 0; k < places.size(); ++k) {
    snapshot.particles.id.push_back(static_cast<std::int64_t>(10 * k));  // ids need not be rows
    snapshot.particles.radius.push_back(R);
    snapshot.particles.position.insert(snapshot.particles.position.end(), places[k].begin(), places[k].end());
  }
  return snapshot;
}

void touch(Snapshot& snapshot, std::int64_t a, std::int64_t b) {
  snapshot.contacts.pair.insert(snapshot.contacts.pair.end(), {a, b});
  snapshot.contacts.image.insert(snapshot.contacts.image.end(), {0, 0});
  snapshot.contacts.overlap.push_back(1e-6);
}

TEST(SphereSegment, ClosedForms) {
  const double R = 2.5e-3, z = 0.7, whole = 4.0 / 3.0 * pi * R * R * R;
  // Heights near 0.7 are rounded to 1e-16, i.e. 4e-14 of the radius.
  const double rel = 1e-12;
  EXPECT_NEAR(sphere_segment_volume(R, z, 0.0, 1.0), whole, rel * whole);
  EXPECT_NEAR(sphere_segment_volume(R, z, z, 1.0), 0.5 * whole, rel * whole);
  EXPECT_NEAR(sphere_segment_volume(R, z, 0.0, z), 0.5 * whole, rel * whole);
  for (const double h : {1e-5, 1e-4, 1e-3, 2e-3, 4e-3}) {  // cap of height h: pi h^2 (3 R - h)/3
    const double cap = pi * h * h * (3.0 * R - h) / 3.0;
    EXPECT_NEAR(sphere_segment_volume(R, z, z + R - h, 1.0), cap, rel * whole);
    EXPECT_NEAR(sphere_segment_volume(R, z, 0.0, z - R + h), cap, rel * whole);
  }
  EXPECT_EQ(sphere_segment_volume(R, z, z + 1.01 * R, 1.0), 0.0);
  EXPECT_EQ(sphere_segment_volume(R, z, 0.0, z - 2.0 * R), 0.0);
  EXPECT_EQ(sphere_segment_volume(R, z, z, z), 0.0);
}

TEST(SphereSegment, AgreesWithSummedDiscs) {
  const double R = 1.3, z = 0.2, a = -0.5, b = 1.1;
  const int discs = 2000;  // midpoint rule on a parabola: error (b - a)^3 pi/(12 n^2) = 3e-7
  double sum = 0.0;
  for (int k = 0; k < discs; ++k) {
    const double t = a + (b - a) * (k + 0.5) / discs - z;
    sum += pi * (R * R - t * t) * (b - a) / discs;
  }
  EXPECT_NEAR(sphere_segment_volume(R, z, a, b), sum, 3e-7);
}

TEST(SphereSegment, PartsAddUp) {
  const double R = 1.0, whole = 4.0 / 3.0 * pi;
  for (int offset = 0; offset < 50; ++offset) {
    const double z = 0.037 * offset;
    double sum = 0.0;
    for (int k = -10; k < 30; ++k) {
      const double part = sphere_segment_volume(R, z, 0.3 * k, 0.3 * (k + 1));
      EXPECT_GE(part, 0.0);
      sum += part;
    }
    EXPECT_NEAR(sum, whole, 1e-14 * 40);
  }
}

TEST(Profile, MeetsTheWorkedExample) {
  for (const reference::Record& r : reference::read_records("packing_measures")) {
    ASSERT_EQ(r.kind, "packing");
    std::vector<std::array<double, 3>> places;
    for (const auto& x : r.inputs.at("x")) places.push_back({x.at(0), x.at(1), x.at(2)});
    const Snapshot bed = bed_of(places, r.inputs.at("R"), r.inputs.at("z_bottom"), r.inputs.at("z_top"));
    const double area = r.inputs.at("Lx").get<double>() * r.inputs.at("Ly").get<double>();
    EXPECT_TRUE(reference::meets(r, "porosity", bulk_porosity(bed.particles, area, bed.z_bottom, bed.z_top)));
    const Profile slabs = profile(bed, area, r.inputs.at("slabs"));
    EXPECT_TRUE(reference::meets(r, "slab_porosity", slabs.porosity));
  }
}

TEST(Profile, SpheresOutsideCountOnlyInside) {
  const double R = 1.0, area = 10.0;
  // Centres on both plates, one just below the bottom plate, one quite outside.
  const Snapshot bed = bed_of({{0, 0, 5}, {0, 0, 9}, {0, 0, 4.5}, {0, 0, 20}}, R, 5.0, 9.0);
  const Profile slabs = profile(bed, area, 2);
  const double half = 2.0 / 3.0 * pi, cap = pi * 0.25 * (3.0 - 0.5) / 3.0;
  EXPECT_NEAR(slabs.z[0], 6.0, 1e-15);
  EXPECT_NEAR(slabs.z[1], 8.0, 1e-15);
  EXPECT_NEAR(slabs.porosity[0], 1.0 - (half + cap) / 20.0, 1e-14);
  EXPECT_NEAR(slabs.porosity[1], 1.0 - half / 20.0, 1e-14);
  // The bulk takes whole spheres, wherever they are.
  EXPECT_NEAR(bulk_porosity(bed.particles, area, 5.0, 9.0), 1.0 - 4.0 * 4.0 / 3.0 * pi / 40.0, 1e-14);
}

TEST(Profile, MeanOfSlabsIsTheBulkOfABedInside) {
  const Snapshot bed = bed_of({{0, 0, 1.2}, {1, 0, 2.31}, {3, 2, 4.7}, {0, 1, 5.9}}, 1.1, 0.0, 7.0);
  for (const int count : {1, 2, 3, 7, 12, 100}) {
    const Profile slabs = profile(bed, 12.0, count);
    double mean = 0.0;
    for (const double porosity : slabs.porosity) mean += porosity / count;
    EXPECT_NEAR(mean, bulk_porosity(bed.particles, 12.0, 0.0, 7.0), 1e-14 * count) << count;
  }
}

TEST(Profile, CoordinationOfTheSpheresCentredInASlab) {
  // ids 0, 10, 20, 30 at heights 0.5, 1.5, 1.6, 4 (the top edge): slabs of height 1 between 0 and 4.
  Snapshot bed = bed_of({{0, 0, 0.5}, {0, 0, 1.5}, {0, 0, 1.6}, {0, 0, 4.0}}, 0.6, 0.0, 4.0);
  touch(bed, 0, 10);
  touch(bed, 10, 20);
  touch(bed, 0, 20);
  touch(bed, 20, 30);
  const Profile slabs = profile(bed, 4.0, 4);
  EXPECT_EQ(slabs.coordination_number[0], 2.0);
  EXPECT_EQ(slabs.coordination_number[1], 2.5);
  EXPECT_TRUE(std::isnan(slabs.coordination_number[2]));
  EXPECT_EQ(slabs.coordination_number[3], 1.0);
}

TEST(Profile, NothingToDivideBy) {
  const Snapshot flat = bed_of({{0, 0, 0}}, 1.0, 1.0, 1.0);
  EXPECT_TRUE(std::isnan(bulk_porosity(flat.particles, 1.0, 1.0, 1.0)));
  const Profile slabs = profile(flat, 1.0, 3);
  ASSERT_EQ(slabs.porosity.size(), 3u);
  for (const double porosity : slabs.porosity) EXPECT_TRUE(std::isnan(porosity));
  EXPECT_TRUE(profile(flat, 1.0, 0).z.empty());
  EXPECT_EQ(bulk_porosity({}, 1.0, 0.0, 1.0), 1.0);
}

}  // namespace
}  // namespace platen
