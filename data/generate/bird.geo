// Bird, wings spread [m]: beak towards +x, y up, wings along z.
SetFactory("OpenCASCADE");
DefineConstant[size = {0.066, Name "size"}];

// A slab lofted between two rectangles in planes z = z0 and z = z1.
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

// body, head, beak
Sphere(1) = {0, 0, 0, 1};
Rotate {{0, 1, 0}, {0, 0, 0}, Pi / 2} { Volume{1}; } // poles to the ends
Dilate {{0, 0, 0}, {0.60, 0.18, 0.18}} { Volume{1}; }
Sphere(2) = {0.58, 0.12, 0, 0.15};
Cone(3) = {0.66, 0.11, 0, 0.26, -0.05, 0, 0.085, 0.02};
parts() = {2, 3};

For side In {0:1}
  s = 1 - 2 * side;
  // inner wing, swept forward to the wrist, and hand, swept back to the tip
  lead0 = 0.26; chord0 = 0.48; y0 = 0.03; t0 = 0.11; z0 = 0;
  lead1 = 0.34; chord1 = 0.46; y1 = 0.05; t1 = 0.08; z1 = s * 0.50;
  Call Wing;
  parts() += {v};
  lead0 = lead1; chord0 = chord1; y0 = y1; t0 = t1; z0 = z1;
  lead1 = 0.10; chord1 = 0.20; y1 = 0.04; t1 = 0.055; z1 = s * 1.05;
  Call Wing;
  parts() += {v};
EndFor

// tail fan, lofted backwards: made along z and turned
lead0 = 0.09; chord0 = 0.18; y0 = 0.02; t0 = 0.08; z0 = 0.36;
lead1 = 0.29; chord1 = 0.58; y1 = 0.02; t1 = 0.06; z1 = 0.95;
Call Wing;
Rotate {{0, 1, 0}, {0, 0, 0}, -Pi / 2} { Volume{v}; }
parts() += {v};

whole() = BooleanUnion { Volume{1}; Delete; } { Volume{parts()}; Delete; };
Physical Volume("bird") = {whole()};
Mesh.MeshSizeMin = size;
Mesh.MeshSizeMax = size;
Mesh.Algorithm = 6;    // frontal
Mesh.Algorithm3D = 10; // HXT
Mesh.OptimizeThreshold = 0.5;
