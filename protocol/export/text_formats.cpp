// CSV, VTK's XML, LAMMPS.
#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "protocol/export/formats.h"
#include "protocol/output/files.h"
#include "protocol/output/results_h5.h"

namespace platen {

namespace fs = std::filesystem;

namespace {

using Text = fmt::memory_buffer;

template <class... T>
void add(Text& text, fmt::format_string<T...> form, T&&... values) {
  fmt::format_to(std::back_inserter(text), form, std::forward<T>(values)...);
}

void write(const fs::path& path, const Text& text) { write_whole_file(path, std::string_view(text.data(), text.size())); }

// "3-compress": in the order of the run, and a name that is no path.
std::string file_name(const RunStates& run, std::size_t stage) { return fmt::format("{}-{}", stage + 1, stage_group_name(run.stages[stage].name)); }

const char* const axes[3] = {"x", "y", "z"};

}  // namespace

std::vector<std::string> export_csv(const RunStates& run, const fs::path& folder) {
  std::vector<std::string> names;
  for (std::size_t s = 0; s < run.stages.size(); ++s) {
    const ParticleFields& p = run.stages[s].particles;
    Text text;
    const std::vector<double>& density = run.stages[s].density;
    add(text, "id,x,y,z,radius{},vx,vy,vz,wx,wy,wz\n", density.empty() ? "" : ",density");
    for (std::size_t k = 0; k < p.size(); ++k) {
      add(text, "{}", p.id[k]);
      for (std::size_t axis = 0; axis < 3; ++axis) add(text, ",{:.17g}", p.position[3 * k + axis]);
      add(text, ",{:.17g}", p.radius[k]);
      if (!density.empty()) add(text, ",{:.17g}", density[k]);
      for (std::size_t axis = 0; axis < 3; ++axis) add(text, ",{:.17g}", p.velocity[3 * k + axis]);
      for (std::size_t axis = 0; axis < 3; ++axis) add(text, ",{:.17g}", p.angular_velocity[3 * k + axis]);
      add(text, "\n");
    }
    names.push_back(file_name(run, s) + ".csv");
    write(folder / names.back(), text);
  }
  const ContactFields& c = run.contacts;
  fs::remove(folder / "contacts.csv");  // of an older export
  if (c.size() == 0) return names;
  Text text;
  add(text, "id_1,id_2,image_x,image_y,overlap,plastic_overlap,normal_force,damping_force,tangential_x,tangential_y,tangential_z,branch\n");
  for (std::size_t k = 0; k < c.size(); ++k)
    add(text, "{},{},{},{},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{}\n", c.pair[2 * k], c.pair[2 * k + 1], c.image[2 * k], c.image[2 * k + 1], c.overlap[k], c.plastic_overlap[k],
        c.normal_force[k], c.damping_force[k], c.tangential_force[3 * k], c.tangential_force[3 * k + 1], c.tangential_force[3 * k + 2], static_cast<int>(c.branch[k]));
  names.push_back("contacts.csv");
  write(folder / names.back(), text);
  return names;
}

std::vector<std::string> export_vtu(const RunStates& run, const fs::path& folder) {
  std::vector<std::string> names;
  Text list;
  add(list, "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n");
  for (std::size_t s = 0; s < run.stages.size(); ++s) {
    const ParticleFields& p = run.stages[s].particles;
    const std::size_t n = p.size();
    Text text;
    const auto array = [&](const char* name, const char* type, int columns, const auto& value) {
      add(text, "<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"ascii\">\n", type, name, columns);
      for (std::size_t k = 0; k < n * static_cast<std::size_t>(columns); ++k) add(text, "{}{}", value(k), (k + 1) % static_cast<std::size_t>(columns) == 0 ? "\n" : " ");
      add(text, "</DataArray>\n");
    };
    const auto of = [](const std::vector<double>& list_of) { return [&list_of](std::size_t k) { return fmt::format("{:.17g}", list_of[k]); }; };
    add(text, "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"0.1\" byte_order=\"LittleEndian\">\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n<Points>\n", n, n);
    array("position", "Float64", 3, of(p.position));
    add(text, "</Points>\n<Cells>\n");
    array("connectivity", "Int64", 1, [](std::size_t k) { return k; });
    array("offsets", "Int64", 1, [](std::size_t k) { return k + 1; });
    array("types", "UInt8", 1, [](std::size_t) { return 1; });  // a vertex
    add(text, "</Cells>\n<PointData>\n");
    array("id", "Int64", 1, [&](std::size_t k) { return p.id[k]; });
    array("radius", "Float64", 1, of(p.radius));
    array("velocity", "Float64", 3, of(p.velocity));
    array("angular_velocity", "Float64", 3, of(p.angular_velocity));
    add(text, "</PointData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n");
    names.push_back(file_name(run, s) + ".vtu");
    write(folder / names.back(), text);
    std::string safe;  // the names of stages are the user's
    for (const char c : names.back()) c == '&' ? safe += "&amp;" : c == '<' ? safe += "&lt;" : c == '"' ? safe += "&quot;" : safe += c;
    add(list, "<DataSet timestep=\"{:.17g}\" file=\"{}\"/>\n", run.stages[s].time, safe);
  }
  add(list, "</Collection>\n</VTKFile>\n");
  names.push_back("stages.pvd");
  write(folder / names.back(), list);
  return names;
}

std::vector<std::string> export_lammps(const RunStates& run, const fs::path& folder) {
  // A box that holds everything where the case's own does not.
  struct Span {
    double low, high;
  };
  const auto box = [&](const StageState& s, Span (&span)[3]) {
    const double given[2] = {run.width, run.depth};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      span[axis] = axis < 2 ? Span{0.0, given[axis]} : Span{s.z_bottom, s.z_top};
      if (axis < 2 && run.periodic && !s.sides_open) continue;
      for (std::size_t k = 0; k < s.particles.size(); ++k)
        span[axis].low = std::min(span[axis].low, s.particles.position[3 * k + axis] - s.particles.radius[k]), span[axis].high = std::max(span[axis].high, s.particles.position[3 * k + axis] + s.particles.radius[k]);
    }
  };
  Text text;
  for (const StageState& s : run.stages) {
    Span span[3];
    box(s, span);
    const char* sides = run.periodic && !s.sides_open ? "pp pp ff" : "ff ff ff";
    add(text, "ITEM: TIMESTEP\n{}\nITEM: NUMBER OF ATOMS\n{}\nITEM: BOX BOUNDS {}\n", s.step, s.particles.size(), sides);
    for (const Span& one : span) add(text, "{:.17g} {:.17g}\n", one.low, one.high);
    add(text, "ITEM: ATOMS id type x y z ix iy radius vx vy vz omegax omegay omegaz\n");
    const ParticleFields& p = s.particles;
    for (std::size_t k = 0; k < p.size(); ++k) {
      add(text, "{} 1 {:.17g} {:.17g} {:.17g} {} {} {:.17g}", p.id[k] + 1, p.position[3 * k], p.position[3 * k + 1], p.position[3 * k + 2], s.sides_open ? 0 : p.image[2 * k], s.sides_open ? 0 : p.image[2 * k + 1], p.radius[k]);
      for (const auto* column : {&p.velocity, &p.angular_velocity})
        for (std::size_t axis = 0; axis < 3; ++axis) add(text, " {:.17g}", (*column)[3 * k + axis]);
      add(text, "\n");
    }
  }
  std::vector<std::string> names = {"stages.dump"};
  write(folder / names.back(), text);
  fs::remove(folder / "last.data");  // of an older export
  const StageState& s = run.stages.back();
  if (s.density.empty()) return names;
  const ParticleFields& p = s.particles;
  Span span[3];
  box(s, span);
  Text data;
  add(data, "platen: the end of stage {}, SI units, ids from 1\n\n{} atoms\n1 atom types\n\n", stage_group_name(s.name), p.size());
  for (std::size_t axis = 0; axis < 3; ++axis) add(data, "{:.17g} {:.17g} {}lo {}hi\n", span[axis].low, span[axis].high, axes[axis], axes[axis]);
  add(data, "\nAtoms # sphere\n\n");
  for (std::size_t k = 0; k < p.size(); ++k)
    add(data, "{} 1 {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}\n", p.id[k] + 1, 2.0 * p.radius[k], s.density[k], p.position[3 * k], p.position[3 * k + 1], p.position[3 * k + 2]);
  add(data, "\nVelocities\n\n");
  for (std::size_t k = 0; k < p.size(); ++k) {
    add(data, "{}", p.id[k] + 1);
    for (const auto* column : {&p.velocity, &p.angular_velocity})
      for (std::size_t axis = 0; axis < 3; ++axis) add(data, " {:.17g}", (*column)[3 * k + axis]);
    add(data, "\n");
  }
  names.push_back("last.data");
  write(folder / names.back(), data);
  return names;
}

}  // namespace platen
