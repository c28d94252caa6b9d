#include "app/scene/scene_schema.h"

#include "app/scene/scene.h"
#include "reduced/cubic.h"
#include "reduced/eigenpose.h"

// NOLINTBEGIN: libcyaml's macros
#define OPTIONAL             (CYAML_FLAG_POINTER | CYAML_FLAG_OPTIONAL)
#define NUMBER(type, member) CYAML_FIELD_FLOAT_PTR(#member, OPTIONAL, type, member)
#define TEXT(type, member)                                                                         \
  CYAML_FIELD_STRING_PTR(#member, OPTIONAL, type, member, 1, CYAML_UNLIMITED)
#define PART(type, member, fields) CYAML_FIELD_MAPPING_PTR(#member, OPTIONAL, type, member, fields)
#define VECTOR(type, member)                                                                       \
  CYAML_FIELD_SEQUENCE_FIXED(#member, CYAML_FLAG_DEFAULT, type, member, &number, 3)

static const cyaml_schema_value_t number = {CYAML_VALUE_FLOAT(CYAML_FLAG_DEFAULT, double)};
static const cyaml_schema_value_t point = {
    CYAML_VALUE_SEQUENCE_FIXED(CYAML_FLAG_DEFAULT, double, &number, 3)};
static const cyaml_schema_value_t text = {
    CYAML_VALUE_STRING(CYAML_FLAG_POINTER, char *, 1, CYAML_UNLIMITED)};

static const cyaml_strval_t material_names[] = {
    {"stvk", EP_STVK},
    {"stvk-volume", EP_STVK_VOLUME},
    {"neohookean", EP_STABLE_NEOHOOKEAN},
    {"corotational", EP_COROTATIONAL},
};
static const cyaml_strval_t force_names[] = {
    {"energy", EP_EXAMPLE_ENERGY},
    {"linear", EP_EXAMPLE_LINEAR},
};
static const cyaml_strval_t solver_names[] = {
    {"nlopt", EP_SOLVER_NLOPT},
    {"newton", EP_SOLVER_NEWTON},
};
static const cyaml_strval_t path_names[] = {
    {"lb", EP_METHOD_LB},
    {"green", EP_METHOD_GREEN},
    {"both", EP_METHOD_LB | EP_METHOD_GREEN},
};
static const cyaml_strval_t evaluator_names[] = {
    {"cubature", EP_EVALUATE_CUBATURE},
    {"cubic", EP_EVALUATE_CUBIC},
};
static const cyaml_strval_t precision_names[] = {
    {"double", EP_DOUBLE},
    {"float", EP_FLOAT},
};
static const cyaml_strval_t integrator_names[] = {
    {"implicit-euler", EP_IMPLICIT_EULER},
    {"newmark", EP_NEWMARK},
    {"bdf2", EP_BDF2},
};
static const cyaml_strval_t method_names[] = {
    {"cubature", EP_METHOD_CUBATURE},
    {"cubic", EP_METHOD_CUBIC},
    {"all", EP_METHOD_ALL},
    {"full", EP_METHOD_FULL},
};
static const cyaml_strval_t format_names[] = {
    {"vtu", EP_FORMAT_VTU},
    {"glb", EP_FORMAT_GLB},
    {"png", EP_FORMAT_PNG},
};

static const cyaml_schema_field_t box_fields[] = {
    VECTOR(raw_box, low),
    VECTOR(raw_box, high),
    CYAML_FIELD_END,
};
static const cyaml_schema_field_t plane_fields[] = {
    VECTOR(raw_plane, point),
    VECTOR(raw_plane, normal),
    CYAML_FIELD_END,
};
static const cyaml_schema_field_t selection_fields[] = {
    PART(raw_selection, box, box_fields),
    PART(raw_selection, plane, plane_fields),
    TEXT(raw_selection, file),
    TEXT(raw_selection, field),
    NUMBER(raw_selection, above),
    NUMBER(raw_selection, equals),
    CYAML_FIELD_END,
};
static const cyaml_schema_value_t selection = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, raw_selection, selection_fields)};

