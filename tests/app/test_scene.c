// Claims: a scene is read with its defaults; everything docs/scene.md does not allow is refused
// with the place (line:column) and the key, numbers with something behind them too, and the key
// that was meant is said; --set is checked like the file; selections hold exactly the vertices
// geometry says.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "app/scene/scene.h"
#include "app/scene/select.h"
#include "box.h"
#include "mesh/io.h"

static ep_status parse_with(const char *text, int nsets, const char *const *sets, ep_scene *scene,
                            ep_error *err) {
  memset(err, 0, sizeof *err);
  return ep_scene_parse("s.yaml", ".", text, strlen(text), nsets, sets, scene, err);
}

// A text must be refused with EP_ERR_SCENE, and the message must name all of `parts`.
static void refused(const char *text, const char *place, const char *what) {
  ep_scene scene;
  ep_error err;
  const ep_status status = parse_with(text, 0, NULL, &scene, &err);
  if (status != EP_ERR_SCENE || !strstr(err.text, place) || !strstr(err.text, what))
    fail_msg("scene <<%s>>\nstatus %d, message '%s'\nexpected '%s' and '%s'", text, (int)status,
             err.text, place, what);
}

#define HEAD "schema: 1\nobject: {mesh: box.veg}\n"

static void defaults_are_filled_in(void **state) {
  (void)state;
  ep_scene s;
  ep_error err;
  assert_int_equal(parse_with(HEAD, 0, NULL, &s, &err), EP_OK);
  assert_string_equal(s.name, "s");
  assert_string_equal(s.mesh, "./box.veg");
  assert_int_equal(s.seed, 1);
  assert_int_equal(s.model, EP_STVK_VOLUME);
  assert_int_equal(s.eigenfunctions, 10);
  assert_int_equal(s.modes, 30);
  assert_int_equal(s.elements, 60);
  assert_true(s.dt == 1.0 / 60 && s.steps == 120 && s.strength == 1);
  assert_int_equal(s.solver, EP_SOLVER_NLOPT);
  assert_int_equal(s.formats, EP_FORMAT_VTU | EP_FORMAT_GLB | EP_FORMAT_PNG);
  assert_int_equal(s.nfixed + s.nfamilies + s.nloads, 0);
  ep_scene_free(&s);
  assert_int_equal(parse_with(HEAD "output: {formats: []}\n", 0, NULL, &s, &err), EP_OK);
  assert_int_equal(s.formats, 0);
  ep_scene_free(&s);
  const char *const sets[] = {"output.formats=[]"};
  assert_int_equal(parse_with(HEAD, 1, sets, &s, &err), EP_OK);
  assert_int_equal(s.formats, 0);
  ep_scene_free(&s);
}

static void green_strain_keys(void **state) {
  (void)state;
  ep_scene s;
  ep_error err;
  assert_int_equal(parse_with(HEAD "examples: {path: green, alpha: 0.75, constraints: {sum_to_one: "
                                   "2, non_negative: 3}, strength: 1}\n",
                              0, NULL, &s, &err),
                   EP_OK);
  assert_int_equal(s.methods, EP_METHOD_GREEN);
  assert_true(s.green.alpha == 0.75 && s.green.sum_to_one == 2 && s.green.non_negative == 3);
  ep_scene_free(&s);
  // the same keys with the other path: alpha is off, so that --set can switch
  assert_int_equal(parse_with(HEAD "examples: {path: lb, alpha: 0.75}\n", 0, NULL, &s, &err),
                   EP_OK);
  assert_true(s.methods == EP_METHOD_LB && s.green.alpha == 0);
  ep_scene_free(&s);
  refused(HEAD "examples: {path: green, alpha: 1.5}\n", "s.yaml:3:", "examples.alpha");
  refused(HEAD "examples: {path: green, constraints: {non_negative: -1}}\n",
          "s.yaml:3:", "non_negative");
  refused(HEAD "examples: {path: blue}\n", "s.yaml:3:", "path");
#define LOCAL "families: [{poses: [box.veg], region: {box: {low: [0, 0, 0], high: [1, 1, 1]}}}]\n"
  refused(HEAD LOCAL "examples: {force: linear}\n", "s.yaml:4:", "examples.force");
  refused(HEAD LOCAL "reduction: {evaluator: cubic}\nexamples: {relief: 0.5}\n",
          "s.yaml:5:", "examples.relief");
}

