// Particles given one by one: a CSV file with a header (docs/case_file.md), and checks of where they stand.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/case_file.h"

namespace platen {

// A particle file as read: the table, the line of each of its rows, and what is wrong as `name:line: ...`.
struct ParticleFile {
  ParticleTable table;
  std::vector<std::size_t> line;
  std::vector<std::string> problems;
};

// Reads the bytes of a particle file. Header names: id,x,y,z,radius,vx,vy,vz,wx,wy,wz,density in any order, SI units;
// x, y, z are required, radius and density unless given here (a column wins over the value of the case), velocities and
// spins default to 0, ids to the row number from 0. Blank lines, lines that begin with #, spaces and CRLF are accepted.
// Never throws on any bytes; a file with many bad rows names the first twenty.
ParticleFile parse_particle_file(std::string_view bytes, const std::string& name, std::optional<double> radius,
                                 std::optional<double> density);

// What is wrong with where the particles stand: outside the box, beyond a plate that is present, or two that overlap by
// more than the smaller radius (images counted when sides are periodic). As `name:line: ...`, the first twenty.
// Lengths of 0 or less in box are not checked against. O(N) for N particles.
std::vector<std::string> check_particle_positions(const ParticleFile& file, const std::string& name, const BoxSpec& box,
                                                  bool bottom_plate, bool top_plate);

}  // namespace platen
