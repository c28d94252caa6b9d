// A random scene baked in this process, ready to step.
#ifndef EP_TESTS_PROPERTIES_BAKED_SCENE_H
#define EP_TESTS_PROPERTIES_BAKED_SCENE_H

#include "app/plan/model_file.h"
#include "app/plan/session.h"
#include "app/run/stepper.h"
#include "tests/properties/random_scene.h"

typedef struct baked_scene {
  const random_scene *from;
  placement at;
  ep_session session;
  ep_model_file file;
  ep_stepper *stepper;
  int *to; // vertex of the solid at home -> of the model
} baked_scene;

// Into `folder`, which is emptied. all: every tet becomes a cubature element, with its own volume -
// no choice of elements, whose outcome turns on the last bit. PETSc must run.
bool bake_scene(const random_scene *s, const placement *at, const char *folder, bool all,
                baked_scene *out, char *why);
void close_scene(baked_scene *b);
// Another stepper of the same model.
ep_stepper *open_stepper(const baked_scene *b);

// Random, with a largest displacement of `reach` diagonals.
void draw_state(const baked_scene *b, ep_random *rng, double reach, double *q);
double largest_move(const baked_scene *b, const double *q); // over the diagonal

#endif