static void everything_is_read(void **state) {
  (void)state;
  static const char text[] =
      "schema: 1\nname: all\nseed: 7\n"
      "object:\n  mesh: box.veg\n"
      "  material: {model: neohookean, density: 900, young: 2e5, poisson: 0.3}\n"
      "fixed:\n  - plane: {point: [0, 0, 0], normal: [1, 0, 0]}\n  - file: held.txt\n"
      "families:\n  - name: own\n    poses: [box.veg, box.veg]\n    map: {accept: true,\n"
      "    frame: authored, eigenfunctions: 6, landmarks: [{object: 3, poses: [4, 5]},\n"
      "    {object_at: [0, 0.5, 1], poses_at: [[6, 7, 8], [9, 10, 11]]}]}\n"
      "reduction: {modes: 12, amplitude: 0.1}\n"
      "simulation: {dt: 0.01, steps: 5, damping: {mass: 0.2}}\n"
      "examples: {strength: 0.5, force: linear, solver: newton}\n"
      "loads:\n  - gravity: [0, -9.81, 0]\n"
      "  - push: {file: held.txt, force: [1, 2, 3], from: 1, until: 3, ramp: 0.5}\n"
      "output: {every: 4, formats: [glb]}\n";
  ep_scene s;
  ep_error err;
  if (parse_with(text, 0, NULL, &s, &err) != EP_OK) fail_msg("%s", err.text);
  assert_int_equal(s.model, EP_STABLE_NEOHOOKEAN);
  assert_true(s.has_material && s.material.young == 2e5);
  assert_int_equal(s.nfixed, 2);
  assert_int_equal(s.fixed[0].kind, EP_SELECT_PLANE);
  assert_int_equal(s.fixed[1].kind, EP_SELECT_FILE);
  assert_int_equal(ep_scene_examples(&s), 2);
  assert_true(s.family[0].accept && !s.family[0].rest && !s.family[0].reflections);
  assert_true(s.family[0].frame == EP_FRAME_AUTHORED && s.family[0].eigenfunctions == 6);
  assert_int_equal(s.family[0].landmarks, 2);
  const ep_scene_landmark *l = s.family[0].landmark;
  assert_true(l[0].object.given && l[0].object.vertex == 3 && !l[0].rest.given);
  assert_true(l[0].poses == 2 && l[0].pose[1].vertex == 5);
  assert_true(l[1].object.given && l[1].object.vertex == 0 && l[1].object.at[1] == 0.5);
  assert_true(l[1].poses == 2 && l[1].pose[1].vertex == 0 && l[1].pose[1].at[2] == 11);
  assert_int_equal(s.force, EP_EXAMPLE_LINEAR);
  assert_int_equal(s.solver, EP_SOLVER_NEWTON);
  assert_true(s.load[0].gravity && s.load[0].vector[1] == -9.81);
  assert_true(!s.load[1].gravity && s.load[1].until == 3);
  assert_int_equal(s.formats, EP_FORMAT_GLB);
  ep_scene_free(&s);
}

static void json_is_a_scene_too(void **state) {
  (void)state;
  ep_scene s;
  ep_error err;
  assert_int_equal(
      parse_with("{\"schema\": 1, \"object\": {\"mesh\": \"box.veg\"}}", 0, NULL, &s, &err), EP_OK);
  ep_scene_free(&s);
}

