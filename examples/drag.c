// An engine's loop in small: open a model, drag one of its vertices as a mouse does, 60 steps a
// second, and read where the vertices are. C11 and C++17; docs/engine.md explains it.
//
//   drag MODEL.epm [SECONDS]
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "reduced/eigenpose.h"
#include "reduced/spring.h"

// Memory is the engine's: 64-byte aligned, at least `bytes`.
static void *aligned(size_t bytes) {
  return aligned_alloc(64, (bytes + 63) / 64 * 64);
}

static void *read_file(const char *path, size_t *size) {
  FILE *file = fopen(path, "rb");
  if (!file) return NULL;
  long length = fseek(file, 0, SEEK_END) == 0 ? ftell(file) : -1;
  void *bytes = length > 0 ? aligned((size_t)length) : NULL;
  rewind(file);
  if (bytes && fread(bytes, 1, (size_t)length, file) != (size_t)length) {
    free(bytes);
    bytes = NULL;
  }
  fclose(file);
  *size = bytes ? (size_t)length : 0;
  return bytes;
}

// What the mouse picked: the vertex farthest along x.
static int pick(const ep_model *model) {
  int best = 0;
  for (int v = 1; v < model->size.n; v++)
    if (model->rest_x[3 * v] > model->rest_x[3 * best]) best = v;
  return best;
}

// A spring on one vertex: its row of U, (3 x r), and its place at rest.
static void hold(const ep_model *model, int vertex, double *rows, ep_spring *spring) {
  const size_t n = (size_t)model->size.n, r = (size_t)model->size.r;
  memset(spring, 0, sizeof *spring);
  for (size_t i = 0; i < 3; i++) {
    spring->rest[i] = model->rest_x[3 * (size_t)vertex + i];
    for (size_t a = 0; a < r; a++) rows[i * r + a] = model->u[(a * n + (size_t)vertex) * 3 + i];
  }
  spring->rows = rows;
}

// Of the mouse's way from `from` to `to` in a frame the part between two shares of it.
static void drag(ep_spring *spring, const double *from, const double *to, double begin,
                 double end) {
  for (int i = 0; i < 3; i++) {
    spring->from[i] = from[i] + begin * (to[i] - from[i]);
    spring->to[i] = from[i] + end * (to[i] - from[i]);
  }
}

// One frame of dt, the mouse going from `from` to `to`. A step that fails leaves the state as it
// was: two halves of it are tried once, the mouse going half its way in each. Returns how many
// seconds the state has gone on: dt, or less where it failed.
static double advance(ep_state *state, ep_step_def *def, ep_springs *springs, const double *from,
                      const double *to, double dt) {
  for (int parts = 1;; parts = 2) {
    ep_status status = EP_OK;
    int done = 0;
    def->dt = dt / parts;
    while (done < parts && status == EP_OK) {
      drag(springs->spring, from, to, (double)done / parts, (done + 1.0) / parts);
      ep_springs_begin(state, def->dt, springs);
      status = ep_step(state, def, NULL);
      if (status == EP_OK) done++;
    }
    if (parts == 2 || status != EP_ERR_NUMERIC) return dt * done / parts;
  }
}

static int simulate(ep_state *state, const ep_model *model, double seconds, double *rows,
                    double *x) {
  const double dt = 1.0 / 60, up = 0.2 * model->rest_scale; // of the mouse, in a second
  const int vertex = pick(model), steps = (int)(seconds / dt + 0.5);
  ep_spring spring;
  ep_springs springs = {1, &spring, dt};
  ep_step_def def = ep_default_step();
  def.damping_stiffness = 0.01;
  def.strength = model->size.k && model->size.m ? 1 : 0; // the examples act
  def.outer = ep_springs_energy;
  def.outer_user = &springs;
  hold(model, vertex, rows, &spring);
  spring.stiffness = 500; // N/m
  spring.damping = 5;     // N s/m
  for (int step = 0; step < steps; step++) {
    const double from[3] = {spring.rest[0], spring.rest[1] + up * step * dt, spring.rest[2]};
    const double to[3] = {from[0], spring.rest[1] + up * (step + 1) * dt, from[2]};
    const double gone = advance(state, &def, &springs, from, to, dt);
    if (gone < dt) {
      fprintf(stderr, "step %d failed; the state is that at %g s\n", step, step * dt + gone);
      return 1;
    }
    ep_state_positions(state, x); // n x 3, for the vertex buffer
  }
  printf("vertex %d: at rest %g %g %g, after %g s %g %g %g\n", vertex, spring.rest[0],
         spring.rest[1], spring.rest[2], steps * dt, x[3 * vertex], x[3 * vertex + 1],
         x[3 * vertex + 2]);
  return 0;
}

int main(int argc, char **argv) {
  size_t size = 0;
  ep_model model;
  ep_state *state = NULL;
  char message[256];
  if (argc < 2) {
    fprintf(stderr, "usage: drag MODEL.epm [SECONDS]\n");
    return 1;
  }
  void *bytes = read_file(argv[1], &size);
  if (!bytes) {
    fprintf(stderr, "%s: cannot be read\n", argv[1]);
    return 1;
  }
  if (ep_model_open(bytes, size, &model, message) != EP_OK) { // borrows bytes
    fprintf(stderr, "%s: %s\n", argv[1], message);
    return 1;
  }
  const size_t need = ep_state_bytes(&model);
  void *memory = aligned(need);
  double *rows = (double *)malloc(3 * (size_t)model.size.r * sizeof(double));
  double *x = (double *)malloc(3 * (size_t)model.size.n * sizeof(double));
  int failed = 1;
  if (memory && rows && x && ep_state_init(&model, memory, need, &state) == EP_OK)
    failed = simulate(state, &model, argc > 2 ? atof(argv[2]) : 2, rows, x);
  free(x);
  free(rows);
  free(memory);
  free(bytes);
  return failed;
}
