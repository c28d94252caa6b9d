// The kernel for one instruction-set level; CMakeLists.txt gives the compiler's flags.
#define EP_KERNEL ep_kernel_avx512
#include "reduced/kernel_body.h"