static const cyaml_schema_field_t material_fields[] = {
    CYAML_FIELD_ENUM_PTR("model", OPTIONAL | CYAML_FLAG_STRICT, raw_material, model, material_names,
                         CYAML_ARRAY_LEN(material_names)),
    NUMBER(raw_material, density),
    NUMBER(raw_material, young),
    NUMBER(raw_material, poisson),
    CYAML_FIELD_END,
};
static const cyaml_schema_field_t object_fields[] = {
    CYAML_FIELD_STRING_PTR("mesh", CYAML_FLAG_POINTER, raw_object, mesh, 1, CYAML_UNLIMITED),
    PART(raw_object, material, material_fields),
    CYAML_FIELD_END,
};

static const cyaml_strval_t frame_names[] = {
    {"automatic", EP_FRAME_AUTOMATIC},
    {"authored", EP_FRAME_AUTHORED},
};
static const cyaml_schema_field_t landmark_fields[] = {
    NUMBER(raw_landmark, object),
    NUMBER(raw_landmark, rest),
    CYAML_FIELD_SEQUENCE("object_at", OPTIONAL, raw_landmark, object_at, &number, 3, 3),
    CYAML_FIELD_SEQUENCE("rest_at", OPTIONAL, raw_landmark, rest_at, &number, 3, 3),
    CYAML_FIELD_SEQUENCE("poses", OPTIONAL, raw_landmark, poses, &number, 1, 64),
    CYAML_FIELD_SEQUENCE("poses_at", OPTIONAL, raw_landmark, poses_at, &point, 1, 64),
    CYAML_FIELD_END,
};
static const cyaml_schema_value_t landmark = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, raw_landmark, landmark_fields)};
static const cyaml_schema_field_t map_field_fields[] = {
    TEXT(raw_map_field, name), TEXT(raw_map_field, object),
    TEXT(raw_map_field, rest), TEXT(raw_map_field, poses),
    CYAML_FIELD_END,
};
static const cyaml_schema_value_t map_field = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, raw_map_field, map_field_fields)};
static const cyaml_schema_field_t map_fields[] = {
    TEXT(raw_map, regions),
    CYAML_FIELD_SEQUENCE("fields", OPTIONAL, raw_map, fields, &map_field, 0, 256),
    CYAML_FIELD_SEQUENCE("landmarks", OPTIONAL, raw_map, landmarks, &landmark, 0, 64),
    CYAML_FIELD_ENUM_PTR("frame", OPTIONAL | CYAML_FLAG_STRICT, raw_map, frame, frame_names,
                         CYAML_ARRAY_LEN(frame_names)),
    NUMBER(raw_map, eigenfunctions),
    CYAML_FIELD_BOOL_PTR("reflections", OPTIONAL, raw_map, reflections),
    CYAML_FIELD_BOOL_PTR("accept", OPTIONAL, raw_map, accept),
    CYAML_FIELD_END,
};
static const cyaml_schema_field_t region_fields[] = {
    TEXT(raw_region, name),
    PART(raw_region, box, box_fields),
    PART(raw_region, plane, plane_fields),
    TEXT(raw_region, file),
    TEXT(raw_region, field),
    NUMBER(raw_region, above),
    NUMBER(raw_region, equals),
    NUMBER(raw_region, soft),
    NUMBER(raw_region, eigenfunctions),
    NUMBER(raw_region, strength),
    CYAML_FIELD_END,
};
static const cyaml_schema_value_t region = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, raw_region, region_fields)};
static const cyaml_schema_field_t family_fields[] = {
    TEXT(raw_family, name),
    TEXT(raw_family, rest),
    CYAML_FIELD_SEQUENCE("poses", CYAML_FLAG_POINTER, raw_family, poses, &text, 1, 64),
    PART(raw_family, map, map_fields),
    PART(raw_family, region, region_fields),
    CYAML_FIELD_END,
};
static const cyaml_schema_value_t family = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, raw_family, family_fields)};

