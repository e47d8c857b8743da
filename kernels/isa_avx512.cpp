#include "kernels/isa_kernels.h"

namespace platen {

KernelTable kernels_avx512(const KernelRequest& request) { return kernels_of<Avx512>(InstructionSet::avx512, request); }

}  // namespace platen
