/* Lists of records with stamps, read from text files of one record a line. Internal to drivers/. */
#ifndef FATHOM_RECORD_LIST_H
#define FATHOM_RECORD_LIST_H

#include "recording/recording_internal.h"
#include "recording/recording_text.h"

/* A list that grows by doubling. */
struct record_list {
    void *items;
    size_t item_size;
    int count, capacity;
};

/* Room for one more item at the end; NULL without memory. */
void *record_list_more(struct record_list *list);

/* What to do with a record whose stamp may not come after the one before it. */
enum record_order { ORDER_KEEP, ORDER_SKIP, ORDER_REPLACE };
enum record_order record_list_order(const struct record_list *list, int64_t stamp);

/* What was wrong with lines that were left out. */
struct record_faults {
    int unreadable, not_finite, out_of_order, first_line;
};

/* Counts one of them. */
void record_fault(struct record_faults *faults, int *kind, int line);

/* Reads a stamp and exactly 'count' finite numbers; false (and counted) for a line that is to be left out. */
bool record_numbers(struct text_file *text, int64_t *stamp, double *values, int count,
                    struct record_faults *faults);

/* Makes room for the record if its stamp allows. Returns false without memory; *item is NULL for a line to be left
 * out. */
bool record_place(struct record_list *list, int64_t stamp, struct record_faults *faults, int line,
                  void **item);

/* Puts in a pose whose quaternion x y z w is about of unit length; false without memory. */
bool record_pose(struct record_list *list, int64_t stamp, const double position[3],
                 const double quaternion[4], struct record_faults *faults, int line);

/* Reads a whole file by 'take', which returns false without memory. separator: what lies between values beside
 * blanks, and a first line with names is left out then; 0: blanks alone. */
int record_list_read(struct recording *recording, const char *path, bool may_be_missing, char separator,
                     struct record_list *list,
                     bool (*take)(struct text_file *, struct record_list *, struct record_faults *));

#endif
