// Toy car [m]: bonnet towards +x, y up. `estate` makes the other car, whose poses are the examples:
// longer, with a round roof that reaches to its tail; `size` chooses the resolution.
SetFactory("OpenCASCADE");
DefineConstant[size = {0.075, Name "size"}, estate = {0, Name "estate"}];

half = 0.56 + 0.04 * estate; // of the length
width = 0.24;                // half of it

// Prism over a polygon in the xy-plane, from -w to w along z: points xs, ys.
Macro Prism
  n = #xs();
  p = newp;
  For i In {0 : n - 1}
    Point(p + i) = {xs(i), ys(i), -w};
  EndFor
  l = newl;
  For i In {0 : n - 1}
    Line(l + i) = {p + i, p + (i + 1) % n};
  EndFor
  c = newll;
  Curve Loop(c) = {l : l + n - 1};
  f = news;
  Plane Surface(f) = {c};
  e() = Extrude {0, 0, 2 * w} { Surface{f}; };
  parts() += {e(1)};
Return

parts() = {};
// chassis with bonnet and boot
w = width;
xs() = {-half, half, half + 0.03, half - 0.02, -half};
ys() = {-0.10, -0.10, -0.01, 0.06, 0.08};
Call Prism;
// cabin
w = width - 0.04;
If (estate)
  xs() = {-half + 0.02, 0.24, 0.08, -half + 0.12};
  ys() = {0.00, 0.00, 0.27, 0.27};
Else
  xs() = {-0.40, 0.24, 0.07, -0.26};
  ys() = {0.00, 0.00, 0.27, 0.27};
EndIf
Call Prism;
// wheels
For front In {0:1}
  x = (2 * front - 1) * (0.34 + 0.02 * estate);
  For side In {0:1}
    s = 1 - 2 * side;
    v = newv;
    Cylinder(v) = {x, -0.11, s * (width - 0.06), 0, 0, s * 0.11, 0.12};
    parts() += {v};
  EndFor
EndFor

whole() = BooleanUnion { Volume{parts(0)}; Delete; } { Volume{parts({1 : #parts() - 1})}; Delete; };
Physical Volume("car") = {whole()};
Mesh.MeshSizeMin = size;
Mesh.MeshSizeMax = size;
Mesh.Algorithm = 6;    // frontal
Mesh.Algorithm3D = 10; // HXT
Mesh.OptimizeThreshold = 0.5;
