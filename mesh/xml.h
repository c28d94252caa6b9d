// A walk over the tags of an XML file in memory (private to mesh/): as much of XML as .vtu files
// need. Declarations, comments and text between tags are passed over; entities are only decoded
// where a text is asked for.
#ifndef EP_MESH_XML_H
#define EP_MESH_XML_H

#include "mesh/scan.h"

typedef struct ep_xml_tag {
  ep_token name;
  bool closing, empty; // </name>, <name/>
  ep_scan attributes;  // what stands between the name and '>'
} ep_xml_tag;

// The next tag; *found false at the end of the file. The scan stands behind it, its mark on it.
ep_status ep_xml_next(ep_scan *scan, ep_xml_tag *tag, bool *found, ep_error *err);
// The raw value of an attribute; false where the tag does not have it.
bool ep_xml_attribute(const ep_xml_tag *tag, const char *name, ep_token *value);
// With &lt; &gt; &amp; &quot; &apos; decoded, cut to fit, NUL-terminated.
void ep_xml_decode(ep_token value, char *out, size_t capacity);

#endif
