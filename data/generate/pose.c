// Makes the deformed example meshes of data/: reads a Gmsh 2.2 ASCII or a .veg mesh, deforms it by
// formulas, writes a .veg file with the same connectivity, and prints the quality of what it wrote.
//
//   pose IN OUT.veg [DEFORMATION NUMBERS...]...
//
// Deformations, one after the other; P is a point, D and U are directions (x,y,z), s the distance
// from P along D:
//   twist P D LENGTH DEGREES    sections turned about the axis, evenly, DEGREES over LENGTH about P
//   turn P D LENGTH DEGREES     sections s > 0 turned: smoothly up to LENGTH, by DEGREES from there
//   on joint P D U LENGTH DEGREES  a beam that starts at P bends towards U: smoothly up to LENGTH
//   arc P D U LENGTH DEGREES    the same with even curvature
//   s P D U LENGTH DEGREES      level at both ends, its slope DEGREES in the middle
//   stretch P D FACTOR          along D by FACTOR, across by 1/sqrt(FACTOR)
//   within P RADIUS             the next deformation moves what is in this ball alone
//
// It stands alone (cc pose.c -lm), so that the data can be made before anything else is built.
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double pi = 3.14159265358979323846;

typedef struct tets {
  int nv, nt;
  double *x; // (nv x 3)
  int *tet;  // (nt x 4) from 0
} tets;

static void die(const char *what, const char *where) {
  fprintf(stderr, "pose: %s: %s\n", where, what);
  exit(1);
}

static void *need(size_t count, size_t size) {
  void *p = calloc(count, size);
  if (!p) die("out of memory", "mesh");
  return p;
}

static void find_section(FILE *file, const char *name, const char *path) {
  char line[512];
  while (fgets(line, sizeof line, file))
    if (strncmp(line, name, strlen(name)) == 0) return;
  die("not a Gmsh 2.2 ASCII mesh (section missing)", path);
}

static tets read_msh(const char *path) {
  FILE *file = fopen(path, "r");
  if (!file) die("cannot open", path);
  tets mesh = {0};
  int type, tags, n[4];
  find_section(file, "$Nodes", path);
  if (fscanf(file, "%d", &mesh.nv) != 1 || mesh.nv < 4) die("bad node count", path);
  mesh.x = need((size_t)mesh.nv * 3, sizeof *mesh.x);
  for (int v = 0; v < mesh.nv; v++) {
    double *x = mesh.x + 3 * (size_t)v;
    if (fscanf(file, "%d %lf %lf %lf", &type, x, x + 1, x + 2) != 4 || type != v + 1)
      die("bad node, or nodes not numbered from 1", path);
  }
  find_section(file, "$Elements", path);
  int count;
  if (fscanf(file, "%d", &count) != 1 || count < 1) die("bad element count", path);
  mesh.tet = need((size_t)count * 4, sizeof *mesh.tet);
  for (int e = 0; e < count; e++) {
    if (fscanf(file, "%*d %d %d", &type, &tags) != 2 || type != 4)
      die("only tets wanted: save physical volumes alone", path);
    for (; tags > 0; tags--)
      if (fscanf(file, "%*d") != 0) die("bad tag", path);
    if (fscanf(file, "%d %d %d %d", n, n + 1, n + 2, n + 3) != 4) die("bad tet", path);
    for (int i = 0; i < 4; i++) mesh.tet[4 * (size_t)mesh.nt + (size_t)i] = n[i] - 1;
    mesh.nt++;
  }
  fclose(file);
  return mesh;
}

// The .veg files written below: numbered from 1, one set of tets.
static tets read_veg(const char *path) {
  FILE *file = fopen(path, "r");
  if (!file) die("cannot open", path);
  tets mesh = {0};
  int number, n[4];
  find_section(file, "*VERTICES", path);
  if (fscanf(file, "%d 3 0 0", &mesh.nv) != 1 || mesh.nv < 4) die("bad vertex count", path);
  mesh.x = need((size_t)mesh.nv * 3, sizeof *mesh.x);
  for (int v = 0; v < mesh.nv; v++) {
    double *x = mesh.x + 3 * (size_t)v;
    if (fscanf(file, "%d %lf %lf %lf", &number, x, x + 1, x + 2) != 4 || number != v + 1)
      die("bad vertex, or vertices not numbered from 1", path);
  }
  find_section(file, "TET", path);
  if (fscanf(file, "%d 4 0", &mesh.nt) != 1 || mesh.nt < 1) die("bad tet count", path);
  mesh.tet = need((size_t)mesh.nt * 4, sizeof *mesh.tet);
  for (int e = 0; e < mesh.nt; e++) {
    if (fscanf(file, "%*d %d %d %d %d", n, n + 1, n + 2, n + 3) != 4) die("bad tet", path);
    for (int i = 0; i < 4; i++) mesh.tet[4 * (size_t)e + (size_t)i] = n[i] - 1;
  }
  fclose(file);
  return mesh;
}

