#include "protocol/export/run_states.h"

#include <algorithm>

#include "core/particles.h"
#include "protocol/case_file.h"
#include "protocol/output/hdf5_file.h"
#include "protocol/output/results_h5.h"

namespace platen {

namespace fs = std::filesystem;

RunStates run_states(const fs::path& folder) {
  if (!fs::exists(folder / "case.toml")) throw OutputError(folder.string() + ": is not a run folder");
  if (!fs::exists(folder / "results.h5")) throw OutputError(folder.string() + ": has no results.h5 yet: no stage has ended");
  const Case c = read_case(folder / "case.toml", {}, CaseUse::resume);
  RunStates run;
  run.title = c.title;
  run.width = c.box.width, run.depth = c.box.depth, run.periodic = c.box.sides == Sides::periodic;
  const Hdf5File file = Hdf5File::open(folder / "results.h5");
  const Hdf5Group root = file.root(), stages = root.group("stages");
  bool open = false;
  for (const StageSpec& spec : c.stages) {
    open = open || spec.kind == StageKind::release;
    const std::string name = stage_group_name(spec.name);
    if (!stages.has(name) || !stages.group(name).has("particles")) continue;
    const Hdf5Group group = stages.group(name), particles = group.group("particles");
    StageState s;
    s.name = spec.name, s.sides_open = open;
    s.step = group.integer_attribute(".", "last_step", 0);
    s.time = group.real_attribute(".", "time_end", 0.0);
    s.z_bottom = group.real_attribute(".", "z_bottom", 0.0), s.z_top = group.real_attribute(".", "z_top", 0.0);
    s.particles.id = particles.read<std::int64_t>("id");
    s.particles.position = particles.read<double>("position"), s.particles.image = particles.read<std::int32_t>("image");
    s.particles.velocity = particles.read<double>("velocity"), s.particles.angular_velocity = particles.read<double>("angular_velocity");
    s.particles.radius = particles.read<double>("radius");
    if (c.particles.file.empty()) {
      s.density.assign(s.particles.size(), c.particles.density);
    } else if (particles.has("mass")) {
      s.particles.mass = particles.read<double>("mass");
      for (std::size_t k = 0; k < s.particles.size(); ++k) s.density.push_back(s.particles.mass[k] / sphere_mass(s.particles.radius[k], 1.0));
    }
    run.stages.push_back(std::move(s));
  }
  if (run.stages.empty()) throw OutputError(folder.string() + ": no stage has ended");
  if (root.has("contacts")) {
    const Hdf5Group group = root.group("contacts");
    ContactFields& k = run.contacts;
    k.pair = group.read<std::int64_t>("pair"), k.image = group.read<std::int32_t>("image");
    k.overlap = group.read<double>("overlap"), k.plastic_overlap = group.read<double>("plastic_overlap");
    k.normal_force = group.read<double>("normal_force"), k.damping_force = group.read<double>("damping_force");
    k.tangential_force = group.read<double>("tangential_force"), k.branch = group.read<std::int8_t>("branch");
  }
  return run;
}

}  // namespace platen
