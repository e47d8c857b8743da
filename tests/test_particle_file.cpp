// Particle files: what is read, what is refused, and where spheres may stand.
#include "case_texts.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

#include <unistd.h>

#include "protocol/particle_file.h"

namespace platen {
namespace {

ParticleFile parse(const std::string& bytes, std::optional<double> radius = 1.0, std::optional<double> density = 1.0) {
  return parse_particle_file(bytes, "p.csv", radius, density);
}

void refused(const std::string& bytes, const std::string& begin, const std::string& part = "",
             std::optional<double> radius = 1.0) {
  const ParticleFile file = parse(bytes, radius);
  ASSERT_FALSE(file.problems.empty()) << bytes;
  EXPECT_EQ(file.problems.front().substr(0, begin.size()), begin);
  EXPECT_NE(file.problems.front().find(part), std::string::npos) << file.problems.front();
}

TEST(ParticleFile, ColumnsInAnyOrder) {
  const ParticleFile file = parse(
      "\xef\xbb\xbf# a comment\r\n\r\n z , y,x,radius,vx,wz,id,density\r\n 3,2,+1,0.5,-1e-3,7,42,2000\r\n# "
      "more\n6,5,4,0.25,0,0,41,1000");
  ASSERT_TRUE(file.problems.empty()) << file.problems.front();
  ASSERT_EQ(file.table.size(), 2u);
  EXPECT_EQ(file.table.x, (std::vector<double>{1, 4}));
  EXPECT_EQ(file.table.z, (std::vector<double>{3, 6}));
  EXPECT_EQ(file.table.radius, (std::vector<double>{0.5, 0.25}));
  EXPECT_EQ(file.table.vx, (std::vector<double>{-1e-3, 0}));
  EXPECT_EQ(file.table.wz, (std::vector<double>{7, 0}));
  EXPECT_EQ(file.table.wx, (std::vector<double>{0, 0}));
  EXPECT_EQ(file.table.id, (std::vector<std::int64_t>{42, 41}));
  EXPECT_EQ(file.table.density, (std::vector<double>{2000, 1000}));
  EXPECT_EQ(file.line, (std::vector<std::size_t>{4, 6}));
}

TEST(ParticleFile, Defaults) {
  const ParticleFile file = parse("x,y,z\n1,2,3\n4,5,6\n", 0.1, 2500.0);
  EXPECT_EQ(file.table.id, (std::vector<std::int64_t>{0, 1}));
  EXPECT_EQ(file.table.radius, (std::vector<double>{0.1, 0.1}));
  EXPECT_EQ(file.table.density, (std::vector<double>{2500, 2500}));
  EXPECT_EQ(file.table.vy, (std::vector<double>{0, 0}));
}

TEST(ParticleFile, BadHeaders) {
  refused("", "p.csv:1: the file has no header");
  refused("# only\n\n", "p.csv:1: the file has no header");
  refused("x,y,z\n", "p.csv:1: the file has no particles");
  refused("x,y,z,raduis\n", "p.csv:1: unknown column \"raduis\"; allowed: id,x,y,z", "nearest known column: radius");
  refused("x,y,z,x\n", "p.csv:1: column x appears twice");
  refused("\nx,y\n", "p.csv:2: column z is missing");
  refused("x,y,z\n1,2,3\n", "p.csv:1: column radius is missing", "particles.radius", std::nullopt);
}

TEST(ParticleFile, BadRows) {
  refused("x,y,z\n1,2,3\n1,2\n", "p.csv:3: 2 cells, but the header has 3");
  refused("x,y,z\n1,two,3\n", "p.csv:2: y: \"two\" is not a number");
  refused("x,y,z\n1,2 mm,3\n", "p.csv:2: y: \"2 mm\" is not a number; allowed: a plain number in SI units");
  refused("x,y,z\n1,,3\n", "p.csv:2: y: \"\" is not a number");
  refused("x,y,z\n1,2,nan\n", "p.csv:2: z: \"nan\" is not a finite number");
  refused("x,y,z\n1,2,-inf\n", "p.csv:2: z: \"-inf\" is not a finite number");
  refused("x,y,z\n1,2,1e999\n", "p.csv:2: z: \"1e999\" is not a finite number that fits");
  refused("x,y,z,radius\n1,2,3,0\n", "p.csv:2: radius: \"0\" is out of range; allowed: > 0");
  refused("id,x,y,z\n1.5,1,2,3\n", "p.csv:2: id: \"1.5\" is not a whole number");
  refused("id,x,y,z\n-1,1,2,3\n", "p.csv:2: id: \"-1\" is not a whole number from 0 on");
  refused("id,x,y,z\n3,1,2,3\n\n3,7,8,9\n", "p.csv:4: id: 3 is used twice, first in line 2");
}

TEST(ParticleFile, ManyBadRowsAreNotAllNamed) {
  std::string bytes = "x,y,z\n";
  for (int i = 0; i < 1000; ++i) bytes += "a,b\n";
  EXPECT_EQ(parse(bytes).problems.size(), 21u);
  EXPECT_EQ(parse(bytes).problems.back(), "p.csv: more rows are wrong; only the first 20 are named");
}

TEST(ParticleFile, AnyBytesAreSafe) {
  std::mt19937 random(5);
  for (int i = 0; i < 5000; ++i) {
    std::string bytes = random() % 4 != 0 ? "id,x,y,z,radius\n1,2,3,4,5\n" : "";
    for (std::size_t n = random() % 60; n > 0; --n) {
      bytes += random() % 2 != 0 ? "0123456789.,-+e\n# xyz"[random() % 21] : static_cast<char>(random() % 256);
    }
    const ParticleFile file = parse(bytes);
    if (file.problems.empty())
      check_particle_positions(file, "p.csv", BoxSpec{true, 3.0, 4.0, 5.0, Sides::periodic}, true, true);
  }
}

BoxSpec box(Sides sides) { return {true, 10.0, 12.0, 20.0, sides}; }

std::vector<std::string> positions(const std::string& rows, Sides sides, bool plates = true) {
  const ParticleFile file = parse("x,y,z,radius\n" + rows);
  EXPECT_TRUE(file.problems.empty());
  return check_particle_positions(file, "p.csv", box(sides), plates, plates);
}

TEST(ParticlePositions, SidesAndPlates) {
  EXPECT_TRUE(positions("0,0,1,1\n9.9,11.9,19.9,1\n5,5,10,1\n", Sides::open).empty());
  EXPECT_EQ(positions("10,5,5,1\n", Sides::periodic).at(0),
            "p.csv:2: x: particle 0 at 10 m is outside the periodic box; allowed: 0 <= x < 10 m");
  EXPECT_EQ(positions("5,-0.1,5,1\n", Sides::periodic).at(0).substr(0, 30), "p.csv:2: y: particle 0 at -0.1");
  EXPECT_TRUE(positions("0,0,5,1\n", Sides::periodic).empty());
  EXPECT_NE(positions("0,5,5,1\n", Sides::walls).at(0).find("beyond a wall"), std::string::npos);
  EXPECT_TRUE(positions("-7,90,5,1\n", Sides::open).empty());
  EXPECT_NE(positions("5,5,0,1\n", Sides::periodic).at(0).find("beyond the bottom plate"), std::string::npos);
  EXPECT_NE(positions("5,5,20,1\n", Sides::periodic).at(0).find("beyond the top plate"), std::string::npos);
  EXPECT_TRUE(positions("5,5,-20,1\n5,5,90,1\n", Sides::periodic, false).empty());
}

TEST(ParticlePositions, Overlaps) {
  EXPECT_TRUE(positions("5,5,5,1\n6.01,5,5,1\n", Sides::periodic).empty()) << "less than the smaller radius";
  EXPECT_EQ(positions("5,5,5,1\n5.9,5,5,1\n", Sides::periodic).at(0).substr(0, 60),
            "p.csv:3: particle 1 overlaps particle 0 of line 2 by 1.1 m; ");
  EXPECT_TRUE(positions("5,5,5,2\n7.1,5,5,0.5\n", Sides::periodic).empty());
  EXPECT_EQ(positions("5,5,5,2\n6.9,5,5,0.5\n", Sides::periodic).size(), 1u);
  EXPECT_EQ(positions("0.1,5,5,1\n9.8,5,5,1\n", Sides::periodic).size(), 1u) << "through the periodic side";
  EXPECT_EQ(positions("0.1,0.1,5,1\n9.8,11.8,5,1\n", Sides::periodic).size(), 1u) << "through the periodic edge";
  EXPECT_TRUE(positions("0.1,5,5,1\n9.8,5,5,1\n", Sides::walls).empty());
}

TEST(ParticlePositions, ARadiusInAnotherUnit) {
  const auto found = positions("1,1,1,1\n5,5,5,20\n7,7,7,1\n", Sides::periodic);
  ASSERT_EQ(found.size(), 1u) << "what it overlaps is not what is wrong";
  EXPECT_EQ(found.at(0), "p.csv:3: radius: particle 1 of 20 m does not fit into the box; allowed: at most 5 m");
  EXPECT_GT(positions("1,1,1,1\n5,5,5,20\n7,7,7,1\n", Sides::open).size(), 1u);
}

// The grid finds what trying all pairs finds: narrow boxes, radii over two decades, far coordinates.
TEST(ParticlePositions, GridAgreesWithAllPairs) {
  std::mt19937 random(11);
  const auto uniform = [&random](double a, double b) { return a + (b - a) * (random() / 4294967296.0); };
  for (int round = 0; round < 300; ++round) {
    const bool periodic = round % 2 == 0;
    BoxSpec b{true, uniform(1.0, 10.0), uniform(1.0, 10.0), 100.0, periodic ? Sides::periodic : Sides::open};
    ParticleFile file;
    ParticleTable& t = file.table;
    const double shift = periodic ? 0.0 : uniform(-1e6, 1e6);
    for (int i = 0; i < 40; ++i) {
      t.id.push_back(i);
      t.x.push_back(uniform(0.0, b.width) + shift), t.y.push_back(uniform(0.0, b.depth)),
          t.z.push_back(uniform(1.0, 30.0));
      // What does not fit into a box is refused before overlaps are looked for.
      const double widest = periodic ? 0.5 * std::min(b.width, b.depth) : 10.0;
      t.radius.push_back(std::min(widest, std::pow(10.0, uniform(-1.5, 0.2))));
      file.line.push_back(static_cast<std::size_t>(i) + 2);
    }
    std::size_t expected = 0;
    for (std::size_t i = 0; i < t.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        double dx = t.x[i] - t.x[j], dy = t.y[i] - t.y[j];
        const double dz = t.z[i] - t.z[j];
        if (periodic) dx -= b.width * std::round(dx / b.width), dy -= b.depth * std::round(dy / b.depth);
        expected +=
            t.radius[i] + t.radius[j] - std::sqrt(dx * dx + dy * dy + dz * dz) > std::min(t.radius[i], t.radius[j]);
      }
    }
    const std::vector<std::string> found = check_particle_positions(file, "p.csv", b, false, false);
    EXPECT_EQ(found.size(), std::min<std::size_t>(expected, 21)) << "round " << round;
  }
}

class ParticleFileInCase : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("platen-particle-file-" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  void write(const std::string& bytes) { std::ofstream(folder_ / "p.csv", std::ios::binary) << bytes; }
  std::string errors(const std::string& text, const std::vector<std::string>& overrides = {}) {
    return test::errors_of(text, overrides, folder_.string());
  }
  std::filesystem::path folder_;
  std::string case_ =
      test::replaced("[[stage]]\nkind = \"fill\"\n", "", test::replaced("count = 100", "file = \"p.csv\""));
};

TEST_F(ParticleFileInCase, IsReadRelativeToTheCase) {
  write("x,y,z,vx\n0.01,0.01,0.01,1\n0.01,0.01,0.03,2\n");
  const Case c = parse_case(case_, "case.toml", folder_);
  ASSERT_TRUE(c.particles.table);
  EXPECT_EQ(c.particles.count, 2);
  EXPECT_EQ(c.particles.table->vx[1], 2.0);
  EXPECT_EQ(c.particles.table->radius[0], 2.5e-3);
  EXPECT_EQ(c.particles.sizes.largest(), 2.5e-3);
  EXPECT_EQ(c.particles.file, "p.csv");
}

TEST_F(ParticleFileInCase, RadiusAndDensityFromColumns) {
  write("x,y,z,radius,density\n0.01,0.01,0.01,1e-3,900\n0.01,0.01,0.03,2e-3,800\n");
  const std::string text =
      test::replaced("radius = \"2.5 mm\"\n", "", test::replaced("density = \"2000 kg/m3\"\n", "", case_));
  const Case c = parse_case(text, "case.toml", folder_);
  EXPECT_EQ(c.particles.sizes.largest(), 2e-3);
  EXPECT_EQ(c.particles.sizes.smallest(), 1e-3);
  EXPECT_EQ(c.particles.table->density[0], 900.0);
}

TEST_F(ParticleFileInCase, MissingOrUnreadable) {
  EXPECT_EQ(errors(case_).substr(0, 32), "case.toml:7:8: particles.file: \"");
  EXPECT_NE(errors(case_).find("does not exist"), std::string::npos);
  std::filesystem::create_directory(folder_ / "p.csv");
  EXPECT_NE(errors(case_).find("is not a file"), std::string::npos);
  std::filesystem::remove(folder_ / "p.csv");
  EXPECT_EQ(test::errors_of(case_, {}, folder_.string(), CaseUse::resume), "accepted")
      << "a resumed run needs no particle file";
}

TEST_F(ParticleFileInCase, ErrorsNameFileAndLine) {
  write("x,y,z\n0.01,0.01,0.01\n0.01,0.01\n");
  EXPECT_EQ(errors(case_),
            (folder_ / "p.csv").string() + ":3: 2 cells, but the header has 3; allowed: one cell for each column");
  write("x,y,z\n0.01,0.01,0.09\n");
  EXPECT_EQ(errors(case_).substr(0, (folder_ / "p.csv").string().size() + 3), (folder_ / "p.csv").string() + ":2:");
}

TEST_F(ParticleFileInCase, StandsAlone) {
  write("x,y,z\n0.01,0.01,0.01\n");
  EXPECT_EQ(errors(case_), "accepted");
  EXPECT_EQ(errors(case_, {"particles.count=1"}),
            "--set particles.count=1: particles.count: is given beside file; allowed: leave it out, the file says how "
            "many there are");
  EXPECT_NE(errors(case_, {"particles.sizes={ kind = \"uniform\", min = 1, max = 2 }"})
                .find("particles.sizes: is given beside"),
            std::string::npos);
  EXPECT_EQ(errors(case_ + "[[stage]]\nkind = \"fill\"\n").substr(0, 26), "case.toml:20:8: stage.fill");
}

TEST_F(ParticleFileInCase, NoBoxWithoutPlates) {
  write("x,y,z\n-5,0.01,-3\n");
  const std::string text = R"([particles]
radius = 0.01
density = 1000
file = "p.csv"
[particles.law]
k1 = 1
k2 = 1
[plates]
top = false
bottom = false
[[stage]]
kind = "run"
duration = 1
)";
  EXPECT_EQ(parse_case(text, "case.toml", folder_).box.sides, Sides::open);
  EXPECT_FALSE(parse_case(text, "case.toml", folder_).box.given);
  EXPECT_EQ(errors(text + "[box]\nsides = \"open\"\n"), "accepted");
}

}  // namespace
}  // namespace platen
