// Toy plane [m]: nose towards +x, y up, wings along z.
SetFactory("OpenCASCADE");

// A slab lofted between two rectangles in planes z = z0 and z = z1 (leading edge, chord, height,
// thickness at each end).
Macro Wing
  p = newp;
  Point(p) = {lead0, y0 - t0 / 2, z0};
  Point(p + 1) = {lead0 - chord0, y0 - t0 / 2, z0};
  Point(p + 2) = {lead0 - chord0, y0 + t0 / 2, z0};
  Point(p + 3) = {lead0, y0 + t0 / 2, z0};
  Point(p + 4) = {lead1, y1 - t1 / 2, z1};
  Point(p + 5) = {lead1 - chord1, y1 - t1 / 2, z1};
  Point(p + 6) = {lead1 - chord1, y1 + t1 / 2, z1};
  Point(p + 7) = {lead1, y1 + t1 / 2, z1};
  l = newl;
  Line(l) = {p, p + 1}; Line(l + 1) = {p + 1, p + 2};
  Line(l + 2) = {p + 2, p + 3}; Line(l + 3) = {p + 3, p};
  Line(l + 4) = {p + 4, p + 5}; Line(l + 5) = {p + 5, p + 6};
  Line(l + 6) = {p + 6, p + 7}; Line(l + 7) = {p + 7, p + 4};
  c = newll;
  Wire(c) = {l, l + 1, l + 2, l + 3};
  Wire(c + 1) = {l + 4, l + 5, l + 6, l + 7};
  v = newv;
  Ruled ThruSections(v) = {c, c + 1};
Return

Sphere(1) = {0, 0, 0, 1};
// poles to the ends: the surface mesher works in parameters, and stretched poles spoil it
Rotate {{0, 1, 0}, {0, 0, 0}, Pi / 2} { Volume{1}; }
Dilate {{0, 0, 0}, {0.85, 0.15, 0.15}} { Volume{1}; }
Translate {0.05, 0, 0} { Volume{1}; }
parts() = {};

For side In {0:1}
  s = 1 - 2 * side;
  // main wing: root inside the fuselage
  lead0 = 0.30; chord0 = 0.42; y0 = -0.02; t0 = 0.10; z0 = 0;
  lead1 = 0.18; chord1 = 0.26; y1 = 0.01; t1 = 0.06; z1 = s * 1.0;
  Call Wing;
  parts() += {v};
  // tailplane
  lead0 = -0.44; chord0 = 0.24; y0 = 0; t0 = 0.07; z0 = 0;
  lead1 = -0.54; chord1 = 0.16; y1 = 0; t1 = 0.06; z1 = s * 0.36;
  Call Wing;
  parts() += {v};
EndFor

// fin: a tailplane half turned upwards
lead0 = -0.42; chord0 = 0.26; y0 = 0; t0 = 0.07; z0 = 0;
lead1 = -0.56; chord1 = 0.15; y1 = 0; t1 = 0.06; z1 = 0.36;
Call Wing;
Rotate {{1, 0, 0}, {0, 0, 0}, -Pi / 2} { Volume{v}; }
parts() += {v};

whole() = BooleanUnion { Volume{1}; Delete; } { Volume{parts()}; Delete; };
Physical Volume("plane") = {whole()};
Mesh.MeshSizeMin = 0.068;
Mesh.MeshSizeMax = 0.068;
Mesh.Algorithm = 6;    // frontal
Mesh.Algorithm3D = 10; // HXT
Mesh.OptimizeThreshold = 0.5;