static tets read_mesh(const char *path) {
  const char *dot = strrchr(path, '.');
  return dot && strcmp(dot, ".veg") == 0 ? read_veg(path) : read_msh(path);
}

// ---- formulas ----------------------------------------------------------------------------------

typedef struct deformation {
  double point[3], along[3], up[3], side[3]; // an orthonormal frame; `up`, `side` where needed
  double length, angle;                      // angle [rad]; a stretch keeps its factor in length
  double ball[4];                            // centre and radius; radius 0: everything
} deformation;

static double dot(const double *a, const double *b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double *a, const double *b, double *c) {
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

static double clamp(double t, double low, double high) {
  return t < low ? low : t > high ? high : t;
}

// Slopes of a beam at the share t of its length, as shares of the full angle.
static double joint_slope(double t) {
  t = clamp(t, 0, 1);
  return t * t * (3 - 2 * t);
}
static double arc_slope(double t) {
  return clamp(t, 0, 1);
}
static double s_slope(double t) {
  return 0.5 * (1 - cos(2 * pi * clamp(t, 0, 1)));
}

// Coordinates in the frame and back.
static void to_frame(const deformation *d, const double *x, double *local) {
  const double e[3] = {x[0] - d->point[0], x[1] - d->point[1], x[2] - d->point[2]};
  local[0] = dot(e, d->along);
  local[1] = dot(e, d->up);
  local[2] = dot(e, d->side);
}
static void from_frame(const deformation *d, const double *local, double *x) {
  for (int k = 0; k < 3; k++)
    x[k] = d->point[k] + local[0] * d->along[k] + local[1] * d->up[k] + local[2] * d->side[k];
}

static void turn_section(double *local, double angle) {
  const double u = local[1], w = local[2];
  local[1] = cos(angle) * u - sin(angle) * w;
  local[2] = sin(angle) * u + cos(angle) * w;
}

static void twist(const deformation *d, double *local) {
  turn_section(local, d->angle * clamp(local[0] / d->length, -0.5, 0.5));
}
static void turn(const deformation *d, double *local) {
  turn_section(local, d->angle * joint_slope(local[0] / d->length));
}

// Sections stay plane and normal to the centre line (Bernoulli).
static void bend(const deformation *d, double *local, double (*slope)(double t)) {
  if (local[0] <= 0) return;
  const int steps = 400;
  const double h = local[0] / steps, a = d->angle * slope(local[0] / d->length), u = local[1];
  double along = 0, up = 0;
  for (int i = 0; i < steps; i++) {
    const double b = d->angle * slope((i + 0.5) * h / d->length);
    along += h * cos(b);
    up += h * sin(b);
  }
  local[0] = along - sin(a) * u;
  local[1] = up + cos(a) * u;
}
static void joint(const deformation *d, double *local) {
  bend(d, local, joint_slope);
}
static void arc(const deformation *d, double *local) {
  bend(d, local, arc_slope);
}
static void s_bend(const deformation *d, double *local) {
  bend(d, local, s_slope);
}

static void stretch(const deformation *d, double *local) {
  local[0] *= d->length;
  local[1] /= sqrt(d->length);
  local[2] /= sqrt(d->length);
}

static void apply(tets *mesh, const deformation *d,
                  void (*formula)(const deformation *d, double *local)) {
  for (int v = 0; v < mesh->nv; v++) {
    double *x = mesh->x + 3 * (size_t)v, local[3];
    const double e[3] = {x[0] - d->ball[0], x[1] - d->ball[1], x[2] - d->ball[2]};
    if (d->ball[3] > 0 && dot(e, e) > d->ball[3] * d->ball[3]) continue;
    to_frame(d, x, local);
    formula(d, local);
    from_frame(d, local, x);
  }
}

// ---- what it makes -----------------------------------------------------------------------------

// Six times the volume, and 3 inradius / circumradius (1 for a regular tet).
static double quality(const double *x, const int *tet, double *ratio) {
  double e[3][3], n[3][3], p[3], area = 0;
  for (int i = 0; i < 3; i++)
    for (int k = 0; k < 3; k++) e[i][k] = x[3 * tet[i + 1] + k] - x[3 * tet[0] + k];
  for (int i = 0; i < 3; i++) cross(e[(i + 1) % 3], e[(i + 2) % 3], n[i]);
  const double six = dot(e[0], n[0]);
  for (int k = 0; k < 3; k++) {
    p[k] = dot(e[0], e[0]) * n[0][k] + dot(e[1], e[1]) * n[1][k] + dot(e[2], e[2]) * n[2][k];
  }
  double sum[3] = {0};
  for (int i = 0; i < 3; i++) {
    area += sqrt(dot(n[i], n[i]));
    for (int k = 0; k < 3; k++) sum[k] += n[i][k];
  }
  area += sqrt(dot(sum, sum));
  const double inradius = six / area, circumradius = sqrt(dot(p, p)) / (2 * fabs(six));
  *ratio = 3 * inradius / circumradius;
  return six;
}

static void report(const tets *mesh, const char *path) {
  double worst = 1, total = 0;
  for (int e = 0; e < mesh->nt; e++) {
    double ratio;
    total += quality(mesh->x, mesh->tet + 4 * (size_t)e, &ratio) / 6;
    if (ratio < worst) worst = ratio;
  }
  printf("%-34s %5d vertices %5d tets, volume %.5f, worst radius ratio %.3f\n", path, mesh->nv,
         mesh->nt, total, worst);
  if (worst <= 0.05) die("a tet is inverted or nearly flat", path);
}

static void write_veg(const tets *mesh, const char *path) {
  FILE *file = fopen(path, "w");
  if (!file) die("cannot write", path);
  fprintf(file, "*VERTICES\n%d 3 0 0\n", mesh->nv);
  for (int v = 0; v < mesh->nv; v++) {
    const double *x = mesh->x + 3 * (size_t)v;
    fprintf(file, "%d %.7g %.7g %.7g\n", v + 1, x[0], x[1], x[2]);
  }
  fprintf(file, "\n*ELEMENTS\nTET\n%d 4 0\n", mesh->nt);
  for (int e = 0; e < mesh->nt; e++) {
    const int *t = mesh->tet + 4 * (size_t)e;
    fprintf(file, "%d %d %d %d %d\n", e + 1, t[0] + 1, t[1] + 1, t[2] + 1, t[3] + 1);
  }
  if (fclose(file) != 0) die("cannot write all of it", path);
}

// ---- arguments ---------------------------------------------------------------------------------

static double number(const char *text) {
  char *end;
  const double value = strtod(text, &end);
  if (end == text || *end || !isfinite(value)) die("a number is expected", text);
  return value;
}

static void triple(const char *text, double *x) {
  int end = 0;
  if (sscanf(text, "%lf,%lf,%lf%n", x, x + 1, x + 2, &end) != 3 || text[end])
    die("three numbers x,y,z are expected", text);
}

static void normalise(double *x, const char *text) {
  const double length = sqrt(dot(x, x));
  if (!(length > 0)) die("a direction of length 0", text);
  for (int k = 0; k < 3; k++) x[k] /= length;
}

// The frame about `along`; `up` is what was given or, where `any`, any direction across.
static void make_frame(deformation *d, bool any, const char *text) {
  normalise(d->along, text);
  if (any) {
    const int axis = fabs(d->along[0]) < 0.7 ? 0 : 1;
    for (int k = 0; k < 3; k++) d->up[k] = k == axis;
  }
  const double share = dot(d->up, d->along);
  for (int k = 0; k < 3; k++) d->up[k] -= share * d->along[k];
  normalise(d->up, text);
  cross(d->along, d->up, d->side);
}

// One deformation from its arguments; returns how many of them it used.
static int perform(tets *mesh, deformation *d, int argc, char **argv) {
  static const struct {
    const char *name;
    void (*formula)(const deformation *d, double *local);
    int arguments; // after the name
  } kinds[] = {{"twist", twist, 4}, {"turn", turn, 4},   {"joint", joint, 5},    {"arc", arc, 5},
               {"s", s_bend, 5},    {"within", NULL, 2}, {"stretch", stretch, 3}};
  const size_t count = sizeof kinds / sizeof *kinds;
  size_t kind = 0;
  while (kind < count && strcmp(argv[0], kinds[kind].name) != 0) kind++;
  if (kind == count) die("unknown deformation", argv[0]);
  const int wanted = kinds[kind].arguments;
  if (argc <= wanted) die("numbers are missing", argv[0]);
  triple(argv[1], d->point);
  if (!kinds[kind].formula) {
    memcpy(d->ball, d->point, sizeof d->point);
    d->ball[3] = number(argv[2]);
    return 1 + wanted;
  }
  triple(argv[2], d->along);
  if (wanted == 5) triple(argv[3], d->up);
  make_frame(d, wanted != 5, argv[2]);
  d->length = number(argv[wanted == 3 ? 3 : wanted - 1]);
  if (!(d->length > 0)) die("a length or factor above 0 is expected", argv[0]);
  d->angle = wanted == 3 ? 0 : number(argv[wanted]) * pi / 180;
  apply(mesh, d, kinds[kind].formula);
  d->ball[3] = 0;
  return 1 + wanted;
}

int main(int argc, char **argv) {
  if (argc < 3) die("usage: pose IN OUT.veg [DEFORMATION NUMBERS...]...", "arguments");
  tets mesh = read_mesh(argv[1]);
  deformation d = {0};
  for (int i = 3; i < argc;) i += perform(&mesh, &d, argc - i, argv + i);
  report(&mesh, argv[2]);
  write_veg(&mesh, argv[2]);
  free(mesh.x);
  free(mesh.tet);
  return 0;
}
