// The cubic kernels for one precision and instruction-set level; CMakeLists.txt gives the flags.
#define EP_CUBIC_KERNEL ep_cubic_f32_avx2
#define REAL            float
#define LANES           16
#include "reduced/cubic_body.h"