static const cyaml_schema_field_t reduction_fields[] = {
    NUMBER(raw_reduction, eigenfunctions),
    NUMBER(raw_reduction, modes),
    NUMBER(raw_reduction, linear_modes),
    NUMBER(raw_reduction, path_samples),
    NUMBER(raw_reduction, elements),
    NUMBER(raw_reduction, guards),
    NUMBER(raw_reduction, training_poses),
    CYAML_FIELD_ENUM_PTR("evaluator", OPTIONAL | CYAML_FLAG_STRICT, raw_reduction, evaluator,
                         evaluator_names, CYAML_ARRAY_LEN(evaluator_names)),
    NUMBER(raw_reduction, amplitude),
    CYAML_FIELD_END,
};

static const cyaml_schema_field_t damping_fields[] = {
    NUMBER(raw_damping, mass),
    NUMBER(raw_damping, stiffness),
    CYAML_FIELD_END,
};
static const cyaml_schema_field_t simulation_fields[] = {
    CYAML_FIELD_ENUM_PTR("precision", OPTIONAL | CYAML_FLAG_STRICT, raw_simulation, precision,
                         precision_names, CYAML_ARRAY_LEN(precision_names)),
    CYAML_FIELD_ENUM_PTR("integrator", OPTIONAL | CYAML_FLAG_STRICT, raw_simulation, integrator,
                         integrator_names, CYAML_ARRAY_LEN(integrator_names)),
    NUMBER(raw_simulation, dt),
    NUMBER(raw_simulation, steps),
    PART(raw_simulation, damping, damping_fields),
    CYAML_FIELD_END,
};

static const cyaml_schema_field_t constraints_fields[] = {
    NUMBER(raw_constraints, sum_to_one),
    NUMBER(raw_constraints, non_negative),
    CYAML_FIELD_END,
};
static const cyaml_schema_field_t examples_fields[] = {
    NUMBER(raw_examples, strength),
    NUMBER(raw_examples, relief),
    NUMBER(raw_examples, alpha),
    CYAML_FIELD_ENUM_PTR("path", OPTIONAL | CYAML_FLAG_STRICT, raw_examples, path, path_names,
                         CYAML_ARRAY_LEN(path_names)),
    PART(raw_examples, constraints, constraints_fields),
    CYAML_FIELD_ENUM_PTR("force", OPTIONAL | CYAML_FLAG_STRICT, raw_examples, force, force_names,
                         CYAML_ARRAY_LEN(force_names)),
    CYAML_FIELD_ENUM_PTR("solver", OPTIONAL | CYAML_FLAG_STRICT, raw_examples, solver, solver_names,
                         CYAML_ARRAY_LEN(solver_names)),
    TEXT(raw_examples, algorithm),
    CYAML_FIELD_END,
};

static const cyaml_schema_field_t push_fields[] = {
    PART(raw_push, box, box_fields),
    PART(raw_push, plane, plane_fields),
    TEXT(raw_push, file),
    TEXT(raw_push, field),
    NUMBER(raw_push, above),
    NUMBER(raw_push, equals),
    VECTOR(raw_push, force),
    NUMBER(raw_push, from),
    NUMBER(raw_push, until),
    NUMBER(raw_push, ramp),
    CYAML_FIELD_END,
};
static const cyaml_schema_field_t waypoint_fields[] = {
    CYAML_FIELD_FLOAT("time", CYAML_FLAG_DEFAULT, raw_waypoint, time),
    VECTOR(raw_waypoint, at),
    CYAML_FIELD_END,
};
static const cyaml_schema_value_t waypoint = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, raw_waypoint, waypoint_fields)};
static const cyaml_schema_field_t drag_fields[] = {
    PART(raw_drag, box, box_fields),
    PART(raw_drag, plane, plane_fields),
    TEXT(raw_drag, file),
    TEXT(raw_drag, field),
    NUMBER(raw_drag, above),
    NUMBER(raw_drag, equals),
    CYAML_FIELD_SEQUENCE("path", CYAML_FLAG_POINTER, raw_drag, path, &waypoint, 1, 100000),
    CYAML_FIELD_FLOAT("stiffness", CYAML_FLAG_DEFAULT, raw_drag, stiffness),
    NUMBER(raw_drag, damping),
    NUMBER(raw_drag, from),
    NUMBER(raw_drag, until),
    CYAML_FIELD_BOOL_PTR("smooth", OPTIONAL, raw_drag, smooth),
    CYAML_FIELD_END,
};
static const cyaml_schema_field_t pressure_fields[] = {
    PART(raw_pressure, box, box_fields),
    PART(raw_pressure, plane, plane_fields),
    TEXT(raw_pressure, file),
    TEXT(raw_pressure, field),
    NUMBER(raw_pressure, above),
    NUMBER(raw_pressure, equals),
    CYAML_FIELD_FLOAT("pascal", CYAML_FLAG_DEFAULT, raw_pressure, pascal),
    NUMBER(raw_pressure, from),
    NUMBER(raw_pressure, until),
    NUMBER(raw_pressure, ramp),
    CYAML_FIELD_END,
};
static const cyaml_schema_field_t load_fields[] = {
    CYAML_FIELD_SEQUENCE("gravity", OPTIONAL, raw_load, gravity, &number, 3, 3),
    PART(raw_load, push, push_fields),
    PART(raw_load, drag, drag_fields),
    PART(raw_load, pressure, pressure_fields),
    CYAML_FIELD_END,
};
static const cyaml_schema_value_t load = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, raw_load, load_fields)};

