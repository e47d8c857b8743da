// Compiled to an object named as one of an instruction set, with a symbol that is not: check_symbols.cmake must object.
namespace platen {
int check_real_avx2_alike() { return 1; }
int nobody_else_should_define_this() { return 2; }
}  // namespace platen
