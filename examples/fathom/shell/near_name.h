/* How near a name that isn't known is to one that is, for "did you mean". */
#ifndef FATHOM_SHELL_NEAR_NAME_H
#define FATHOM_SHELL_NEAR_NAME_H

/* Letters that differ; the beginning of a name is as near as one wrong letter. */
int near_name_distance(const char *name, const char *known);

/* The largest distance at which a known name is likely what was meant. */
int near_name_limit(const char *name);

#endif
