// Shoe [m]: toe towards +x, y up: a sole with a heel, and an upper that is open at the ankle.
SetFactory("OpenCASCADE");
DefineConstant[size = {0.062, Name "size"}];

// An ellipsoid of half axes a (x), b (y), c (z) about (px, py, pz). Poles lie along x: the surface
// mesher works in parameters, and stretched poles spoil it.
Macro Blob
  v = newv;
  Sphere(v) = {0, 0, 0, 1};
  Rotate {{0, 1, 0}, {0, 0, 0}, Pi / 2} { Volume{v}; }
  Dilate {{0, 0, 0}, {a, b, c}} { Volume{v}; }
  Translate {px, py, pz} { Volume{v}; }
Return

// Outline of the sole, from the heel round one side, the toe, the other side.
xs() = {-0.52, -0.42, -0.10, 0.22, 0.45, 0.54, 0.40, 0.15, -0.15, -0.42};
zs() = {0.00, -0.16, -0.155, -0.20, -0.14, 0.03, 0.18, 0.20, 0.165, 0.16};
n = #xs();
For i In {0 : n - 1}
  Point(i + 1) = {xs(i), -0.16, zs(i)};
EndFor
BSpline(1) = {1 : n, 1};
Curve Loop(1) = {1};
Plane Surface(1) = {1};
e() = Extrude {0, 0.085, 0} { Surface{1}; };
sole = e(1);
// upper: toe box and shaft, hollow above the sole
a = 0.41; b = 0.22; c = 0.145; px = 0.07; py = -0.09; pz = 0.005;
Call Blob;
toe = v;
a = 0.41 - 0.065; b = 0.22 - 0.065; c = 0.145 - 0.065;
Call Blob;
toe_hollow = v;
// it ends at the sole's underside
below = newv;
Box(below) = {-1, -0.60, -1, 2, 0.44, 2};
front() = BooleanDifference { Volume{toe}; Delete; } { Volume{below}; Delete; };
shaft = newv;
Cone(shaft) = {-0.25, -0.12, 0, -0.02, 0.48, 0, 0.13, 0.14};
shaft_hollow = newv;
Cone(shaft_hollow) = {-0.25, -0.075, 0, -0.02, 0.64, 0, 0.07, 0.095};
Dilate {{-0.25, 0, 0}, {1.5, 1, 0.92}} { Volume{shaft, shaft_hollow}; }
heel = newv;
Cylinder(heel) = {-0.33, -0.24, 0.0, 0, 0.12, 0, 0.11};
Dilate {{-0.33, 0, 0}, {1.3, 1, 1.1}} { Volume{heel}; }
solid() = BooleanUnion { Volume{sole}; Delete; } { Volume{front(), shaft, heel}; Delete; };
whole() = BooleanDifference { Volume{solid()}; Delete; } { Volume{shaft_hollow, toe_hollow}; Delete; };
Physical Volume("shoe") = {whole()};
Mesh.MeshSizeMin = size;
Mesh.MeshSizeMax = size;
Mesh.Algorithm = 6;    // frontal
Mesh.Algorithm3D = 10; // HXT
Mesh.OptimizeThreshold = 0.5;