static const cyaml_schema_field_t turn_fields[] = {
    VECTOR(raw_turn, axis),
    CYAML_FIELD_FLOAT("degrees", CYAML_FLAG_DEFAULT, raw_turn, degrees),
    CYAML_FIELD_END,
};
static const cyaml_schema_field_t keyframe_fields[] = {
    CYAML_FIELD_FLOAT("time", CYAML_FLAG_DEFAULT, raw_keyframe, time),
    CYAML_FIELD_SEQUENCE("move", OPTIONAL, raw_keyframe, move, &number, 3, 3),
    PART(raw_keyframe, turn, turn_fields),
    CYAML_FIELD_END,
};
static const cyaml_schema_value_t keyframe = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, raw_keyframe, keyframe_fields)};
static const cyaml_schema_field_t sphere_fields[] = {
    VECTOR(raw_sphere, center),
    CYAML_FIELD_FLOAT("radius", CYAML_FLAG_DEFAULT, raw_sphere, radius),
    CYAML_FIELD_END,
};
static const cyaml_schema_field_t solid_box_fields[] = {
    VECTOR(raw_solid_box, low),
    VECTOR(raw_solid_box, high),
    PART(raw_solid_box, rotation, turn_fields),
    CYAML_FIELD_END,
};
static const cyaml_schema_field_t obstacle_fields[] = {
    PART(raw_obstacle, plane, plane_fields),
    PART(raw_obstacle, sphere, sphere_fields),
    PART(raw_obstacle, box, solid_box_fields),
    NUMBER(raw_obstacle, friction),
    CYAML_FIELD_SEQUENCE("motion", OPTIONAL, raw_obstacle, motion, &keyframe, 1, 100000),
    CYAML_FIELD_BOOL_PTR("smooth", OPTIONAL, raw_obstacle, smooth),
    CYAML_FIELD_END,
};
static const cyaml_schema_value_t obstacle = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, raw_obstacle, obstacle_fields)};
static const cyaml_schema_field_t contact_fields[] = {
    TEXT(raw_contact, stiffness), NUMBER(raw_contact, thickness), NUMBER(raw_contact, depth),
    NUMBER(raw_contact, damping), NUMBER(raw_contact, friction),  CYAML_FIELD_END,
};

static const cyaml_schema_value_t format = {
    CYAML_VALUE_ENUM(CYAML_FLAG_STRICT, int, format_names, CYAML_ARRAY_LEN(format_names))};
static const cyaml_schema_field_t output_fields[] = {
    NUMBER(raw_output, every),
    CYAML_FIELD_SEQUENCE("formats", OPTIONAL, raw_output, formats, &format, 0, 8),
    CYAML_FIELD_SEQUENCE("moments", OPTIONAL, raw_output, moments, &number, 0, EP_MOMENTS_MAX),
    CYAML_FIELD_END,
};

static const cyaml_schema_value_t method = {
    CYAML_VALUE_ENUM(CYAML_FLAG_STRICT, int, method_names, CYAML_ARRAY_LEN(method_names))};
