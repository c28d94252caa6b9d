// The cubic kernels for one precision and instruction-set level; CMakeLists.txt gives the flags.
#define EP_CUBIC_KERNEL ep_cubic_f64_avx512
#define REAL            double
#define LANES           8
#include "reduced/cubic_body.h"
