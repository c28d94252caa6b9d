#include "seeds.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "base/log.h"

static const char *given(const char *name) {
  const char *text = getenv(name);
  return text && *text ? text : NULL;
}

static void refuse(const char *name, const char *wanted) {
  fail_msg("%s=%s: %s wanted", name, getenv(name), wanted);
}

static uint64_t whole_from(const char *name, uint64_t usual, uint64_t most) {
  const char *text = given(name);
  char *end;
  if (!text) return usual;
  errno = 0;
  const unsigned long long value = strtoull(text, &end, 10);
  if (*end || errno || value > most || text[0] < '0' || text[0] > '9')
    refuse(name, "a whole number, none below 0");
  return value;
}

static double seconds_from(const char *name) {
  const char *text = given(name);
  char *end;
  if (!text) return 0;
  const double value = strtod(text, &end);
  if (*end || !(value >= 0)) refuse(name, "a number of seconds, none below 0");
  return value;
}

seeds seeds_begin(int usual_count) {
  const double seconds = seconds_from("EP_PROPERTY_SECONDS");
  return (seeds){.first = whole_from("EP_PROPERTY_SEED", 1, UINT64_MAX),
                 .count = (int)whole_from("EP_PROPERTY_COUNT", (uint64_t)usual_count, INT_MAX),
                 .seconds = seconds,
                 .until = ep_seconds() + seconds};
}

bool seeds_next(seeds *s) {
  if (s->seconds > 0 ? ep_seconds() > s->until : s->done == s->count) return false;
  s->now = s->first + (uint64_t)s->done++;
  return true;
}

bool breaks(char *why, const char *format, ...) {
  va_list args;
  va_start(args, format);
  vsnprintf(why, WHY, format, args);
  va_end(args);
  return false;
}

void seed_fails(const char *test, uint64_t seed, const char *why) {
  print_error("seed %llu: %s\nagain: EP_PROPERTY_SEED=%llu EP_PROPERTY_COUNT=1 %s\n",
              (unsigned long long)seed, why, (unsigned long long)seed, test);
  fail();
  abort();
}

double between(ep_random *rng, double low, double high) {
  return low + (high - low) * ep_random_uniform(rng);
}

double between_powers(ep_random *rng, double low, double high) {
  return low * pow(high / low, ep_random_uniform(rng));
}

bool chance(ep_random *rng, double probability) {
  return ep_random_uniform(rng) < probability;
}

int from_to(ep_random *rng, int low, int high) {
  return low + ep_random_below(rng, high - low + 1);
}

void direction(ep_random *rng, double out[3]) {
  double length = 0;
  for (int i = 0; i < 3; i++) out[i] = ep_random_normal(rng);
  for (int i = 0; i < 3; i++) length += out[i] * out[i];
  for (int i = 0; i < 3; i++) out[i] /= sqrt(length);
}

void rotation(ep_random *rng, double angle, double out[9]) {
  double a[3];
  direction(rng, a);
  const double c = cos(angle), s = sin(angle);
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) {
      const double cross = i == j ? 0 : ((j - i + 3) % 3 == 1 ? -a[3 - i - j] : a[3 - i - j]);
      out[3 * i + j] = (1 - c) * a[i] * a[j] + (i == j ? c : 0) + s * cross;
    }
}

void permutation(ep_random *rng, int count, int *out) {
  for (int i = 0; i < count; i++) out[i] = i;
  for (int i = count - 1; i > 0; i--) {
    const int j = ep_random_below(rng, i + 1), kept = out[i];
    out[i] = out[j], out[j] = kept;
  }
}
