// Teddy bear [m]: y up, facing +z, arms held out to the sides. `slim` makes the slender one the
// examples are made of; `size` chooses the resolution.
SetFactory("OpenCASCADE");
DefineConstant[size = {0.072, Name "size"}, slim = {0, Name "slim"}];

// An ellipsoid of half axes a (x), b (y), c (z) about (px, py, pz), turned by `turn` about z.
// Poles lie along x: the surface mesher works in parameters, and stretched poles spoil it.
Macro Blob
  v = newv;
  Sphere(v) = {0, 0, 0, 1};
  Rotate {{0, 1, 0}, {0, 0, 0}, Pi / 2} { Volume{v}; }
  Dilate {{0, 0, 0}, {a, b, c}} { Volume{v}; }
  Rotate {{0, 0, 1}, {0, 0, 0}, turn} { Volume{v}; }
  Translate {px, py, pz} { Volume{v}; }
  parts() += {v};
Return

parts() = {};
turn = 0;
a = 0.27 - 0.04 * slim; b = 0.31 + 0.03 * slim; c = 0.23 - 0.03 * slim; // belly
px = 0; py = 0; pz = 0;
Call Blob;
a = 0.22; b = 0.20 + 0.01 * slim; c = 0.20; py = 0.45 + 0.02 * slim; pz = 0.01; // head
Call Blob;
a = 0.10; b = 0.085; c = 0.11; py = 0.39 + 0.02 * slim; pz = 0.205; // muzzle
Call Blob;
For side In {0:1}
  s = 1 - 2 * side;
  turn = 0;
  a = 0.09; b = 0.09; c = 0.065; px = s * 0.17; py = 0.61 + 0.03 * slim; pz = 0; // ear
  Call Blob;
  turn = s * -0.25;
  a = 0.25 + 0.03 * slim; b = 0.105 - 0.01 * slim; c = 0.105 - 0.01 * slim; // arm
  px = s * (0.37 + 0.01 * slim); py = 0.14; pz = 0.02;
  Call Blob;
  turn = s * (Pi / 2 - 0.33) + (1 - s) / 2 * Pi;
  a = 0.30 + 0.03 * slim; b = 0.13 - 0.01 * slim; c = 0.13 - 0.01 * slim; // leg
  px = s * -0.21; py = -0.38 - 0.02 * slim; pz = 0.02;
  Call Blob;
  turn = 0;
  a = 0.115; b = 0.10; c = 0.16; px = s * 0.29; py = -0.61 - 0.04 * slim; pz = 0.09; // foot
  Call Blob;
EndFor

whole() = BooleanUnion { Volume{parts(0)}; Delete; } { Volume{parts({1 : #parts() - 1})}; Delete; };
Physical Volume("teddy") = {whole()};
Mesh.MeshSizeMin = size;
Mesh.MeshSizeMax = size;
Mesh.Algorithm = 6;    // frontal
Mesh.Algorithm3D = 10; // HXT
Mesh.OptimizeThreshold = 0.5;
