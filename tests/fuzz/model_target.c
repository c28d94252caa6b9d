// Model files: what is accepted can be stepped, whatever its numbers are.
#include <math.h>
#include <string.h>

#include "reduced/eigenpose.h"
#include "reduced/tensorfile.h"
#include "tests/fuzz/target.h"

enum { MOST_STATE = 1 << 24 };

// Two steps from a small push: they succeed with finite results, or leave the state as it was.
static void step_it(const ep_model *model, ep_state *state) {
  const int r = model->size.r;
  ep_step_def def = ep_default_step();
  double *q = ep_state_q(state), before;
  def.max_iterations = 5;
  def.dt = 1.0 / 60;
  def.strength = 1;
  def.green.alpha = model->size.greens ? 0.5 : 0;
  ep_state_velocity(state)[0] = 0.1;
  for (int i = 0; i < 2; i++) {
    before = q[0];
    const ep_status status = ep_step(state, &def, NULL);
    if (status != EP_OK) must(q[0] == before, "a step that fails leaves the state unchanged");
    for (int a = 0; a < r; a++) must(isfinite(q[a]), "q is finite");
  }
}

static void use(const ep_model *model) {
  const size_t bytes = ep_state_bytes(model);
  if (bytes > MOST_STATE) return;
  void *memory = aligned_alloc(64, (bytes + 63) / 64 * 64);
  must(memory != NULL, "memory");
  ep_state *state;
  const ep_status status = ep_state_init(model, memory, bytes, &state);
  must(status == EP_OK || status == EP_ERR_NUMERIC, "a state is made, or K0 is not definite");
  if (status == EP_OK) step_it(model, state);
  free(memory);
}

bool fuzz_target(const uint8_t *data, size_t size) {
  // Exactly `size` bytes behind an aligned start, so that a sanitizer sees a read past the end.
  unsigned char *room = NULL;
  if (posix_memalign((void **)&room, 64, size ? size : 1) != 0) return false;
  memcpy(room, data, size);
  ep_model model;
  char message[256] = "", text[64];
  const ep_status status = ep_model_open(room, size, &model, message);
  must(status == EP_OK || message[0], "an error has a text");
  must(strlen(message) < sizeof message, "the text ends");
  ep_tensorfile file;
  if (ep_tensorfile_open(room, size, &file, message) == EP_OK)
    ep_tensorfile_metadata(&file, "scene", text, sizeof text);
  else
    must(status != EP_OK, "a model is a tensor file");
  if (status == EP_OK) use(&model);
  free(room);
  return status == EP_OK;
}
