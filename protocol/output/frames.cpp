#include "protocol/output/frames.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <unordered_map>

#include "protocol/output/files.h"
#include "protocol/output/hdf5_file.h"

namespace platen {

namespace fs = std::filesystem;

namespace {

constexpr std::uint8_t vtk_vertex = 1, vtk_line = 3;  // types of cells

using Json = nlohmann::ordered_json;

}  // namespace

void write_frame(const fs::path& path, const Snapshot& s, bool contacts, double width, double depth) {
  const ParticleFields& p = s.particles;
  const ContactFields& c = s.contacts;
  const std::size_t n = p.size(), m = contacts ? c.size() : 0;
  std::unordered_map<std::int64_t, std::int64_t> row;
  for (std::size_t k = 0; k < n; ++k) row[p.id[k]] = static_cast<std::int64_t>(k);

  std::vector<double> points = p.position, radius = p.radius, velocity = p.velocity, spin = p.angular_velocity, touching(n, 0.0);
  std::vector<std::int64_t> id = p.id, connectivity, offsets = {0};
  std::vector<std::uint8_t> types(n, vtk_vertex);
  for (std::size_t k = 0; k < n; ++k) connectivity.push_back(static_cast<std::int64_t>(k)), offsets.push_back(static_cast<std::int64_t>(connectivity.size()));
  for (std::size_t k = 0; k < c.size(); ++k)
    for (std::size_t end = 0; end < 2; ++end) touching[static_cast<std::size_t>(row.at(c.pair[2 * k + end]))] += 1.0;
  std::vector<double> overlap(n, 0.0), normal(n, 0.0), tangential(n, 0.0);
  std::vector<std::int32_t> kind(n, 0), branch(n, 0);
  for (std::size_t k = 0; k < m; ++k) {
    std::int64_t second = row.at(c.pair[2 * k + 1]);
    if (c.image[2 * k] != 0 || c.image[2 * k + 1] != 0) {
      const auto from = 3 * static_cast<std::size_t>(second);
      const double x[3] = {points[from] + c.image[2 * k] * width, points[from + 1] + c.image[2 * k + 1] * depth, points[from + 2]};
      second = static_cast<std::int64_t>(id.size());
      points.insert(points.end(), x, x + 3);
      velocity.insert(velocity.end(), 3, 0.0), spin.insert(spin.end(), 3, 0.0);
      radius.push_back(0.0), touching.push_back(0.0), id.push_back(-1);
    }
    connectivity.insert(connectivity.end(), {row.at(c.pair[2 * k]), second});
    offsets.push_back(static_cast<std::int64_t>(connectivity.size()));
    types.push_back(vtk_line);
    kind.push_back(1), branch.push_back(c.branch[k]);
    overlap.push_back(c.overlap[k]), normal.push_back(c.normal_force[k] + c.damping_force[k]);
    tangential.push_back(std::sqrt(c.tangential_force[3 * k] * c.tangential_force[3 * k] + c.tangential_force[3 * k + 1] * c.tangential_force[3 * k + 1] +
                                   c.tangential_force[3 * k + 2] * c.tangential_force[3 * k + 2]));
  }

  Hdf5File file = Hdf5File::create(path);
  {
    Hdf5Group grid = file.root().create_group("VTKHDF");
    grid.attribute("Version", std::vector<std::int64_t>{1, 0});
    grid.ascii_attribute("Type", "UnstructuredGrid");
    const auto whole = [](std::size_t x) { return std::vector<std::int64_t>{static_cast<std::int64_t>(x)}; };
    grid.write("NumberOfPoints", whole(id.size()), 1, {"-", "points"});
    grid.write("NumberOfCells", whole(types.size()), 1, {"-", "spheres, then contacts"});
    grid.write("NumberOfConnectivityIds", whole(connectivity.size()), 1, {"-", "length of Connectivity"});
    grid.write("Points", points, 3, {"m", "centres"});
    grid.write("Offsets", offsets, 1, {"-", "where the points of each cell begin in Connectivity"});
    grid.write("Connectivity", connectivity, 1, {"-", "points of the cells"});
    grid.write("Types", types, 1, {"-", "1 vertex, 3 line"});
    Hdf5Group of_points = grid.create_group("PointData"), of_cells = grid.create_group("CellData");
    of_points.write("id", id, 1, {"-", "particle number; -1: end of a contact through a periodic side"});
    of_points.write("radius", radius, 1, {"m", "radius"});
    of_points.write("velocity", velocity, 3, {"m/s", "velocity"});
    of_points.write("angular_velocity", spin, 3, {"rad/s", "angular velocity"});
    of_points.write("coordination_number", touching, 1, {"-", "spheres that it touches"});
    of_cells.write("contact", kind, 1, {"-", "0 sphere, 1 contact"});
    of_cells.write("overlap", overlap, 1, {"m", "overlap of a contact"});
    of_cells.write("normal_force", normal, 1, {"N", "normal force with damping, positive repels"});
    of_cells.write("tangential_force", tangential, 1, {"N", "size of the tangential force"});
    of_cells.write("branch", branch, 1, {"-", "1 loading, 2 elastic, 3 adhesive"});
  }
  file.close();
}

void write_frame_series(const fs::path& path, const std::vector<Frame>& frames) {
  Json list = Json::array();
  for (const Frame& frame : frames) list.push_back({{"name", frame.name}, {"time", frame.time}});
  write_whole_file(path, Json{{"file-series-version", "1.0"}, {"files", list}}.dump(1) + "\n");
}

}  // namespace platen
