// Where the guards stand for one instruction-set level; CMakeLists.txt gives the flags.
#define EP_GUARD ep_guard_avx2
#include "reduced/guard_body.h"
