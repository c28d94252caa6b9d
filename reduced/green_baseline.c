// The Green-strain products for one instruction-set level; CMakeLists.txt gives the flags.
#define EP_GREEN ep_green_baseline
#include "reduced/green_body.h"