static const cyaml_schema_value_t precision = {
    CYAML_VALUE_ENUM(CYAML_FLAG_STRICT, int, precision_names, CYAML_ARRAY_LEN(precision_names))};
static const cyaml_schema_value_t material_name = {
    CYAML_VALUE_ENUM(CYAML_FLAG_STRICT, int, material_names, CYAML_ARRAY_LEN(material_names))};
static const cyaml_schema_value_t path = {
    CYAML_VALUE_ENUM(CYAML_FLAG_STRICT, int, path_names, CYAML_ARRAY_LEN(path_names))};
static const cyaml_schema_field_t compare_fields[] = {
    CYAML_FIELD_SEQUENCE("modes", OPTIONAL, raw_compare, modes, &number, 1, EP_LIST_MAX),
    CYAML_FIELD_SEQUENCE("elements", OPTIONAL, raw_compare, elements, &number, 1, EP_LIST_MAX),
    CYAML_FIELD_SEQUENCE("methods", OPTIONAL, raw_compare, methods, &method, 1, EP_METHODS),
    CYAML_FIELD_SEQUENCE("materials", OPTIONAL, raw_compare, materials, &material_name, 1,
                         EP_MATERIALS),
    CYAML_FIELD_SEQUENCE("precisions", OPTIONAL, raw_compare, precisions, &precision, 1, 2),
    CYAML_FIELD_SEQUENCE("paths", OPTIONAL, raw_compare, paths, &path, 1, EP_PATHS),
    CYAML_FIELD_SEQUENCE("solvers", OPTIONAL, raw_compare, solvers, &text, 1, EP_LIST_MAX),
    CYAML_FIELD_SEQUENCE("dt", OPTIONAL, raw_compare, dt, &number, 1, EP_LIST_MAX),
    CYAML_FIELD_ENUM_PTR("reference", OPTIONAL | CYAML_FLAG_STRICT, raw_compare, reference,
                         method_names, CYAML_ARRAY_LEN(method_names)),
    TEXT(raw_compare, budget),
    CYAML_FIELD_END,
};

static const cyaml_schema_field_t start_fields[] = {
    CYAML_FIELD_SEQUENCE("position", OPTIONAL, raw_start, position, &number, 3, 3),
    PART(raw_start, rotation, turn_fields),
    CYAML_FIELD_SEQUENCE("velocity", OPTIONAL, raw_start, velocity, &number, 3, 3),
    CYAML_FIELD_SEQUENCE("spin", OPTIONAL, raw_start, spin, &number, 3, 3),
    CYAML_FIELD_END,
};

static const cyaml_schema_field_t scene_fields[] = {
    CYAML_FIELD_FLOAT("schema", CYAML_FLAG_DEFAULT, raw_scene, schema),
    TEXT(raw_scene, name),
    NUMBER(raw_scene, seed),
    CYAML_FIELD_MAPPING("object", CYAML_FLAG_DEFAULT, raw_scene, object, object_fields),
    CYAML_FIELD_SEQUENCE("fixed", OPTIONAL, raw_scene, fixed, &selection, 0, 256),
    CYAML_FIELD_SEQUENCE("regions", OPTIONAL, raw_scene, regions, &region, 0, 64),
    CYAML_FIELD_SEQUENCE("families", OPTIONAL, raw_scene, families, &family, 0, 64),
    PART(raw_scene, reduction, reduction_fields),
    PART(raw_scene, simulation, simulation_fields),
    PART(raw_scene, examples, examples_fields),
    CYAML_FIELD_SEQUENCE("loads", OPTIONAL, raw_scene, loads, &load, 0, 256),
    CYAML_FIELD_SEQUENCE("obstacles", OPTIONAL, raw_scene, obstacles, &obstacle, 0, 10000),
    PART(raw_scene, contact, contact_fields),
    PART(raw_scene, start, start_fields),
    PART(raw_scene, output, output_fields),
    PART(raw_scene, compare, compare_fields),
    CYAML_FIELD_END,
};
// NOLINTEND

const cyaml_schema_value_t ep_scene_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, raw_scene, scene_fields)};