static void mistakes_are_named_with_their_place(void **state) {
  (void)state;
  refused("", "s.yaml", "empty");
  refused("- 1\n", "s.yaml:1:1", "mapping");
  refused("schema: 1\nobject: [\n", "s.yaml:3:1", "");
  refused("object: {mesh: box.veg}\n", "s.yaml", "schema");
  refused("schema: 2\nobject: {mesh: box.veg}\n", "s.yaml:1:9", "schema: 1");
  refused("schema: 1\nobject: {}\n", "s.yaml", "mesh");
  refused("schema: 1\nobject: {mesh: nowhere.veg}\n", "s.yaml:2:16", "nowhere.veg");
  refused(HEAD "colour: red\n", "s.yaml:3:1", "'colour'");
  refused(HEAD "reduction:\n  modes: 3\n  mods: 3\n", "s.yaml:5:3", "'mods'");
  refused(HEAD "seed: 1\nseed: 2\n", "s.yaml:4:1", "twice");
  refused(HEAD "reduction: {modes: many}\n", "s.yaml:3:20", "many");
  refused(HEAD "reduction: {modes: 1.5}\n", "s.yaml:3:20", "whole");
  refused(HEAD "reduction: {modes: 0}\n", "s.yaml:3:20", "out of range");
  refused(HEAD "reduction: {amplitude: .nan}\n", "s.yaml:3", "amplitude");
  refused(HEAD "simulation: {dt: nan}\n", "s.yaml:3:18", "simulation.dt");
  refused(HEAD "simulation: {dt: inf}\n", "s.yaml:3:18", "simulation.dt");
  refused(HEAD "simulation: {dt: -1}\n", "s.yaml:3:18", "out of range");
  refused(HEAD "examples: {solver: magic}\n", "s.yaml:3", "magic");
  refused(HEAD "fixed: [{}]\n", "s.yaml:3:9", "one of box, plane, file");
  refused(HEAD "fixed: [{box: {low: [1, 0, 0], high: [0, 1, 1]}}]\n", "s.yaml:3", "low 1");
  refused(HEAD "fixed: [{box: {low: [1, 0], high: [0, 1, 1]}}]\n", "s.yaml:3", "low");
  refused(HEAD "fixed: [{plane: {point: [0, 0, 0], normal: [0, 0, 0]}}]\n", "s.yaml:3", "normal");
  refused(HEAD "families: [{name: a}]\n", "s.yaml", "poses");
  refused(HEAD "families: [{poses: [no.veg]}]\n", "s.yaml:3:21", "no.veg");
  refused(HEAD "families: [{name: a, poses: [box.veg]}, {name: a, poses: [box.veg]}]\n",
          "s.yaml:3:48", "another family");
  refused(HEAD "families: [{poses: [box.veg, box.veg]}]\nreduction: {modes: 1}\n", "s.yaml:4:20",
          "2 examples");
#define MAP "families: [{rest: box.veg, poses: [box.veg], map: {"
  refused(HEAD MAP "landmarks: [{object: 1}]}}]\n", "s.yaml:3", "two shapes");
  refused(HEAD MAP "landmarks: [{object: 0, rest: 1}]}}]\n", "s.yaml:3", "out of range");
  refused(HEAD MAP "landmarks: [{object: 1, object_at: [0, 0, 0], rest: 1}]}}]\n", "s.yaml:3",
          "not both");
  refused(HEAD MAP "landmarks: [{object: 1, poses: [1, 2]}]}}]\n", "s.yaml:3", "one for each");
  refused(HEAD MAP "landmarks: [{object: 1, rest_at: [0, 0]}]}}]\n", "s.yaml:3", "rest_at");
  refused(HEAD MAP "frame: sideways}}]\n", "s.yaml:3", "sideways");
  refused(HEAD MAP "eigenfunctions: 0}}]\n", "s.yaml:3", "out of range");
  refused(HEAD "families: [{poses: [box.veg], map: {landmarks: [{rest: 1, object: 1}]}}]\n",
          "s.yaml:3", "no rest shape");
  refused(HEAD "loads: [{gravity: [0, 0, 1], push: {file: held.txt, force: [0, 0, 1]}}]\n",
          "s.yaml:3:9", "one of gravity, push");
  refused(HEAD "loads: [{push: {file: held.txt, force: [0, 0, 1], from: 2, until: 1}}]\n",
          "s.yaml:3", "ends at 1 s, not after it begins at 2 s");
  refused(HEAD "loads: [{push: {file: held.txt, force: [0, 0, 1], from: 1, until: 1}}]\n",
          "s.yaml:3", "ends at 1 s, not after it begins at 1 s");
  refused(HEAD "loads: [{push: {file: held.txt, force: [0, 0, 1], until: 1, ramp: 0.6}}]\n",
          "s.yaml:3", "do not fit");
  refused("schema: 1\nobject: {mesh: box.veg, material: {young: 1e5}}\n", "s.yaml:2", "all of");
  refused(HEAD "examples: {algorithm: LD_AUGLAG}\n", "s.yaml:3:23", "LD_LBFGS");
  refused(HEAD "examples: {algorithm: LD_LBGFS}\n", "s.yaml:3:23", "LD_LBFGS");
  refused(HEAD "start: {position: [0, 1e12, 0]}\n", "s.yaml:3:19", "component 1, 1e+12");
  refused(HEAD "#\nname: caf\xe9\n", "s.yaml:4: ", "UTF-8");
}

