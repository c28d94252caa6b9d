// The scene as it stands in the file, before defaults and checks (docs/scene.md). Optional values
// are pointers, NULL where left out. Whole numbers are read as doubles, so that 1.5 modes can be
// refused instead of cut.
#ifndef EP_APP_SCENE_SCENE_SCHEMA_H
#define EP_APP_SCENE_SCENE_SCHEMA_H

#include <cyaml/cyaml.h>
#include <stdbool.h>

typedef struct raw_box {
  double low[3], high[3];
} raw_box;
typedef struct raw_plane {
  double point[3], normal[3];
} raw_plane;
typedef struct raw_selection {
  raw_box *box;
  raw_plane *plane;
  char *file, *field;
  double *above, *equals;
} raw_selection;
typedef struct raw_material {
  int *model;
  double *density, *young, *poisson;
} raw_material;
typedef struct raw_object {
  char *mesh;
  raw_material *material;
} raw_object;
typedef struct raw_landmark {
  double *object, *rest;       // vertices
  double *object_at, *rest_at; // points (3)
  unsigned object_at_count, rest_at_count;
  double *poses; // vertices
  unsigned poses_count;
  double (*poses_at)[3]; // points
  unsigned poses_at_count;
} raw_landmark;
typedef struct raw_map_field {
  char *name, *object, *rest, *poses;
} raw_map_field;
typedef struct raw_map {
  char *regions;
  raw_map_field *fields;
  unsigned fields_count;
  raw_landmark *landmarks;
  unsigned landmarks_count;
  int *frame;
  double *eigenfunctions;
  bool *reflections, *accept;
} raw_map;
typedef struct raw_region {
  char *name;
  raw_box *box;
  raw_plane *plane;
  char *file, *field;
  double *above, *equals;
  double *soft, *eigenfunctions, *strength;
} raw_region;
typedef struct raw_family {
  char *name, *rest;
  char **poses;
  unsigned poses_count;
  raw_map *map;
  raw_region *region;
} raw_family;
typedef struct raw_reduction {
  double *eigenfunctions, *modes, *linear_modes, *path_samples, *elements, *guards;
  double *training_poses;
  double *amplitude;
  int *evaluator;
} raw_reduction;
typedef struct raw_damping {
  double *mass, *stiffness;
} raw_damping;
typedef struct raw_simulation {
  int *integrator, *precision;
  double *dt, *steps;
  raw_damping *damping;
} raw_simulation;
typedef struct raw_constraints {
  double *sum_to_one, *non_negative;
} raw_constraints;
typedef struct raw_examples {
  double *strength, *relief, *alpha;
  int *force, *solver, *path;
  raw_constraints *constraints;
  char *algorithm;
} raw_examples;
typedef struct raw_push {
  raw_box *box;
  raw_plane *plane;
  char *file, *field;
  double *above, *equals;
  double force[3];
  double *from, *until, *ramp;
} raw_push;
typedef struct raw_waypoint {
  double time, at[3];
} raw_waypoint;
typedef struct raw_drag {
  raw_box *box;
  raw_plane *plane;
  char *file, *field;
  double *above, *equals;
  raw_waypoint *path;
  unsigned path_count;
  double stiffness, *damping, *from, *until;
  bool *smooth;
} raw_drag;
typedef struct raw_pressure {
  raw_box *box;
  raw_plane *plane;
  char *file, *field;
  double *above, *equals;
  double pascal, *from, *until, *ramp;
} raw_pressure;
typedef struct raw_load {
  double *gravity; // 3
  unsigned gravity_count;
  raw_push *push;
  raw_drag *drag;
  raw_pressure *pressure;
} raw_load;
typedef struct raw_turn {
  double axis[3], degrees;
} raw_turn;
typedef struct raw_keyframe {
  double time;
  double *move; // 3
  unsigned move_count;
  raw_turn *turn;
} raw_keyframe;
typedef struct raw_sphere {
  double center[3], radius;
} raw_sphere;
typedef struct raw_solid_box {
  double low[3], high[3];
  raw_turn *rotation;
} raw_solid_box;
typedef struct raw_obstacle {
  raw_plane *plane;
  raw_sphere *sphere;
  raw_solid_box *box;
  double *friction;
  raw_keyframe *motion;
  unsigned motion_count;
  bool *smooth;
} raw_obstacle;
typedef struct raw_contact {
  char *stiffness; // "auto" or a number
  double *thickness, *depth, *damping, *friction;
} raw_contact;
typedef struct raw_output {
  double *every;
  int *formats;
  unsigned formats_count;
  double *moments;
  unsigned moments_count;
} raw_output;
typedef struct raw_compare {
  double *modes, *elements, *dt;
  unsigned modes_count, elements_count, dt_count;
  int *methods, *materials, *precisions, *paths, *reference;
  unsigned methods_count, materials_count, precisions_count, paths_count;
  char **solvers, *budget;
  unsigned solvers_count;
} raw_compare;
typedef struct raw_start {
  double *position, *velocity, *spin; // 3
  unsigned position_count, velocity_count, spin_count;
  raw_turn *rotation;
} raw_start;
typedef struct raw_scene {
  double schema;
  char *name;
  double *seed;
  raw_object object;
  raw_selection *fixed;
  unsigned fixed_count;
  raw_region *regions;
  unsigned regions_count;
  raw_family *families;
  unsigned families_count;
  raw_reduction *reduction;
  raw_simulation *simulation;
  raw_examples *examples;
  raw_load *loads;
  unsigned loads_count;
  raw_obstacle *obstacles;
  unsigned obstacles_count;
  raw_contact *contact;
  raw_start *start;
  raw_output *output;
  raw_compare *compare;
} raw_scene;

extern const cyaml_schema_value_t ep_scene_schema;

#endif
