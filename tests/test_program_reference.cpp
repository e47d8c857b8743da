// The worked examples of tests/data through the program itself: case file in, standard output and run folder out.
#include "program.h"
#include "reference_data.h"
#include "results_reader.h"

namespace platen::test {
namespace {

using reference::Bed;
using reference::Body;
using reference::close;
using reference::Json;
using reference::Record;
using reference::Vec3;

std::string line(const std::string& key, double value) { return key + " = " + exact(value) + "\n"; }

// Plain numbers are SI, so that no digit is lost between the record and the program.
std::string law_table(const Json& law) {
  const double k1 = law.at("k1");
  return "[particles.law]\n" + line("k1", k1) + line("k2", law.at("k2")) + line("k_adh", law.at("kadh")) +
         line("f0", law.at("f0")) + line("exponent", law.at("n")) +
         line("tangential_ratio", law.at("kt").get<double>() / k1) + line("restitution", law.at("e")) +
         line("friction", law.at("mu")) + line("rolling_friction", law.at("mu_r"));
}

std::string plate_table(bool top, const Json& plate, double mu_r) {
  return std::string("[plates]\ntop = ") + (top ? "true" : "false") + "\nbottom = true\n" +
         line("particle_young_modulus", plate.at("E").at(0)) + line("young_modulus", plate.at("E").at(1)) +
         line("particle_poisson_ratio", plate.at("nu").at(0)) + line("poisson_ratio", plate.at("nu").at(1)) +
         line("restitution", plate.at("e")) + line("friction", plate.at("mu")) + line("rolling_friction", mu_r);
}

std::string box_table(double width, double depth, double height, const std::string& sides) {
  return "[box]\n" + line("width", width) + line("depth", depth) + line("height", height) + "sides = \"" + sides +
         "\"\n";
}

// Everything else that a run needs; the stage ends at round(duration/step) steps.
std::string run_tables(double gravity, double step, double series, const std::string& stage) {
  return "[environment]\n" + line("gravity", gravity) + "[time]\n" + line("step", step) + "[output]\n" +
         line("series", series) + "frames = \"off\"\n[[stage]]\n" + stage;
}

std::string particles_table(double density) {
  return "[case]\ntitle = \"worked example\"\nseed = 1\n[particles]\nfile = \"particles.csv\"\n" +
         line("density", density);
}

// Velocities are those at t = 0. The rows come last sphere first: only `id` says which is which.
std::string particle_file(const std::vector<Body>& spheres) {
  std::string text = "id,x,y,z,radius,vx,vy,vz,wx,wy,wz\n";
  for (std::size_t k = spheres.size(); k-- > 0;) {
    const Body& b = spheres[k];
    text += std::to_string(k);
    for (double value : {b.x.x, b.x.y, b.x.z, b.R, b.v.x, b.v.y, b.v.z, b.w.x, b.w.y, b.w.z})
      text += "," + exact(value);
    text += "\n";
  }
  return text;
}

struct RunOutcome {
  ProgramResult program;
  std::vector<Vec3> x, v, w;  // at the end, by id
  CsvTable series;
};

std::vector<Vec3> vectors(const Dataset<double>& data) {
  std::vector<Vec3> list;
  for (std::size_t k = 0; k < data.rows(); ++k) list.push_back({data.at(k, 0), data.at(k, 1), data.at(k, 2)});
  return list;
}

// Runs a case in `folder`; fails the test (and returns without particles) unless the program ends with 0.
RunOutcome run_case(const TemporaryFolder& folder, const std::string& name, const std::string& text,
                    const std::vector<Body>& spheres) {
  write_file(folder / (name + ".toml"), text);
  write_file(folder / "particles.csv", particle_file(spheres));
  RunOutcome outcome;
  outcome.program = run_program({"run", name + ".toml", "-o", name, "--threads", "1"}, {.folder = folder.path()});
  EXPECT_EQ(outcome.program.exit_code, 0) << outcome.program.report() << text;
  if (outcome.program.exit_code != 0) return outcome;
  const ResultsFile results(folder / (name + "/results.h5"));
  const auto id = results.integers("/particles/id");
  EXPECT_EQ(id.rows(), spheres.size());
  for (std::size_t k = 0; k < id.rows(); ++k) EXPECT_EQ(id.at(k), static_cast<std::int64_t>(k));
  outcome.x = vectors(results.doubles("/particles/position"));
  outcome.v = vectors(results.doubles("/particles/velocity"));
  outcome.w = vectors(results.doubles("/particles/angular_velocity"));
  outcome.series = read_csv(folder / (name + "/series.csv"));
  EXPECT_EQ(outcome.x.size(), spheres.size());
  EXPECT_GE(outcome.series.rows.size(), 2u);
  return outcome;
}

// The contact must be there in the last sample before `end` and gone in the first after it.
void expect_contact_ends(const CsvTable& series, const std::string& count, double end, double tolerance) {
  bool seen_before = false, seen_after = false;
  for (std::size_t k = 0; k < series.rows.size(); ++k) {
    const double t = series.number(k, "time"), contacts = series.number(k, count);
    if (t > 0.02 * end && t < end - tolerance) {
      EXPECT_EQ(contacts, 1.0) << "at " << t;
      seen_before = true;
    } else if (t > end + tolerance) {
      EXPECT_EQ(contacts, 0.0) << "at " << t;
      seen_after = true;
    }
  }
  EXPECT_TRUE(seen_before);
  EXPECT_TRUE(seen_after);
}

TEST(ProgramReference, NormalHistory) {
  for (const Record& r : reference::read_records("normal_history")) {
    SCOPED_TRACE(r.id);
    const TemporaryFolder folder;
    const auto delta = r.inputs.at("delta").get<std::vector<double>>();
    std::string overlaps;
    for (double d : delta) overlaps += exact(d) + "\n";
    write_file(folder / "case.toml", law_table(r.inputs.at("law")));
    write_file(folder / "overlaps.txt", overlaps);
    const ProgramResult result =
        run_program({"law", "case.toml", "--overlap", "overlaps.txt"}, {.folder = folder.path()});
    ASSERT_EQ(result.exit_code, 0) << result.report();
    const CsvTable table = parse_csv(result.out);
    ASSERT_EQ(table.rows.size(), delta.size());

    // The reference says which points lie on two branches at once; those may be called by either name.
    const reference::EepaLaw law = reference::eepa_law(r.inputs.at("law"));
    reference::EepaContact contact;
    int named = 0;
    for (std::size_t k = 0; k < delta.size(); ++k) {
      const auto expected = [&](const char* key) { return r.expected.at(key).at(k).get<double>(); };
      EXPECT_EQ(table.number(k, "overlap"), delta[k]);
      EXPECT_TRUE(close(table.number(k, "f_hys"), expected("f_hys"), r.rel, r.abs)) << "f_hys, point " << k;
      EXPECT_TRUE(close(table.number(k, "plastic_overlap"), expected("delta_p"), r.rel, r.abs)) << "point " << k;
      EXPECT_TRUE(close(table.number(k, "friction_limit"), expected("coulomb_limit"), r.rel, r.abs)) << "limit " << k;
      const reference::EepaNormal here = reference::eepa_normal(law, contact, delta[k]);
      const double tie = 1e-9 * law.k2 * std::pow(std::abs(delta[k]), law.n);
      if (std::abs(here.loading_margin) < tie || std::abs(here.adhesive_margin) < tie) continue;
      EXPECT_EQ(table.cell(k, "branch"), r.expected.at("branch").at(k).get<std::string>()) << "point " << k;
      ++named;
    }
    EXPECT_GT(named, static_cast<int>(delta.size()) * 3 / 4);
  }
}

// Two spheres in open space, from just touching until a little after they part.
RunOutcome run_pair(const TemporaryFolder& folder, const Record& r, double duration) {
  const Bed bed = reference::two_spheres(r);
  const Body& b = bed.spheres.front();
  const double dt = r.inputs.at("dt_suggested");
  return run_case(folder, r.id,
                  particles_table(reference::density_of(b.R, b.m)) + law_table(r.inputs.at("law")) +
                      "[plates]\ntop = false\nbottom = false\n" +  // no [box]: the sides are open
                      run_tables(0.0, dt, duration / 200.0, "kind = \"run\"\n" + line("duration", duration)),
                  bed.spheres);
}

TEST(ProgramReference, HeadOn) {
  for (const Record& r : reference::read_records("head_on")) {
    SCOPED_TRACE(r.id);
    ASSERT_TRUE(r.expected.at("separated").get<bool>());
    const TemporaryFolder folder;
    const double t_contact = r.expected.at("t_contact");
    const RunOutcome end = run_pair(folder, r, 1.05 * t_contact);
    ASSERT_EQ(end.v.size(), 2u);
    EXPECT_TRUE(meets(r, "restitution", (end.v[0].x - end.v[1].x) / r.inputs.at("v_relative").get<double>()));
    const double dt = r.inputs.at("dt_suggested");
    expect_contact_ends(end.series, "contacts", t_contact, r.rel * t_contact + 2.0 * dt);
  }
}

TEST(ProgramReference, ObliquePair) {
  for (const Record& r : reference::read_records("oblique_pair")) {
    SCOPED_TRACE(r.id);
    const TemporaryFolder folder;
    const double t_contact = r.expected.at("t_contact");
    const RunOutcome end = run_pair(folder, r, 1.02 * t_contact);
    ASSERT_EQ(end.v.size(), 2u);
    EXPECT_TRUE(meets(r, "v_i", std::vector<double>{end.v[0].x, end.v[0].y}));
    EXPECT_TRUE(meets(r, "v_j", std::vector<double>{end.v[1].x, end.v[1].y}));
    EXPECT_TRUE(meets(r, "w_i", end.w[0].z));
    EXPECT_TRUE(meets(r, "w_j", end.w[1].z));
    for (int k : {0, 1}) EXPECT_EQ(std::abs(end.v[k].z) + std::abs(end.w[k].x) + std::abs(end.w[k].y), 0.0);
    expect_contact_ends(end.series, "contacts", t_contact, r.rel * t_contact);
  }
}

TEST(ProgramReference, ObliquePairInThreeDimensions) {
  for (const Record& r : reference::read_records("oblique_pair_3d")) {
    SCOPED_TRACE(r.id);
    const TemporaryFolder folder;
    const RunOutcome end = run_pair(folder, r, r.inputs.at("t_end"));
    ASSERT_EQ(end.v.size(), 2u);
    EXPECT_TRUE(meets(r, "v_i", end.v[0]));
    EXPECT_TRUE(meets(r, "v_j", end.v[1]));
    EXPECT_TRUE(meets(r, "w_i", end.w[0]));
    EXPECT_TRUE(meets(r, "w_j", end.w[1]));
  }
}

TEST(ProgramReference, SpherePlate) {
  for (const Record& r : reference::read_records("sphere_plate")) {
    SCOPED_TRACE(r.id);
    const TemporaryFolder folder;
    const Json& in = r.inputs;
    const double R = in.at("R"), dt = in.at("dt_suggested"), t_contact = r.expected.at("t_contact");
    Bed bed;
    // The slip of the contact point is v_t + w (R - delta): a positive w turns about -y.
    bed.add({0.01, 0.01, R}, {in.at("v_t"), 0, -in.at("v_n").get<double>()}, {0, -in.at("w").get<double>(), 0}, R,
            in.at("density"));
    const RunOutcome end = run_case(
        folder, r.id,
        particles_table(in.at("density")) +
            // No pair ever meets; the law must be there all the same.
            "[particles.law]\nk1 = 5e3\nk2 = 5e3\nk_adh = 0\nf0 = 0\nrestitution = 0.4\nfriction = 0.5\n"
            "rolling_friction = 0\n" +
            plate_table(false, in, 0.0) + box_table(0.02, 0.02, 0.05, "open") +
            run_tables(0.0, dt, t_contact / 50.0, "kind = \"run\"\n" + line("duration", 1.02 * t_contact)),
        bed.spheres);
    ASSERT_EQ(end.v.size(), 1u);
    EXPECT_TRUE(meets(r, "v_n", end.v[0].z));
    EXPECT_TRUE(meets(r, "v_t", end.v[0].x));
    EXPECT_TRUE(meets(r, "w", -end.w[0].y));
    // Free flight after the contact: the position tells when it ended.
    const double steps = std::round(1.02 * t_contact / dt), ended = steps * dt - (end.x[0].z - R) / end.v[0].z;
    EXPECT_TRUE(meets(r, "t_contact", ended));
  }
}

TEST(ProgramReference, ManyBody) {
  for (const Record& r : reference::read_records("many_body")) {
    const Json& in = r.inputs;
    const double Lx = in.at("Lx"), Ly = in.at("Ly"), dt = in.at("dt");
    Bed bed = reference::many_spheres(r);
    const std::vector<Body> at_start = bed.spheres;
    bed.start();
    int compared = 0;
    for (const Json& s : r.expected.at("snapshots")) {
      const double t = s.at("t");
      SCOPED_TRACE(r.id + ", t = " + std::to_string(t));
      const TemporaryFolder folder;
      const std::string stage = "kind = \"compress\"\n" + line("speed", in.at("plate_speed_down")) +
                                "until = { duration = " + exact(t) + " }\n";
      const RunOutcome end =
          run_case(folder, r.id,
                   particles_table(in.at("density")) + law_table(in.at("law")) +
                       plate_table(true, in.at("plate"), in.at("law").at("mu_r")) +
                       box_table(Lx, Ly, in.at("z_top"), "periodic") + run_tables(in.at("g"), dt, 1e-3, stage),
                   at_start);
      ASSERT_EQ(end.x.size(), at_start.size());
      const std::size_t last = end.series.rows.size() - 1;
      EXPECT_EQ(end.series.number(last, "step"), std::round(t / dt));
      const double area = Lx * Ly;
      EXPECT_NEAR(end.series.number(last, "stress_top") * area, s.at("F_top").get<double>(),
                  s.at("tol_F_top").get<double>());
      EXPECT_NEAR(end.series.number(last, "stress_bottom") * area, s.at("F_bottom").get<double>(),
                  s.at("tol_F_bottom").get<double>());
      if (s.at("tol_x").get<double>() >= 1e-5) continue;  // chaos has taken over
      ++compared;
      const auto x_expected = reference::vec3_list(s.at("x")), v_expected = reference::vec3_list(s.at("v"));
      EXPECT_LE(reference::largest_difference(end.x, x_expected, Lx, Ly), s.at("tol_x").get<double>());
      EXPECT_LE(reference::largest_difference(end.v, v_expected), s.at("tol_v").get<double>());
      EXPECT_EQ(end.series.number(last, "contacts"), s.at("contacts_pp").get<double>());

      // The reference bed keeps the same time conventions, so here only rounding differs: forces to 1e-12 N or better,
      // hence far below these bounds until chaos has amplified it.
      while (bed.step < std::lround(t / dt)) bed.advance(dt);
      std::vector<Vec3> x, v, w;
      for (std::size_t i = 0; i < bed.spheres.size(); ++i) {
        x.push_back(bed.spheres[i].x);
        v.push_back(bed.velocity(i));
        w.push_back(bed.spin(i));
      }
      EXPECT_LE(reference::largest_difference(end.x, x, Lx, Ly), 1e-9);
      EXPECT_LE(reference::largest_difference(end.v, v), 1e-6);
      EXPECT_LE(reference::largest_difference(end.w, w), 1e-3);
    }
    EXPECT_GE(compared, 2);
  }
}

}  // namespace
}  // namespace platen::test
