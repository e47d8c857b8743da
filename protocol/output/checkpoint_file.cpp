#include "protocol/output/checkpoint_file.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>

#include "protocol/output/files.h"
#include "protocol/output/hdf5_file.h"

namespace platen {

namespace fs = std::filesystem;

namespace {

constexpr const char* newest = "checkpoint.h5";
constexpr const char* former = "checkpoint.prev.h5";
constexpr const char *unnamed = "checkpoint.new", *content = "checkpoint.body";  // while one is written
constexpr std::int64_t format = 2;
constexpr std::size_t plate_columns = 5 + record_size, plane_columns = 7;

std::string last_line(std::string_view bytes) { return fmt::format("platen checkpoint, xxh3 {:016x}\n", XXH3_64bits(bytes.data(), bytes.size())); }

// 128 bits as two rows of a dataset of whole numbers.
void put(std::vector<std::int64_t>& list, Int128 x) {
  list.push_back(static_cast<std::int64_t>(x >> 64));
  list.push_back(static_cast<std::int64_t>(static_cast<std::uint64_t>(x)));
}

Int128 wide(const std::vector<std::int64_t>& list, std::size_t k) {
  return (static_cast<Int128>(list[2 * k]) << 64) | static_cast<Int128>(static_cast<std::uint64_t>(list[2 * k + 1]));
}

void write_content(const fs::path& path, const Checkpoint& c) {
  const SimulationState& s = c.bed;
  Hdf5File file = Hdf5File::create(path);
  {
    Hdf5Group root = file.root();
    root.attribute("format", format);
    root.attribute("version", PLATEN_VERSION);
    root.attribute("instruction_set", c.instruction_set);
    root.attribute("reproducible", static_cast<std::int64_t>(c.reproducible));
    root.attribute("start_time", c.start_time);
    root.write_text("case", c.case_text, {"-", "the case (TOML)"});
    root.write_text("experiment", c.experiment, {"-", "where the stages stand, JSON"});

    Hdf5Group spheres = root.create_group("spheres");
    spheres.write("id", s.id, 1, {"-", "particle number; rows are sorted by it"});
    spheres.write("radius", s.radius, 1, {"m", "radius"});
    spheres.write("density", c.density, 1, {"kg/m3", "density; one number where all are equal"});
    spheres.write("position", s.position, 3, {"m", "centre x, y, z, wrapped into the box"});
    spheres.write("velocity", s.velocity, 3, {"m/s", "velocity x, y, z half a step ago"});
    spheres.write("turning", s.turning, 3, {"m/s", "radius x angular velocity half a step ago"});
    spheres.write("image", s.image, 2, {"-", "box lengths left behind in x and y"});
    spheres.write("sums", s.sums, record_size, {"N", "force, rolling strength of pairs, torque / radius, the same of plates"});

    Hdf5Group pairs = root.create_group("pairs");
    std::vector<std::int32_t> ranks;
    std::vector<double> numbers;
    for (const PairHistory& h : s.pairs) ranks.insert(ranks.end(), {h.low, h.high}), numbers.insert(numbers.end(), {h.sp, h.tx, h.ty, h.tz, h.k_t});
    pairs.write("rank", ranks, 2, {"-", "rows of the two spheres"});
    pairs.write("history", numbers, 5, {"-", "plastic overlap^n [m^n], tangential spring on the first [N], its stiffness [N/m]"});

    Hdf5Group plates = root.create_group("plates");
    ranks.clear(), numbers.clear();
    for (const PlateHistory& h : s.plates) {
      ranks.insert(ranks.end(), {h.rank, h.plate});
      numbers.insert(numbers.end(), {h.xi_x, h.xi_y, h.xi_z, h.stiffness_last, h.overlap});
      numbers.insert(numbers.end(), h.record, h.record + record_size);
    }
    plates.write("rank", ranks, 2, {"-", "row of the sphere, plate or wall"});
    plates.write("history", numbers, plate_columns, {"-", "elongation [m], tangential stiffness [N/m], overlap [m], forces [N]"});

    Hdf5Group planes = root.create_group("planes");
    numbers.clear();
    std::vector<std::int64_t> whole;
    for (const PlaneMotion& p : s.planes) {
      numbers.insert(numbers.end(), {p.origin, p.velocity, p.amplitude, p.frequency, p.vibrated, p.vibration_end, p.dt});
      whole.insert(whole.end(), {p.present ? 1 : 0, p.start});
    }
    planes.write("motion", numbers, plane_columns, {"-", "origin [m], velocity [m/s], amplitude [m], frequency [Hz], vibrated, vibration's end, dt [s]"});
    planes.write("start", whole, 2, {"-", "whether it is there, step from which this motion holds"});

    Hdf5Group totals = root.create_group("totals");
    totals.write("steps", std::vector<std::int64_t>{s.step, s.step_base, s.contacts, s.rebuilds, s.prunes, s.redone_steps, s.sides_open ? 1 : 0, s.forces_valid ? 1 : 0}, 1,
                 {"-", "step, step at which dt began to hold, touching pairs, rebuilds, prunes, steps done twice, sides open, forces found"});
    totals.write("times", std::vector<double>{s.dt, s.last_drift, s.time_base, s.inserted, s.removed, s.forces_dt}, 1,
                 {"-", "dt, last dt, time at which dt began to hold [s], inserted, removed energy [J], dt of the forces [s]"});
    std::vector<std::int64_t> quanta;
    for (const Int128 x : s.dissipated) put(quanta, x);
    put(quanta, s.rolling), put(quanta, s.plate_work);
    totals.write("energies", quanta, 2, {"-", "integrals of the ledger in quanta, 128 bits: high, low half"});
  }
  file.close();
}

template <class T>
std::vector<T> read(const Hdf5Group& group, const char* name, std::size_t size, const fs::path& path) {
  std::vector<T> values = group.read<T>(name);
  if (values.size() != size) throw OutputError(fmt::format("{}: {} has {} numbers instead of {}", path.string(), name, values.size(), size));
  return values;
}

}  // namespace

void write_checkpoint(const fs::path& folder, const Checkpoint& checkpoint) {
  const fs::path path = folder / newest, body = folder / content;
  std::string bytes;
  try {
    write_content(body, checkpoint);
    bytes = read_whole_file(body);
    fs::remove(body);
  } catch (...) {
    std::error_code ignored;
    fs::remove(body, ignored);
    throw;
  }
  bytes += last_line(bytes);
  // Whole on disk before the older ones are touched; between the two renames there is the former one alone.
  write_whole_file(folder / unnamed, bytes);
  std::error_code error;
  // A damaged one never takes the place of a whole one.
  if (fs::exists(path) && checkpoint_is_whole(read_whole_file(path))) fs::rename(path, folder / former, error);
  rename_into_place(folder / unnamed, path);
}

bool checkpoint_is_whole(std::string_view bytes) {
  const std::size_t length = last_line("").size();
  return bytes.size() > length && bytes.substr(bytes.size() - length) == last_line(bytes.substr(0, bytes.size() - length));
}

Checkpoint read_checkpoint(const fs::path& path) {
  if (!checkpoint_is_whole(read_whole_file(path)))
    throw OutputError(path.string() + ": is damaged, or no checkpoint");
  const Hdf5File file = Hdf5File::open(path);
  const Hdf5Group root = file.root();
  const std::string version = root.text_attribute(".", "version");
  if (root.integer_attribute(".", "format", 0) != format || version != PLATEN_VERSION)
    throw OutputError(fmt::format("{}: was written by platen {}, this is {}; only the same version goes on with the same bits", path.string(), version.empty() ? "of another kind" : version, PLATEN_VERSION));
  Checkpoint c;
  SimulationState& s = c.bed;
  c.instruction_set = root.text_attribute(".", "instruction_set");
  c.reproducible = root.integer_attribute(".", "reproducible", 0) != 0;
  c.start_time = root.text_attribute(".", "start_time");
  c.case_text = root.read_text("case"), c.experiment = root.read_text("experiment");
  const Hdf5Group spheres = root.group("spheres");
  s.id = spheres.read<std::int64_t>("id");
  const std::size_t n = s.id.size();
  s.radius = read<double>(spheres, "radius", n, path);
  c.density = spheres.read<double>("density");
  s.position = read<double>(spheres, "position", 3 * n, path), s.velocity = read<double>(spheres, "velocity", 3 * n, path);
  s.turning = read<double>(spheres, "turning", 3 * n, path), s.image = read<std::int32_t>(spheres, "image", 2 * n, path);
  s.sums = read<double>(spheres, "sums", record_size * n, path);
  const auto pair_ranks = root.group("pairs").read<std::int32_t>("rank");
  const auto pair_numbers = read<double>(root.group("pairs"), "history", pair_ranks.size() / 2 * 5, path);
  for (std::size_t k = 0; 2 * k < pair_ranks.size(); ++k) {
    const double* x = pair_numbers.data() + 5 * k;
    s.pairs.push_back({pair_ranks[2 * k], pair_ranks[2 * k + 1], x[0], x[1], x[2], x[3], x[4]});
  }
  const auto plate_ranks = root.group("plates").read<std::int32_t>("rank");
  const auto plate_numbers = read<double>(root.group("plates"), "history", plate_ranks.size() / 2 * plate_columns, path);
  for (std::size_t k = 0; 2 * k < plate_ranks.size(); ++k) {
    const double* x = plate_numbers.data() + plate_columns * k;
    PlateHistory h{plate_ranks[2 * k], plate_ranks[2 * k + 1], x[0], x[1], x[2], x[3], x[4], {}};
    std::copy_n(x + 5, record_size, h.record);
    s.plates.push_back(h);
  }
  const auto motion = read<double>(root.group("planes"), "motion", plane_columns * plate_count, path);
  const auto start = read<std::int64_t>(root.group("planes"), "start", 2 * plate_count, path);
  for (std::size_t k = 0; k < plate_count; ++k) {
    const double* x = motion.data() + plane_columns * k;
    s.planes[k] = {start[2 * k] != 0, x[0], x[1], x[2], x[3], x[4], x[5], start[2 * k + 1], x[6]};
  }
  const Hdf5Group totals = root.group("totals");
  const auto steps = read<std::int64_t>(totals, "steps", 8, path);
  s.step = steps[0], s.step_base = steps[1], s.contacts = steps[2], s.rebuilds = steps[3], s.prunes = steps[4], s.redone_steps = steps[5], s.sides_open = steps[6] != 0, s.forces_valid = steps[7] != 0;
  const auto times = read<double>(totals, "times", 6, path);
  s.dt = times[0], s.last_drift = times[1], s.time_base = times[2], s.inserted = times[3], s.removed = times[4], s.forces_dt = times[5];
  const auto quanta = read<std::int64_t>(totals, "energies", 2 * (term_count + 2), path);
  for (std::size_t k = 0; k < term_count; ++k) s.dissipated[k] = wide(quanta, k);
  s.rolling = wide(quanta, term_count), s.plate_work = wide(quanta, term_count + 1);
  return c;
}

Checkpoint newest_checkpoint(const fs::path& folder, std::string& passed_over) {
  passed_over.clear();
  // The first of these is there where the machine stopped between two renames.
  for (const char* name : {unnamed, newest, former}) {
    if (!fs::exists(folder / name)) continue;
    try {
      return read_checkpoint(folder / name);
    } catch (const OutputError& error) {
      passed_over += (passed_over.empty() ? "" : "; ") + std::string(error.what());
    }
  }
  throw OutputError(passed_over.empty() ? folder.string() + ": holds no checkpoint to go on from" : passed_over);
}

bool has_checkpoint(const fs::path& folder) { return fs::exists(folder / unnamed) || fs::exists(folder / newest) || fs::exists(folder / former); }

void remove_checkpoints(const fs::path& folder) {
  std::error_code ignored;
  for (const char* name : {newest, former, unnamed, content}) fs::remove(folder / name, ignored), fs::remove(temporary_name(folder / name), ignored);
}

}  // namespace platen
