// The Green-strain products for one instruction-set level; CMakeLists.txt gives the flags.
#define EP_GREEN ep_green_avx2
#include "reduced/green_body.h"
