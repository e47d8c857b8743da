#include "kernels/isa_kernels.h"

namespace platen {

KernelTable kernels_avx2(const KernelRequest& request) { return kernels_of<Avx2>(InstructionSet::avx2, request); }

}  // namespace platen
