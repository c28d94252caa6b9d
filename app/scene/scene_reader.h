// Single values of a scene: checked, with the key and its place in every complaint. What the files
// scene*.c share; everyone else includes app/scene/scene.h.
#ifndef EP_APP_SCENE_SCENE_READER_H
#define EP_APP_SCENE_SCENE_READER_H

#include "app/scene/scene.h"
#include "app/scene/scene_load.h"

// Places, ways [m], speeds [m/s] and spins [1/s]: beyond, doubles tell no shape of a metre apart.
#define EP_PLACE_MOST 1e9

// What the conversion of one scene needs everywhere.
typedef struct ep_scene_reader {
  ep_scene_text *loaded;
  const char *name, *folder;
  int nsets;
  const char *const *sets; // key=value of --set: the place of what they give is there
  ep_error *err;
} ep_scene_reader;

// Where the value at a dotted key stands: ":line:column: key" in the file, ": --set key" for what
// comes from the command line.
void ep_read_place(const ep_scene_reader *r, const char *key, char *out, size_t size);
// A complaint about the value at a dotted key: EP_ERR_SCENE.
ep_status ep_read_refuse(const ep_scene_reader *r, const char *key, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
ep_status ep_read_no_memory(const ep_scene_reader *r);
// Whether the file or a --set gives the key: an empty list comes like one that is not there.
bool ep_read_given(const ep_scene_reader *r, const char *key);

// given NULL: the fallback. Refused outside low..high.
ep_status ep_read_number(const ep_scene_reader *r, const char *key, const double *given,
                         double fallback, double low, double high, double *out);
ep_status ep_read_whole(const ep_scene_reader *r, const char *key, const double *given,
                        int fallback, int low, int high, int *out);
ep_status ep_read_vector(const ep_scene_reader *r, const char *key, const double *given,
                         double *out);                                          // (3)
// Components from -most to most.
ep_status ep_read_bounded(const ep_scene_reader *r, const char *key, const double *given,
                          double most, double *out); // (3)
// Not zero, however short or long: scaled by a power of two to a largest component of 1 to 2, so
// that its square is a number. what: "the normal".
ep_status ep_read_direction(const ep_scene_reader *r, const char *key, const char *what,
                            const double *given, double *out); // (3)
ep_status ep_read_text(const ep_scene_reader *r, const char *text, char **out); // malloc'd
// Resolve a path relative to the scene and see that the file is there; malloc'd.
ep_status ep_read_file(const ep_scene_reader *r, const char *key, const char *path, char **out);
// Exactly one of box, plane, file, field must be given.
ep_status ep_read_selection(const ep_scene_reader *r, const char *key, const raw_selection *raw,
                            ep_selection *out);
// A local gradient-based algorithm of NLopt by name.
ep_status ep_read_algorithm(const ep_scene_reader *r, const char *key, const char *name,
                            char out[48]);

// ---- parts of a scene in files of their own ----------------------------------------------------
// Before the families, which name them.
ep_status ep_read_regions(const ep_scene_reader *r, const raw_scene *raw, ep_scene *out);
// The region of a family, by name or given there; *number in ep_scene.region.
ep_status ep_read_family_region(const ep_scene_reader *r, const char *key, const char *family,
                                const raw_region *raw, ep_scene *scene, int *number);
ep_status ep_read_families(const ep_scene_reader *r, const raw_scene *raw, ep_scene *out);
ep_status ep_read_contact(const ep_scene_reader *r, const raw_scene *raw, ep_scene *out);
// After fixed: only free objects start in motion.
ep_status ep_read_start(const ep_scene_reader *r, const raw_scene *raw, ep_scene *out);
ep_status ep_read_loads(const ep_scene_reader *r, const raw_scene *raw, ep_scene *out);
// raw NULL: no turn.
ep_status ep_read_turn(const ep_scene_reader *r, const char *key, const raw_turn *raw,
                       ep_turn *out);
ep_status ep_read_motion(const ep_scene_reader *r, const char *key, unsigned count,
                         const raw_keyframe *raw, const bool *smooth, ep_motion_path *out);
// After everything else of the scene: the defaults come from there.
ep_status ep_read_sweep(const ep_scene_reader *r, const raw_scene *raw, ep_scene *out);
// alpha and constraints; raw may be NULL.
ep_status ep_read_green(const ep_scene_reader *r, const raw_examples *raw, ep_green *out);

#endif
