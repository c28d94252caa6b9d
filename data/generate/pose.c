// Makes the deformed example meshes of data/: reads a Gmsh 2.2 ASCII mesh, bends it by a formula,
// writes a .veg file with the same connectivity, and prints the quality of what it wrote.
//
//   pose none|twist|s-bend|raise|twist-left|bend-right DEGREES IN.msh OUT.veg
//
// It stands alone (cc pose.c -lm), so that the data can be made before anything else is built.
#include <math.h>
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

static tets read_mesh(const char *path) {
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

// Smooth step from 0 to 1 on [0, 1].
static double smooth(double t) {
  t = t < 0 ? 0 : t > 1 ? 1 : t;
  return t * t * (3 - 2 * t);
}

// A beam's centre line of slope angle(s), started at the origin: its point at length s.
static void centre_line(double (*angle)(double s, double degrees), double degrees, double s,
                        double *along, double *up) {
  const int steps = 400;
  const double h = s / steps;
  *along = *up = 0;
  for (int i = 0; i < steps; i++) {
    const double a = angle((i + 0.5) * h, degrees);
    *along += h * cos(a);
    *up += h * sin(a);
  }
}

// Slope of the S: level at both ends, steepest in the middle (bar of length 1).
static double s_angle(double s, double degrees) {
  return degrees * pi / 180 * 0.5 * (1 - cos(2 * pi * s));
}

// Slope of a raised wing: level at the body, full from s = 0.5 on.
static double wing_angle(double s, double degrees) {
  return degrees * pi / 180 * smooth(s / 0.5);
}

static void twist(double *x, double degrees) {
  const double a = degrees * pi / 180 * x[0], y = x[1], z = x[2];
  x[1] = cos(a) * y - sin(a) * z;
  x[2] = sin(a) * y + cos(a) * z;
}

// Sections stay plane and normal to the centre line (Bernoulli).
static void s_bend(double *x, double degrees) {
  double along, up;
  const double s = x[0] + 0.5, a = s_angle(s, degrees), y = x[1];
  centre_line(s_angle, degrees, s, &along, &up);
  x[0] = -0.5 + along - sin(a) * y;
  x[1] = up + cos(a) * y;
}

static void raise_wings(double *x, double degrees) {
  const double inner = 0.12, s = fabs(x[2]) - inner, y = x[1];
  if (s <= 0) return;
  double along, up;
  const double a = wing_angle(s, degrees), side = x[2] < 0 ? -1 : 1;
  centre_line(wing_angle, degrees, s, &along, &up);
  x[2] = side * (inner + along - sin(a) * y);
  x[1] = up + cos(a) * y;
}

// The part x < -0.06 twists about the axis, full angle at the end x = -0.5.
static void twist_left(double *x, double degrees) {
  const double a = degrees * pi / 180 * smooth((-x[0] - 0.06) / 0.44), y = x[1], z = x[2];
  x[1] = cos(a) * y - sin(a) * z;
  x[2] = sin(a) * y + cos(a) * z;
}

// Slope of the bent right end: level at x = 0.06, full from half of the rest on.
static double end_angle(double s, double degrees) {
  return degrees * pi / 180 * smooth(s / 0.22);
}

static void bend_right(double *x, double degrees) {
  const double s = x[0] - 0.06, y = x[1];
  if (s <= 0) return;
  double along, up;
  const double a = end_angle(s, degrees);
  centre_line(end_angle, degrees, s, &along, &up);
  x[0] = 0.06 + along - sin(a) * y;
  x[1] = up + cos(a) * y;
}

static double dot(const double *a, const double *b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double *a, const double *b, double *c) {
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

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

int main(int argc, char **argv) {
  if (argc != 5)
    die("usage: pose none|twist|s-bend|raise|twist-left|bend-right DEGREES IN.msh OUT.veg",
        "arguments");
  static const struct {
    const char *name;
    void (*deform)(double *x, double degrees);
  } kinds[] = {{"none", NULL},         {"twist", twist},           {"s-bend", s_bend},
               {"raise", raise_wings}, {"twist-left", twist_left}, {"bend-right", bend_right}};
  const size_t count = sizeof kinds / sizeof kinds[0];
  size_t kind = 0;
  while (kind < count && strcmp(argv[1], kinds[kind].name) != 0) kind++;
  char *end;
  const double degrees = strtod(argv[2], &end);
  if (kind == count || *end) die("unknown deformation or angle", argv[1]);
  tets mesh = read_mesh(argv[3]);
  for (int v = 0; v < mesh.nv && kinds[kind].deform; v++)
    kinds[kind].deform(mesh.x + 3 * (size_t)v, degrees);
  report(&mesh, argv[4]);
  write_veg(&mesh, argv[4]);
  free(mesh.x);
  free(mesh.tet);
  return 0;
}