// Results go to out/NAME.
static void names_are_folders_of_their_own(void **state) {
  (void)state;
  refused(HEAD "name: .\n", "s.yaml:3:7: name", "no folder of its own");
  refused(HEAD "name: ..\n", "s.yaml:3:7: name", "no folder of its own");
  refused(HEAD "name: a/b\n", "s.yaml:3:7: name", "'/'");
  refused(HEAD "name: \"a\\nb\"\n", "s.yaml:3:7: name", "control");
  char text[400] = HEAD "name: ";
  memset(text + strlen(text), 'n', 201);
  refused(text, "s.yaml:3:7: name", "at most 200");
  ep_scene scene;
  ep_error err = {0};
  assert_int_equal(ep_scene_parse("caf\xe9.yaml", ".", HEAD, strlen(HEAD), 0, NULL, &scene, &err),
                   EP_ERR_SCENE);
  assert_non_null(strstr(err.text, "give `name`"));
}

// What is too large, too small or empty is told by its own key.
static void obstacles_are_refused_by_key(void **state) {
  (void)state;
#define OBSTACLE(text) HEAD "obstacles:\n  - " text "\n"
  refused(OBSTACLE("sphere: {center: [0, 0, 0], radius: 0}"),
          "s.yaml:4:41: obstacles.0.sphere.radius", "out of range");
  refused(OBSTACLE("sphere: {center: [0, -1e15, 0], radius: 1}"),
          "s.yaml:4:22: obstacles.0.sphere.center", "-1e+15");
  refused(OBSTACLE("box: {low: [-1e30, 0, 0], high: [1, 1, 1]}"),
          "s.yaml:4:16: obstacles.0.box.low", "-1e+30");
  refused(OBSTACLE("plane: {point: [0, 1e30, 0], normal: [0, 1, 0]}"),
          "s.yaml:4:20: obstacles.0.plane.point", "1e+30");
  refused(OBSTACLE("plane: {point: [0, 0, 0], normal: [0, 0, 0]}"),
          "s.yaml:4:39: obstacles.0.plane.normal", "zero");
  refused(OBSTACLE("plane: {point: [0, 0, 0], normal: [0, 1, 0]}\n    motion: [{time: 0, move: [0, "
                   "1e30, 0]}]"),
          "s.yaml:5", "1e+30");
  refused(HEAD "contact: {stiffness: 1e30}\n", "s.yaml:3:22", "up to 1e+20");
}

