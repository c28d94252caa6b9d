// In doubles: cmocka's assert_float_equal compares in floats, to 6e-8 at best. Include it after
// cmocka.h.
#ifndef EP_TESTS_NEAR_H
#define EP_TESTS_NEAR_H

#include <math.h>

#define ASSERT_NEAR(a, b, tolerance)                                                               \
  do {                                                                                             \
    double a_ = (a), b_ = (b), t_ = (tolerance);                                                   \
    if (!(fabs(a_ - b_) <= t_))                                                                    \
      fail_msg("%s = %.17g and %s = %.17g are %.3g apart, above %.3g", #a, a_, #b, b_,             \
               fabs(a_ - b_), t_);                                                                 \
  } while (0)

#endif
