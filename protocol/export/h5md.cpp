// H5MD 1.1 (www.nongnu.org/h5md): time-dependent data are groups of step, time and value.
#include "protocol/export/formats.h"
#include "protocol/output/hdf5_file.h"

namespace platen {

std::vector<std::string> export_h5md(const RunStates& run, const std::filesystem::path& folder) {
  const std::size_t n = run.stages.front().particles.size(), frames = run.stages.size();
  std::vector<std::int64_t> steps;
  std::vector<double> times, edges, position, velocity, spin;
  std::vector<std::int32_t> image;
  // Boundaries hold for the whole file. Where sides opened on the way there are none, and spheres stand where their ways led them.
  bool periodic = run.periodic;
  for (const StageState& s : run.stages) periodic = periodic && !s.sides_open;
  for (const StageState& s : run.stages) {
    steps.push_back(s.step), times.push_back(s.time);
    edges.insert(edges.end(), {run.width, run.depth, s.z_top - s.z_bottom});
    const ParticleFields& p = s.particles;
    for (std::size_t k = 0; k < n; ++k) {
      const double boxes[2] = {periodic ? 0.0 : p.image[2 * k] * run.width, periodic ? 0.0 : p.image[2 * k + 1] * run.depth};
      position.insert(position.end(), {p.position[3 * k] + boxes[0], p.position[3 * k + 1] + boxes[1], p.position[3 * k + 2]});
    }
    velocity.insert(velocity.end(), p.velocity.begin(), p.velocity.end());
    spin.insert(spin.end(), p.angular_velocity.begin(), p.angular_velocity.end());
    for (std::size_t k = 0; k < n; ++k) image.insert(image.end(), {p.image[2 * k], p.image[2 * k + 1], 0});
  }
  Hdf5File file = Hdf5File::create(folder / "stages.h5md");
  {
    Hdf5Group root = file.root();
    Hdf5Group h5md = root.create_group("h5md");
    h5md.attribute("version", std::vector<std::int64_t>{1, 1});
    h5md.create_group("author").attribute("name", "unknown");
    Hdf5Group creator = h5md.create_group("creator");
    creator.attribute("name", "platen"), creator.attribute("version", PLATEN_VERSION);
    Hdf5Group all = root.create_group("particles").create_group("all");
    const auto over_time = [&](Hdf5Group& parent, const char* name, const auto& values, const std::vector<std::uint64_t>& shape, const Hdf5Meaning& meaning) {
      Hdf5Group group = parent.create_group(name);
      group.write("step", steps, 1, {"-", "time steps since the run began"});
      group.write("time", times, 1, {"s", "simulated time"});
      group.write_shaped("value", values, shape, meaning);
    };
    Hdf5Group box = all.create_group("box");
    box.attribute("dimension", std::int64_t{3});
    box.attribute("boundary", std::vector<std::string>{periodic ? "periodic" : "none", periodic ? "periodic" : "none", "none"});
    over_time(box, "edges", edges, {frames, 3}, {"m", "lengths of the box"});
    over_time(all, "position", position, {frames, n, 3}, {"m", periodic ? "centres, wrapped into the box" : "centres"});
    if (periodic) over_time(all, "image", image, {frames, n, 3}, {"-", "box lengths left behind"});
    over_time(all, "velocity", velocity, {frames, n, 3}, {"m/s", "velocity"});
    over_time(all, "angular_velocity", spin, {frames, n, 3}, {"rad/s", "angular velocity"});
    all.write("id", run.stages.front().particles.id, 1, {"-", "particle number"});
    all.write("radius", run.stages.front().particles.radius, 1, {"m", "radius"});
  }
  file.close();
  return {"stages.h5md"};
}

}  // namespace platen