// Their squares are no numbers: the direction is the same at any length.
static void directions_may_have_any_length(void **state) {
  (void)state;
  static const char *const scale[] = {"1", "1e-200", "1e30"};
  double normal[3], first[9], axis[9];
  for (int i = 0; i < 3; i++) {
    char text[400];
    ep_scene s;
    ep_error err;
    snprintf(text, sizeof text,
             HEAD "start: {rotation: {axis: [0, %s, 0], degrees: 90}}\n"
                  "obstacles:\n  - plane: {point: [0, 0, 0], normal: [0, %s, 0]}\n"
                  "regions: [{name: a, plane: {point: [0, 0, 0], normal: [0, %s, 0]}}]\n",
             scale[i], scale[i], scale[i]);
    if (parse_with(text, 0, NULL, &s, &err) != EP_OK) fail_msg("%s: %s", text, err.text);
    ep_turn_matrix(&s.start.rotation, axis);
    if (i == 0) memcpy(first, axis, sizeof first);
    for (int a = 0; a < 3; a++) normal[a] = s.obstacle[0].at.R[3 * a + 2];
    const double at[3] = {0.3, 0.5, 0.7};
    const double away = ep_select_distance(&s.region[0].where, at);
    ep_scene_free(&s);
    for (int a = 0; a < 9; a++) assert_true(fabs(axis[a] - first[a]) < 1e-15);
    for (int a = 0; a < 3; a++) assert_true(normal[a] == (a == 1));
    assert_true(fabs(away - 0.5) < 1e-15);
  }
}

// libcyaml reads "3e5 Pa" as 3e5 and "flase" as true.
static void values_are_read_to_their_end(void **state) {
  (void)state;
  ep_scene s;
  ep_error err;
#define YOUNG(text)                                                                                \
  "schema: 1\nobject: {mesh: box.veg, material: {density: 1, young: " text ", poisson: 0}}\n"
  static const char *const numbers[] = {YOUNG("3e5 Pa"), YOUNG("3e5Pa"), YOUNG("300_000"),
                                        YOUNG("'1,5'"), YOUNG("1.2.3")};
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
    refused(numbers[i], "s.yaml:2:55: young", "no number");
  refused(HEAD "loads: [{gravity: [0, 9.81m, 0]}]\n", "s.yaml:3:", "'9.81m'");
  refused(HEAD "families: [{poses: [box.veg], map: {landmarks: [{object: 3, poses: [4x]}]}}]\n",
          "s.yaml:3:69: poses", "'4x'");
  refused(HEAD "families: [{poses: [box.veg], map: {accept: flase}}]\n", "s.yaml:3:45: accept",
          "'flase' is neither");
  refused(HEAD "families: [{poses: [box.veg], map: {accept: off}}]\n", "s.yaml:3:45", "neither");
  assert_int_equal(
      parse_with(HEAD "families: [{poses: [box.veg], map: {accept: No}}]\n", 0, NULL, &s, &err),
      EP_OK);
  assert_false(s.family[0].accept);
  ep_scene_free(&s);
  const char *set = "simulation.steps=12 s";
  assert_int_equal(parse_with(HEAD, 1, &set, &s, &err), EP_ERR_SCENE);
  assert_non_null(strstr(err.text, "with --set: steps: '12 s'"));
}

static void what_was_meant_is_said(void **state) {
  (void)state;
  refused(HEAD "reduction: {mods: 3}\n", "s.yaml:3:13", "meant to be reduction.modes;");
  refused(HEAD "modes: 3\n", "s.yaml:3:1", "meant to be reduction.modes;"); // at the wrong place
  refused(HEAD "examples: {strengh: 3}\n", "s.yaml:3", "meant to be examples.strength;");
  refused(HEAD "fixed: [{boxx: 1}]\n", "s.yaml:3", "meant to be fixed[].box;");
  refused(HEAD "famliies: []\n", "s.yaml:3:1", "meant to be families;");  // letters exchanged
  refused(HEAD "colour: red\n", "s.yaml:3:1", "'colour'; docs/scene.md"); // nothing is near
  refused("schema: 1\nobject: {}\n", "s.yaml:2", "object.mesh is missing");
  refused("object: {mesh: box.veg}\n", "s.yaml", ": schema is missing");
  refused("schema: 1\nobject:\n\tmesh: box.veg\n", "s.yaml:3:1", "a tab");
  // places are counted in characters, of one byte and more
  refused("schema: 1 # \xc3\xa4 \xe2\x82\xac\nobject:\n\tmesh: box.veg\n", "s.yaml:3:1", "a tab");
  refused("schema: 1\r\nobject: {name: \xc3\xa4, \xe2\x82\xac: [}\n", "s.yaml:2:", "did not find");
}

