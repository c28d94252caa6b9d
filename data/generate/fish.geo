// Toy fish [m]: head towards +x, y up.
SetFactory("OpenCASCADE");
DefineConstant[size = {0.062, Name "size"}];

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
a = 0.56; b = 0.27; c = 0.15; px = 0.14; py = 0; pz = 0; // body
Call Blob;
a = 0.34; b = 0.10; c = 0.075; px = -0.40; py = 0.01; // root of the tail
Call Blob;
a = 0.13; b = 0.09; c = 0.08; px = 0.63; py = -0.02; // mouth
Call Blob;
turn = 0.95;
a = 0.25; b = 0.095; c = 0.05; px = -0.75; py = -0.16; // tail fin, lower lobe
Call Blob;
turn = -0.95;
a = 0.28; b = 0.095; c = 0.05; py = 0.20; // and upper lobe
Call Blob;
turn = -0.45;
a = 0.28; b = 0.12; c = 0.05; px = 0.02; py = 0.27; // back fin
Call Blob;
turn = 0.6;
a = 0.16; b = 0.08; c = 0.048; px = -0.10; py = -0.28; // belly fin
Call Blob;
// side fins, half turned outwards
For side In {0:1}
  s = 1 - 2 * side;
  v = newv;
  Sphere(v) = {0, 0, 0, 1};
  Rotate {{0, 1, 0}, {0, 0, 0}, Pi / 2} { Volume{v}; }
  Dilate {{0, 0, 0}, {0.10, 0.048, 0.20}} { Volume{v}; }
  Rotate {{0, 1, 0}, {0, 0, 0}, -s * 0.5} { Volume{v}; }
  Rotate {{1, 0, 0}, {0, 0, 0}, s * 0.35} { Volume{v}; }
  Translate {0.22, -0.10, s * 0.24} { Volume{v}; }
  parts() += {v};
EndFor

whole() = BooleanUnion { Volume{parts(0)}; Delete; } { Volume{parts({1 : #parts() - 1})}; Delete; };
Physical Volume("fish") = {whole()};
Mesh.MeshSizeMin = size;
Mesh.MeshSizeMax = size;
Mesh.Algorithm = 6;    // frontal
Mesh.Algorithm3D = 10; // HXT
Mesh.OptimizeThreshold = 0.5;
