#include "protocol/output/results_h5.h"

#include <unistd.h>

#include <algorithm>
#include <string_view>

#include "protocol/output.h"
#include "protocol/output/hdf5_file.h"

namespace platen {

namespace {

// Strain of every row. Where the zero of a stage is known it holds for the whole stage, also for rows that were logged
// before it was.
std::vector<double> strain_of_rows(const SeriesTable& series, const std::vector<StageResult>& closed) {
  std::vector<double> strain = series.column("strain");
  const std::vector<double>& height = series.column("height");
  for (std::size_t row = 0; row < strain.size(); ++row) {
    const std::string& name = series.stage_names[static_cast<std::size_t>(series.stage[row])];
    const auto stage = std::find_if(closed.begin(), closed.end(), [&](const StageResult& s) { return s.name == name; });
    if (stage != closed.end() && stage->strain_zero_height)
      strain[row] = engineering_strain(*stage->strain_zero_height, height[row]);
  }
  return strain;
}

void write_series(Hdf5Group group, const SeriesTable& series, const std::vector<StageResult>& closed) {
  const auto columns = series_columns();
  for (std::size_t c = 0; c < columns.size(); ++c) {
    const SeriesColumn& column = columns[c];
    const Hdf5Meaning meaning{column.unit, column.description};
    if (column.kind == SeriesColumn::Kind::stage) {
      // Numbers from 1, as on the command line (--set stage.1.speed).
      Hdf5Codes codes;
      for (std::size_t s = 0; s < series.stage_names.size(); ++s)
        if (!series.stage_names[s].empty()) codes.emplace_back(series.stage_names[s], static_cast<int>(s) + 1);
      std::vector<std::int32_t> numbers(series.stage.begin(), series.stage.end());
      for (std::int32_t& number : numbers) ++number;
      // An enumeration needs a name at least.
      if (codes.empty()) group.write<std::int32_t>(column.name, numbers, 1, meaning);
      else group.write_codes(column.name, numbers, codes, meaning);
    } else if (column.kind == SeriesColumn::Kind::count) {
      const std::vector<double>& values = series.columns[c];
      group.write<std::int64_t>(column.name, {values.begin(), values.end()}, 1, meaning);
    } else if (std::string_view(column.name) == "strain") {
      group.write(column.name, strain_of_rows(series, closed), 1, meaning);
    } else {
      group.write(column.name, series.columns[c], 1, meaning);
    }
  }
}

void write_particles(Hdf5Group group, const ParticleFields& p) {
  group.write("id", p.id, 1, {"-", "particle number; rows are sorted by it"});
  group.write("position", p.position, 3, {"m", "centre x, y, z, wrapped into the box"});
  group.write("image", p.image, 2, {"-", "box lengths left behind in x and y"});
  group.write("velocity", p.velocity, 3, {"m/s", "velocity x, y, z at full time"});
  group.write("angular_velocity", p.angular_velocity, 3, {"rad/s", "angular velocity x, y, z at full time"});
  group.write("radius", p.radius, 1, {"m", "radius"});
  group.write("mass", p.mass, 1, {"kg", "mass"});
}

void write_contacts(Hdf5Group group, const ContactFields& c) {
  const Hdf5Codes branches{{"none", static_cast<int>(Branch::none)},
                           {"loading", static_cast<int>(Branch::loading)},
                           {"elastic", static_cast<int>(Branch::elastic)},
                           {"adhesive", static_cast<int>(Branch::adhesive)}};
  group.write("pair", c.pair, 2,
              {"-", "particle numbers, the lower first; the normal points from the second to the first, forces act on "
                    "the first"});
  group.write("image", c.image, 2, {"-", "the second particle stands at its position + image x (width, depth)"});
  group.write("overlap", c.overlap, 1, {"m", "sum of the radii - distance of the centres"});
  group.write("plastic_overlap", c.plastic_overlap, 1, {"m", "overlap at which the elastic branch has no force"});
  group.write("normal_force", c.normal_force, 1, {"N", "hysteretic normal force without damping, positive repels"});
  group.write("damping_force", c.damping_force, 1, {"N", "force of the normal dashpot, positive repels"});
  group.write("tangential_force", c.tangential_force, 3, {"N", "tangential force x, y, z, spring and dashpot"});
  group.write_codes("branch", c.branch, branches, {"-", "branch of the normal force"});
}

void write_plate_contacts(Hdf5Group group, const PlateContactFields& c) {
  const Hdf5Codes plates{{"plate_bottom", plate_bottom}, {"plate_top", plate_top},     {"wall_x_low", wall_x_low},
                         {"wall_x_high", wall_x_high},   {"wall_y_low", wall_y_low}, {"wall_y_high", wall_y_high}};
  group.write("id", c.id, 1, {"-", "particle number"});
  group.write_codes("plate", c.plate, plates, {"-", "plate or wall"});
  group.write("overlap", c.overlap, 1, {"m", "radius - distance of the centre from the plane"});
  group.write("force", c.force, 3, {"N", "force x, y, z on the sphere"});
}

void write_profile(Hdf5Group group, const Profile& p) {
  group.write("z", p.z, 1, {"m", "height of the slab's middle"});
  group.write("porosity", p.porosity, 1, {"-", "1 - volume of sphere parts in the slab / volume of the slab"});
  group.write("coordination_number", p.coordination_number, 1,
              {"-", "mean contacts with other spheres, over spheres whose centre is in the slab; NaN without any"});
}

void describe_stage(Hdf5Group& group, const StageResult& s, std::size_t number, const Snapshot& snapshot) {
  group.attribute("name", s.name);
  group.attribute("number", static_cast<std::int64_t>(number));
  group.attribute("kind", to_string(s.kind));
  group.attribute("end_reason", s.end_reason);
  group.attribute("reached", s.reached);
  group.attribute("first_step", s.first_step);
  group.attribute("last_step", s.last_step);
  group.attribute("steps", s.last_step - s.first_step);
  group.attribute("time_begin", s.time_begin);
  group.attribute("time_end", s.time_end);
  group.attribute("particles", s.particles);
  group.attribute("z_bottom", snapshot.z_bottom);
  group.attribute("z_top", snapshot.z_top);
  if (s.strain_zero_height) group.attribute("strain_zero_height", *s.strain_zero_height);
  if (s.strength) group.attribute("strength", *s.strength);
  if (s.strength_strain) group.attribute("strength_strain", *s.strength_strain);
  if (s.initial_stiffness) group.attribute("initial_stiffness", *s.initial_stiffness);
  if (s.peak_found) group.attribute("peak_found", *s.peak_found);
  std::string warnings;
  for (const std::string& warning : s.warnings) warnings += warning + '\n';
  if (!warnings.empty()) group.attribute("warnings", warnings);
}

void write_bed(Hdf5Group& stage, const BedStress& bed) {
  const auto rows = [](const Tensor& t) {
    std::vector<double> out;
    for (const auto& row : t) out.insert(out.end(), row.begin(), row.end());
    return out;
  };
  stage.write("stress", rows(bed.stress), 3, {"Pa", "mean stress of the bed from its contacts, compression positive"});
  stage.write("fabric", rows(bed.fabric), 3, {"-", "mean of n n over touching pairs"});
}

void write_provenance(Hdf5Group group, const RunInfo& info, const std::string& start_time) {
  char host[256] = "";
  if (::gethostname(host, sizeof host - 1) != 0) host[0] = '\0';
  group.attribute("program", "platen");
  group.attribute("version", PLATEN_VERSION);
  group.attribute("title", info.title);
  group.attribute("seed", info.seed);
  group.attribute("threads", static_cast<std::int64_t>(info.threads));
  group.attribute("instruction_set", info.instruction_set);
  group.attribute("reproducible", static_cast<std::int64_t>(info.reproducible));
  group.attribute("scene", info.scene);
  group.attribute("start_time", start_time);
  group.attribute("host", host);
  group.attribute("compiler", "g++ " __VERSION__);
}

}  // namespace

std::string stage_group_name(const std::string& stage) {
  std::string name = stage;
  std::replace(name.begin(), name.end(), '/', '_');
  return name == "." ? "_" : name;
}

void write_results(const std::filesystem::path& path, const ResultsContent& content) {
  const StageResult& last = content.closed.back();
  const std::string last_name = stage_group_name(last.name);
  Hdf5File file = Hdf5File::create(path);
  {
    Hdf5Group root = file.root();
    write_series(root.create_group("series"), content.series, content.closed);
    Hdf5Group stages = root.create_group("stages");
    Hdf5Group profiles = root.create_group("profiles");
    // States of earlier stages are not kept in memory: a million particles would take 100 MB a stage.
    if (content.closed.size() > 1) {
      const Hdf5File present = Hdf5File::open(path);
      const Hdf5Group old_stages = present.root().group("stages");
      const Hdf5Group old_profiles = present.root().group("profiles");
      for (std::size_t s = 0; s + 1 < content.closed.size(); ++s) {
        const std::string name = stage_group_name(content.closed[s].name);
        stages.copy_from(old_stages, name);
        profiles.copy_from(old_profiles, name);
      }
    }
    Hdf5Group stage = stages.create_group(last_name);
    describe_stage(stage, last, content.closed.size(), content.snapshot);
    write_particles(stage.create_group("particles"), content.snapshot.particles);
    if (last.bed) write_bed(stage, *last.bed);
    write_profile(profiles.create_group(last_name), content.profile);

    // The final state under its short name is the last stage's, not a copy.
    root.link(stage.group("particles"), "particles");
    if (content.info.contacts) {
      write_contacts(root.create_group("contacts"), content.snapshot.contacts);
      write_plate_contacts(root.create_group("plate_contacts"), content.snapshot.plate_contacts);
    }
    root.write_text("case", content.case_text, {"-", "the exact case (TOML) with overrides applied"});
    write_provenance(root.create_group("provenance"), content.info, content.start_time);
  }
  file.close();
}

std::string start_time_of(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) return {};
  return Hdf5File::open(path).root().text_attribute("provenance", "start_time");
}

}  // namespace platen