static void overrides_are_checked_like_the_file(void **state) {
  (void)state;
  ep_scene s;
  ep_error err;
  const char *good[] = {"reduction.modes=12", "output.formats=[png]",
                        "fixed.0={box: {low: [0, 0, 0], high: [1, 1, 1]}}",
                        "fixed.0.box.high=[2, 2, 2]"};
  if (parse_with(HEAD, 4, good, &s, &err) != EP_OK) fail_msg("%s", err.text);
  assert_int_equal(s.modes, 12);
  assert_int_equal(s.formats, EP_FORMAT_PNG);
  assert_true(s.nfixed == 1 && s.fixed[0].b[0] == 2);
  ep_scene_free(&s);
  const char *bad[] = {"reduction.mods=12", "reduction.modes=1.5", "modes",      "fixed.3={}",
                       "schema.x=1",        "simulation.dt=nan",   "seed=[1, 2", "=3"};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    assert_int_equal(parse_with(HEAD, 1, &bad[i], &s, &err), EP_ERR_SCENE);
    assert_non_null(strstr(err.text, "--set"));
    assert_null(strstr(err.text, ":1:1:")); // no place in a file that does not hold the value
  }
  // what is refused names the --set it comes from, also where another value shows it
  const char *corner[] = {"fixed.0={box: {low: [0, 0, 0], high: [1, 1, 1]}}", "seed=3",
                          "fixed.0.box.low=[2, 0, 0]"};
  assert_int_equal(parse_with(HEAD, 3, corner, &s, &err), EP_ERR_SCENE);
  assert_non_null(strstr(err.text, "s.yaml: --set fixed.0.box.low: fixed.0: box: low 2 lies"));
  assert_int_equal(parse_with(HEAD, 1, &bad[1], &s, &err), EP_ERR_SCENE);
  assert_non_null(strstr(err.text, "s.yaml: --set reduction.modes: 1.5 is not a whole number"));
  // a value of the file keeps its place, whatever else is set
  const char *seed = "seed=3";
  assert_int_equal(parse_with(HEAD "reduction:\n  modes: 1.5\n", 1, &seed, &s, &err), EP_ERR_SCENE);
  assert_non_null(strstr(err.text, "s.yaml:4:10: reduction.modes: 1.5"));
}

// Vertices of the 4 x 1 x 1 box with cells of 0.25: 5 x 2 x 2.
static void selections_hold_what_geometry_says(void **state) {
  (void)state;
  ep_mesh mesh;
  ep_error err = {0};
  unsigned char chosen[20] = {0};
  int count;
  assert_int_equal(ep_mesh_read("box.veg", &mesh, NULL, NULL, &err), EP_OK);
  assert_int_equal(mesh.nv, 20);
  ep_selection box = {.kind = EP_SELECT_BOX, .a = {-1, -1, -1}, .b = {0.25, 1, 1}};
  assert_int_equal(ep_select_vertices(&box, &mesh, chosen, &count, &err), EP_OK);
  assert_int_equal(count, 8); // two of five layers, the boundary included
  ep_selection plane = {.kind = EP_SELECT_PLANE, .a = {0.6, 0, 0}, .b = {-1, 0, 0}};
  assert_int_equal(ep_select_vertices(&plane, &mesh, chosen, &count, &err), EP_OK);
  assert_int_equal(count, 8); // behind the plane: x >= 0.6
  box.b[0] = -0.5;
  assert_int_equal(ep_select_vertices(&box, &mesh, chosen, &count, &err), EP_ERR_SCENE);
  ep_mesh_free(&mesh);
}

