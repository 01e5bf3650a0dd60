/* The distance of an unknown name to a known one, for "did you mean". */
#ifndef FATHOM_SHELL_NEAR_NAME_H
#define FATHOM_SHELL_NEAR_NAME_H

/* Letters that differ; the beginning of a name is as near as one wrong letter. */
int near_name_distance(const char *name, const char *known);

/* The maximum distance at which a known name is suggested. */
int near_name_limit(const char *name);

#endif
