// The built-in font: glyphs as strokes (own drawing), so that labels look right at any size.
#ifndef EP_RESULTS_FONT_H
#define EP_RESULTS_FONT_H

// Grid units: baseline y = 2, height of small letters y = 6, capitals y = 8, descenders y = 0.
enum { EP_FONT_BASELINE = 2, EP_FONT_CAPITAL = 6 };
static const double ep_font_gap = 1.6; // between glyphs

// Strokes of a character, separated by blanks. A stroke is a row of points, two digits each (x, y);
// with '~' before it the points are the control polygon of a quadratic B-spline.
const char *ep_font_glyph(char c);
double ep_font_advance(char c); // width without gap [grid units]

#endif
