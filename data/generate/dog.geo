// Toy dog [m]: nose towards +x, y up.
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
a = 0.45; b = 0.175; c = 0.16; px = 0; py = 0; pz = 0; // trunk
Call Blob;
turn = 0.85;
a = 0.25; b = 0.12; c = 0.115; px = 0.42; py = 0.15; // neck
Call Blob;
turn = 0;
a = 0.165; b = 0.15; c = 0.14; px = 0.56; py = 0.34; // head
Call Blob;
turn = -0.15;
a = 0.15; b = 0.08; c = 0.085; px = 0.71; py = 0.29; // snout
Call Blob;
turn = 2.45;
a = 0.28; b = 0.062; c = 0.062; px = -0.56; py = 0.22; // tail
Call Blob;
For side In {0:1}
  s = 1 - 2 * side;
  turn = Pi / 2 + 0.15;
  a = 0.135; b = 0.08; c = 0.05; px = 0.495; py = 0.455; pz = s * 0.095; // ear
  Call Blob;
  For front In {0:1}
    turn = Pi / 2;
    a = 0.26; b = 0.088; c = 0.082; px = front * 0.56 - 0.28; py = -0.24; pz = s * 0.105; // leg
    Call Blob;
    turn = 0;
    a = 0.115; b = 0.07; c = 0.08; px = px + 0.035; py = -0.45; pz = s * 0.11; // paw
    Call Blob;
  EndFor
EndFor

whole() = BooleanUnion { Volume{parts(0)}; Delete; } { Volume{parts({1 : #parts() - 1})}; Delete; };
Physical Volume("dog") = {whole()};
Mesh.MeshSizeMin = size;
Mesh.MeshSizeMax = size;
Mesh.Algorithm = 6;    // frontal
Mesh.Algorithm3D = 10; // HXT
Mesh.OptimizeThreshold = 0.5;