// Found when the mesh is read, and still told with its place in the scene.
static void empty_selections_tell_their_place(void **state) {
  (void)state;
  ep_scene s;
  ep_mesh mesh;
  ep_error err;
  int count, *vertex;
  assert_int_equal(
      parse_with(HEAD "fixed:\n  - box: {low: [9, 9, 9], high: [10, 10, 10]}\n", 0, NULL, &s, &err),
      EP_OK);
  assert_int_equal(ep_mesh_read("box.veg", &mesh, NULL, NULL, &err), EP_OK);
  assert_int_equal(ep_select_fixed(&s, &mesh, &count, &vertex, &err), EP_ERR_SCENE);
  assert_non_null(strstr(err.text, "s.yaml:4:5: fixed.0: no vertex of box.veg lies there"));
  ep_mesh_free(&mesh);
  ep_scene_free(&s);
}

// Every load that chooses vertices can do so by a field.
static void loads_choose_by_fields(void **state) {
  (void)state;
  ep_scene s;
  ep_error err;
  if (parse_with(HEAD "loads:\n  - push: {field: a, force: [0, 0, 1]}\n"
                      "  - pressure: {field: b, equals: 2, pascal: 10}\n"
                      "  - drag: {field: c, above: 0.1, path: [{time: 0, at: [0, 0, 0]}],\n"
                      "           stiffness: 1}\n",
                 0, NULL, &s, &err) != EP_OK)
    fail_msg("%s", err.text);
  assert_int_equal(s.load[0].where.kind, EP_SELECT_FIELD);
  assert_true(s.load[0].where.value == 0.5 && !s.load[0].where.equals);
  assert_true(s.pressure[0].selected && s.pressure[0].where.equals);
  assert_true(s.pressure[0].where.value == 2);
  assert_int_equal(s.drag[0].where.kind, EP_SELECT_FIELD);
  assert_true(s.drag[0].where.value == 0.1);
  ep_scene_free(&s);
  refused(HEAD "loads: [{pressure: {equals: 2, pascal: 10}}]\n", "s.yaml:3", "one of box");
}

static void vertex_lists_are_checked(void **state) {
  (void)state;
  ep_mesh mesh;
  ep_error err = {0};
  unsigned char chosen[20] = {0};
  int count;
  assert_int_equal(ep_mesh_read("box.veg", &mesh, NULL, NULL, &err), EP_OK);
  assert_int_equal(ep_select_parse("f", "1, 2,\n20 # last\n2", &mesh, chosen, &count, &err), EP_OK);
  assert_int_equal(count, 3);
  assert_true(chosen[0] && chosen[1] && chosen[19] && !chosen[2]);
  static const char *const bad[] = {"1\n0", "1\n21", "1\nx", "1\n2x", "1\n-3", "1\n1.5"};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    memset(&err, 0, sizeof err);
    assert_int_equal(ep_select_parse("f", bad[i], &mesh, chosen, &count, &err), EP_ERR_FORMAT);
    assert_non_null(strstr(err.text, "f:2:"));
  }
  ep_mesh_free(&mesh);
}

static int set_up(void **state) {
  (void)state;
  write_box("box.veg", 4, 1, 1, 1, 0, 0);
  write_text("held.txt", "1,2,3\n");
  return 0;
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(defaults_are_filled_in),
      cmocka_unit_test(green_strain_keys),
      cmocka_unit_test(everything_is_read),
      cmocka_unit_test(json_is_a_scene_too),
      cmocka_unit_test(mistakes_are_named_with_their_place),
      cmocka_unit_test(names_are_folders_of_their_own),
      cmocka_unit_test(obstacles_are_refused_by_key),
      cmocka_unit_test(directions_may_have_any_length),
      cmocka_unit_test(values_are_read_to_their_end),
      cmocka_unit_test(what_was_meant_is_said),
      cmocka_unit_test(overrides_are_checked_like_the_file),
      cmocka_unit_test(selections_hold_what_geometry_says),
      cmocka_unit_test(empty_selections_tell_their_place),
      cmocka_unit_test(loads_choose_by_fields),
      cmocka_unit_test(vertex_lists_are_checked),
  };
  return cmocka_run_group_tests(tests, set_up, NULL);
}
