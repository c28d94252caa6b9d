// A small box of tets as a .veg file, and texts as files.
#ifndef EP_TESTS_APP_BOX_H
#define EP_TESTS_APP_BOX_H

// (nx x ny x nz) cubic cells, six tets each (Kuhn). Length lx along x; bend is a deflection in y:
// y += bend x^2. Material is written where young > 0.
void write_box(const char *path, int nx, int ny, int nz, double lx, double bend, double young);

void write_text(const char *path, const char *text);

#endif
